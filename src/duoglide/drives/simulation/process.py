"""The process in which simulated drives run; started by ``simulated.SimulatedDrives``."""

from __future__ import annotations

import gc
import os
import signal
import time
from contextlib import suppress
from multiprocessing.connection import Connection

from duoglide.drives.buses import BusKind, open_bus, parse_bus
from duoglide.drives.simulated import DISMISS, build_rack, serve_drives
from duoglide.drives.simulation.faults import Injection
from duoglide.drives.simulation.hub import Hub
from duoglide.drives.simulation.rack import DriveRack
from duoglide.errors import BusError

_LINGER = 10.0  # how long to stay for those still connected once the parent is gone [s]


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
    settings, positions, bus, plants, standstill = pipe.recv()
    rack = build_rack(settings, positions, plants, standstill=standstill)
    control = _Control(pipe, rack)
    _be_prompt()
    if parse_bus(bus).kind is BusKind.VIRTUAL:
        _serve_hub(rack, control, pipe)
    else:
        _serve_bus(bus, settings.bit_rate, rack, control, pipe)


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
