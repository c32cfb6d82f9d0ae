"""The process in which simulated drives run; started by ``simulated.SimulatedDrives``."""

from __future__ import annotations

import errno
import gc
import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, NamedTuple

from duoglide.drives.bus.buses import BusKind, frame_sender, open_bus, parse_bus
from duoglide.drives.simulation.faults import Injection
from duoglide.drives.simulation.hub import Hub
from duoglide.drives.simulation.makers.imitation import Imitation
from duoglide.drives.simulation.plant import PlantParameters
from duoglide.drives.simulation.rack import DriveRack, build_rack
from duoglide.errors import BusError
from duoglide.machine import DriveSettings

if TYPE_CHECKING:
    import can

_LINGER = 10.0  # how long to stay for those still connected once the parent is gone [s]
_PASSING = frozenset({errno.ENETDOWN, errno.ENETUNREACH, errno.ENOBUFS})  # a link that is down
DISMISS = "dismiss"  # the last thing in the pipe, if all goes well


class Job(NamedTuple):
    """The first thing in the pipe; see ``simulated.SimulatedDrives``."""

    settings: DriveSettings
    positions: tuple[float, ...]
    bus: str
    plants: Sequence[PlantParameters] | None
    standstill: float
    imitations: Sequence[Imitation]


class _Control:
    """What comes through the pipe from the parent."""

    def __init__(self, pipe: Connection, rack: DriveRack) -> None:
        self._pipe = pipe
        self._rack = rack
        self.ended_at: float | None = None
        self.dismissed = False  # asked to end, as against abandoned

    def look(self) -> None:
        """Deal with what has come."""
        if self.ended_at is not None:
            return
        try:
            while self._pipe.poll():
                self._obey(self._pipe.recv())
        except (EOFError, OSError):
            self.ended_at = time.monotonic()

    def _obey(self, request: object) -> None:
        if isinstance(request, Injection):
            request.apply(self._rack.nodes[request.axis - 1])
            self._pipe.send(None)
        elif request == DISMISS:
            self.dismissed = True
        else:
            self._pipe.send(self._rack.snapshot())


def _be_prompt() -> None:
    """Ask for what keeps a process from being late; go without where it is not granted."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the parent decides when to stop
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    gc.collect()
    gc.freeze()


def main(descriptor: int) -> None:
    """Serve drives until the pipe closes.

    Args:
        descriptor: Of the pipe to the parent; the first thing in it is the job.
    """
    pipe = Connection(descriptor)
    try:
        _serve(pipe)
    except BusError as error:
        pipe.send(error)
    except (BrokenPipeError, EOFError):
        return  # the parent was gone before the drives were there


def _serve(pipe: Connection) -> None:
    job: Job = pipe.recv()
    rack = build_rack(
        job.settings,
        job.positions,
        job.plants,
        standstill=job.standstill,
        imitations=job.imitations,
    )
    control = _Control(pipe, rack)
    _be_prompt()
    if parse_bus(job.bus).kind is BusKind.VIRTUAL:
        _serve_hub(rack, control, pipe)
    else:
        _serve_bus(job.bus, job.settings.bit_rate, rack, control, pipe)


def _serve_hub(rack: DriveRack, control: _Control, pipe: Connection) -> None:
    with Hub(rack) as hub:
        hub.watch(pipe.fileno(), control.look)
        pipe.send(hub.address)
        while control.ended_at is None:
            hub.turn()
        hub.forget(pipe.fileno())
        abandoned = not control.dismissed  # then its streamer may still be stopping the machine
        while abandoned and hub.clients and time.monotonic() - control.ended_at < _LINGER:
            hub.turn()


def _serve_bus(
    name: str, bit_rate: int, rack: DriveRack, control: _Control, pipe: Connection
) -> None:
    import can

    bus = open_bus(name, bit_rate)
    try:
        pipe.send(name)

        def until() -> bool:
            control.look()
            return control.ended_at is not None

        serve_drives(bus, rack, until)
    except can.CanError as error:
        raise BusError(f"bus {name}: {error}") from error
    finally:
        bus.shutdown()


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
