"""Three simulated drives: in this process on an open bus, or in a process of their own.

On the bus ``virtual`` that process also is the hub that joins everyone; its address is what other
programs connect to.
"""

from __future__ import annotations

import errno
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from duoglide.drives.buses import frame_sender, parse_bus
from duoglide.drives.simulation.faults import Injection
from duoglide.drives.simulation.firmware_homing import HomingAxis
from duoglide.drives.simulation.node import DriveNode
from duoglide.drives.simulation.plant import Plant, PlantParameters
from duoglide.drives.simulation.rack import DriveRack, DriveSnapshot
from duoglide.drives.standstill import Standstill
from duoglide.errors import BusError, DriveTimeout
from duoglide.machine import DriveSettings

if TYPE_CHECKING:
    import can

    from duoglide.drives.simulation.application import AxisApplication

STANDSTILL = 0.1  # how long a shared computer may leave a process without a processor [s]
_START_PATIENCE = 20.0  # how long the process may take to come up [s]
_ANSWER_PATIENCE = 5.0
_PASSING = frozenset({errno.ENETDOWN, errno.ENETUNREACH, errno.ENOBUFS})  # a link that is down
_NEGATIVE_SWITCH, _POSITIVE_SWITCH = 17, 18  # homing methods
DISMISS = "dismiss"  # the last thing in the pipe, if all goes well


def build_rack(
    settings: DriveSettings,
    positions: Sequence[float],
    plants: Sequence[PlantParameters] | None = None,
    make_axis: Callable[[], AxisApplication] = HomingAxis,
    standstill: float = STANDSTILL,
) -> DriveRack:
    """Build the three drives of a machine, switched on and not homed.

    Args:
        settings: Node numbers, scale and direction.
        positions: Where the carriages stand [mm], three values.
        plants: What hangs on each drive; three, or None for the default.
        make_axis: Makes the firmware's application of one drive.
        standstill: For how long they stand still with a host that agrees to it, and as long as
            they wait for setpoints at the least; 0 for never [s].
    """
    shared = Standstill(max(standstill, settings.setpoint_patience) if standstill else 0.0)
    nodes = []
    for i, node_id in enumerate(settings.node_ids):
        scale = settings.direction[i] * settings.increments_per_mm[i]
        parameters = plants[i] if plants is not None else PlantParameters()
        plant = Plant(_with_switch(parameters, settings, i))
        plant.position = float(positions[i])
        nodes.append(DriveNode(node_id, make_axis, plant, scale, shared))
    return DriveRack(nodes, shared)


def _with_switch(parameters: PlantParameters, settings: DriveSettings, i: int) -> PlantParameters:
    """Put the limit switch that homing searches where the machine file says that it is."""
    method, place = settings.homing.method[i], settings.homing.switch_position[i]
    if method not in (_NEGATIVE_SWITCH, _POSITIVE_SWITCH):
        return parameters
    low, high = parameters.limit_switches
    at_low = (method == _NEGATIVE_SWITCH) == (settings.direction[i] > 0)
    return replace(parameters, limit_switches=(place, high) if at_low else (low, place))


def serve_drives(bus: can.BusABC, rack: DriveRack, until: Callable[[], bool]) -> None:
    """Let the drives take part in an open bus until ``until`` says so.

    While a link is down the drives live on: their frames are lost and their watchdogs see it.

    Raises:
        can.CanError: The bus has failed for good.
    """
    import can

    send = frame_sender(bus)
    waiting: list[tuple[int, bytes]] = []
    rack.attach(lambda can_id, data: waiting.append((can_id, data)))
    while not until():
        now = time.monotonic_ns() // 1000  # before looking: all that came until now will be read
        try:
            _receive_all(bus, rack)
            rack.poll(now)
            if waiting:
                send(waiting)
        except can.CanOperationError as error:
            if error.error_code not in _PASSING:
                raise
            rack.poll(now)
            time.sleep(rack.patience)
        waiting.clear()


def _receive_all(bus: can.BusABC, rack: DriveRack) -> None:
    """Hand over what waits on the bus, or what comes within the drives' patience."""
    message = bus.recv(rack.patience)
    while message is not None:
        if not (message.is_error_frame or message.is_remote_frame or message.is_extended_id):
            now = time.monotonic_ns() // 1000
            rack.receive(message.arbitration_id, bytes(message.data), now)
        message = bus.recv(0.0)


class SimulatedDrives:
    """Three simulated drives in a process of their own; a context manager.

    The process ends with the handle, and soon after its parent if that dies without a word.

    Args:
        settings: The machine's drives.
        positions: Where the carriages stand [mm], three values.
        bus: ``virtual`` starts a hub; any other name is opened and served.
        plants: What hangs on each drive; three, or None for the default.
        standstill: For how long they stand still with a host that agrees to it; see ``build_rack``.
    """

    def __init__(
        self,
        settings: DriveSettings,
        positions: Sequence[float],
        *,
        bus: str = "virtual",
        plants: Sequence[PlantParameters] | None = None,
        standstill: float = STANDSTILL,
    ) -> None:
        parse_bus(bus)
        self._job = (settings, tuple(map(float, positions)), bus, plants, standstill)
        self._address = ""

    def __enter__(self) -> SimulatedDrives:
        self._pipe, theirs = multiprocessing.Pipe()
        program = "from duoglide.drives.simulation.process import main"
        code = f"import sys; {program}; main(int(sys.argv[1]))"
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", code, str(theirs.fileno())],
            pass_fds=(theirs.fileno(),),
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # keys at the terminal are for the parent alone
        )
        theirs.close()
        try:
            self._pipe.send(self._job)
            self._address = str(self._answer(_START_PATIENCE))
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def address(self) -> str:
        """The name of the bus that they are on, for ``open_bus``."""
        return self._address

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def inject(self, injection: Injection) -> None:
        """Make something happen to a drive; it has happened when this returns.

        Raises:
            DriveTimeout: The process does not answer.
        """
        self._pipe.send(injection)
        self._answer(_ANSWER_PATIENCE)

    def snapshot(self) -> tuple[DriveSnapshot, ...]:
        """Return what the drives really do, past the bus.

        Raises:
            DriveTimeout: The process does not answer.
        """
        self._pipe.send("snapshot")
        answer: tuple[DriveSnapshot, ...] = self._answer(_ANSWER_PATIENCE)  # type: ignore[assignment]
        return answer

    def _answer(self, patience: float) -> object:
        try:
            if not self._pipe.poll(patience):
                raise DriveTimeout(f"the simulated drives do not answer for {patience:g} s")
            answer: object = self._pipe.recv()
        except (EOFError, ConnectionResetError):
            raise BusError("the process of the simulated drives has ended") from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def close(self) -> None:
        """End the process."""
        with suppress(OSError):  # it may have ended by itself
            self._pipe.send(DISMISS)
        self._pipe.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
