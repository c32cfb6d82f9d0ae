"""A simulated drive as a node on a CANopen bus (CiA 301): NMT, SDO, PDO, SYNC, heartbeat, EMCY.

The application is any ``AxisApplication``: the Python one in ``firmware``, or the C one of
firmware_interface/reference_axis. The node has no clock: ``advance`` gives it time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import floor

from duoglide.drives import pdo
from duoglide.drives.pdo import Nmt, NmtState
from duoglide.drives.simulation.firmware.watchdogs import HEARTBEAT_LOST
from duoglide.drives.simulation.makers.imitation import CONTRACT, Imitation
from duoglide.drives.simulation.node.application import AxisApplication
from duoglide.drives.simulation.node.memory import ParameterMemory
from duoglide.drives.simulation.node.objects import NodeObjects
from duoglide.drives.simulation.node.process_data import ProcessData
from duoglide.drives.simulation.node.sdo_server import SdoServer
from duoglide.drives.simulation.plant import Plant
from duoglide.drives.standstill import Standstill

Send = Callable[[int, bytes], None]
_SYNC_LENGTH = 0x8240
_TICK = 2000  # longest step of the application under power [us]
_IDLE_TICK = 5000


@dataclass(slots=True)
class Misbehaviour:
    """What is wrong with a drive for the sake of a test."""

    heartbeat_silent: bool = False
    tpdo_silent: bool = False
    boot_delay: float = 0.0  # [s]
    sdo_delay: float = 0.0  # [s]
    drop_received: int = 0  # cyclic frames still to be ignored
    drop_sent: int = 0


class DriveNode:
    """One drive: its application, its carriage and its place on the bus."""

    def __init__(
        self,
        node_id: int,
        make_axis: Callable[[], AxisApplication],
        plant: Plant,
        increments_per_mm: float,
        standstill: Standstill | None = None,
        *,
        imitation: Imitation = CONTRACT,
    ) -> None:
        self.node_id = node_id
        self.plant = plant
        self.scale = increments_per_mm  # negative where the drive counts against +y
        self.wrong = Misbehaviour()
        self.inputs = 0  # what others have wired to 0x60FD; the limit switches are its own
        self.state = NmtState.BOOT_UP
        self.send: Send = _nowhere
        self._make_axis = make_axis
        self._imitation = imitation
        self._variables = imitation.variables(node_id)
        self._memory = ParameterMemory()
        self._standstill = standstill or Standstill()
        self._boot_wait = 0.0  # [us]
        self._clock = 0  # [us]
        self._power_up()

    def _power_up(self) -> None:
        self.axis = self._make_axis()
        self.objects = NodeObjects(
            self._variables, self.axis, self._memory, self._standstill, self._imitation
        )
        self.process_data = ProcessData(self.objects, self.axis, self.node_id)
        self._sdo = SdoServer(self.objects, self._reply)
        self._sdo_queue: list[tuple[float, bytes]] = []  # when to serve, request
        self._zero = self.plant.measured  # the encoder counts from where it was switched on
        self._heartbeat_age = 0
        self._odd_sync = False  # SYNC with a length that was not agreed
        self.state = NmtState.BOOT_UP
        self._boot_wait = 1e6 * max(self.wrong.boot_delay, self._imitation.boot_delay)
        self.axis.tick(0, 0)

    def _reply(self, data: bytes) -> None:
        self.send(pdo.SDO_REPLY + self.node_id, data)

    # -- frames -------------------------------------------------------------------------------

    def receive(self, can_id: int, data: bytes) -> None:
        """Take one frame from the bus."""
        if self.state is NmtState.BOOT_UP:
            return
        if can_id == pdo.SYNC:
            self._sync(len(data))
        elif can_id == pdo.NMT:
            if len(data) >= 2 and data[1] in (0, self.node_id):
                self._command(data[0])
        elif can_id == pdo.SDO_REQUEST + self.node_id:
            if self.state is not NmtState.STOPPED and len(data) == 8:
                delay = max(self.wrong.sdo_delay, self._imitation.sdo_delay)
                self._sdo_queue.append((self._clock + 1e6 * delay, data))
                self._serve_sdo()
        elif can_id == pdo.HEARTBEAT + (self.axis.read(0x1016, 1) >> 16):
            self.axis.heartbeat()
        elif self.state is NmtState.OPERATIONAL and self.process_data.listens(can_id):
            if self.wrong.drop_received > 0:
                self.wrong.drop_received -= 1
                return
            self._report(self.process_data.receive(can_id, data))

    def _sync(self, length: int) -> None:
        if self.state is not NmtState.OPERATIONAL:
            return
        if length != (1 if self.objects.read(0x1019, 0) else 0):  # with a counter, or without
            self._report(0 if self._odd_sync else _SYNC_LENGTH)
            self._odd_sync = True
            return
        self._odd_sync = False
        self.axis.sync()
        self._send_all(self.process_data.sync())  # values as they are at this SYNC ...
        self.process_data.latch()  # ... and the setpoint that came before it

    def _send_all(self, frames: list[tuple[int, bytes]]) -> None:
        if self.wrong.tpdo_silent:
            return
        for can_id, data in frames:
            if self.wrong.drop_sent > 0:
                self.wrong.drop_sent -= 1
            else:
                self.send(can_id, data)

    def _command(self, command: int) -> None:
        """Obey an NMT command (CiA 301 figure 49)."""
        if command == Nmt.START and self.state is not NmtState.OPERATIONAL:
            self._enter(NmtState.OPERATIONAL)
            self._send_all(self.process_data.events(0))
        elif command == Nmt.STOP:
            self._enter(NmtState.STOPPED)
        elif command == Nmt.ENTER_PRE_OPERATIONAL:
            self._enter(NmtState.PRE_OPERATIONAL)
        elif command == Nmt.RESET_NODE:
            self.reboot()
        elif command == Nmt.RESET_COMMUNICATION:
            self._enter(NmtState.PRE_OPERATIONAL)
            self.objects.reset_communication()
            self._boot_up()

    def _enter(self, state: NmtState) -> None:
        self.state = state
        if state is NmtState.PRE_OPERATIONAL:  # a host begins anew, or this one is lost
            self._standstill.agreed = False
        self.axis.communication(state is NmtState.OPERATIONAL)
        self.process_data.forget()

    def reboot(self) -> None:
        """Lose everything, as at power-up."""
        self._power_up()

    def _boot_up(self) -> None:
        self.state = NmtState.PRE_OPERATIONAL
        self.send(pdo.HEARTBEAT + self.node_id, bytes((NmtState.BOOT_UP,)))

    def _serve_sdo(self) -> None:
        while self._sdo_queue and self._sdo_queue[0][0] <= self._clock:
            self._sdo.request(self._sdo_queue.pop(0)[1])

    def _report(self, code: int) -> None:
        """Send an EMCY for an error of communication that is not the application's."""
        if code:
            self.objects.remember_error(code)
            self.send(pdo.EMCY + self.node_id, pdo.pack_emergency(code, 0x11))

    # -- time ---------------------------------------------------------------------------------

    def advance(self, dt: int) -> None:
        """Let ``dt`` microseconds pass."""
        passed = dt
        self._clock += dt
        if self.state is NmtState.BOOT_UP:
            self._boot_wait -= dt
            if self._boot_wait <= 0:
                self._boot_up()
        while dt > 0:
            step = min(dt, _TICK if self.axis.powered else _IDLE_TICK)
            self._step(step)
            dt -= step
        self._beat(passed)
        self._serve_sdo()
        if self.state is NmtState.OPERATIONAL:
            self._send_all(self.process_data.events(passed))

    def _step(self, dt: int) -> None:
        seconds = dt * 1e-6
        if self.axis.powered:
            unit = 256.0 * self.scale
            goal = self._zero + self.axis.servo_demand / unit
            self.plant.drive(goal, self.axis.servo_velocity / unit, seconds)
        else:
            self.plant.coast(not self.axis.brake_released, seconds)
        self.axis.set_inputs(self.inputs | self._limit_switches())
        self.axis.tick(dt, floor((self.plant.measured - self._zero) * self.scale + 0.5))
        self.tell_emergencies()

    def tell_emergencies(self) -> None:
        """Send what the application has found to be wrong, at once."""
        for code in self.axis.take_emergencies():
            self._emergency(code)

    def _limit_switches(self) -> int:
        """Bits 0 and 1 of 0x60FD, in the direction that the drive counts in."""
        low, high = self.plant.switches if self.scale > 0.0 else self.plant.switches[::-1]
        return low | high << 1

    def _emergency(self, code: int) -> None:
        self.objects.remember_error(code)
        if self.state not in (NmtState.BOOT_UP, NmtState.STOPPED):
            frame = pdo.pack_emergency(code, self.axis.error_register)
            self.send(pdo.EMCY + self.node_id, frame)
        if code == HEARTBEAT_LOST and self.objects.read(0x1029, 1) == 0:
            self._enter(NmtState.PRE_OPERATIONAL)

    def _beat(self, dt: int) -> None:
        period = 1000 * self.objects.read(0x1017, 0)
        self._heartbeat_age += dt
        if period and self._heartbeat_age >= period and self.state is not NmtState.BOOT_UP:
            self._heartbeat_age = 0
            if not self.wrong.heartbeat_silent:
                self.send(pdo.HEARTBEAT + self.node_id, bytes((self.state,)))


def _nowhere(can_id: int, data: bytes) -> None:
    """Send to no bus."""
