"""The streamer's process: ``python -m duoglide.control.streamer RING ORDERS BULK``.

Started by ``control.host.process`` with three inherited descriptors; not for people.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import socket
import sys
import threading
from contextlib import suppress

from duoglide.control.channel.orders import Happening, Order
from duoglide.control.channel.ring import Ring
from duoglide.control.channel.setpoints import Program
from duoglide.control.host.process import LENGTH, ORDER, Assignment, receive_pickle
from duoglide.control.streamer.clock import MonotonicClock
from duoglide.control.streamer.cycle import Streamer
from duoglide.control.streamer.link import BusLink
from duoglide.control.streamer.loop import run_cycles
from duoglide.control.streamer.realtime import become_helper, become_realtime
from duoglide.drives.buses import open_bus
from duoglide.errors import BusError
from duoglide.motion.trajectory import Trajectory
from duoglide.motion.transfer_path import TransferPath

_LOADED_EARLY = (Trajectory, TransferPath)  # an import while cycles run would hold them up
_ASK_ANYWAY = 8  # cycles after which the socket is asked for its end, announced or not
_KEPT = 3  # programs: an approach, its run, and the one after


class SocketInbox:
    """Orders and programs from the host, over two sockets.

    Args:
        orders: Fixed-size orders.
        ring: In which the host announces them: to ask a socket is dear.
        host: Process number of the host.
    """

    def __init__(self, orders: socket.socket, ring: Ring, host: int) -> None:
        orders.setblocking(False)
        self._socket, self._ring, self._host = orders, ring, host
        self._known = self._unasked = 0
        self._rest = b""
        self._ended = False
        self._programs: dict[int, Program] = {}

    def orders(self) -> list[Order]:
        """Return the orders that have come."""
        announced = self._ring.orders
        self._unasked += 1
        if announced == self._known and self._unasked < _ASK_ANYWAY:
            return []
        self._known, self._unasked = announced, 0
        try:
            data = self._socket.recv(4096)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._ended = True
            return []
        data = self._rest + data
        whole = len(data) // ORDER.size * ORDER.size
        self._rest = data[whole:]
        return list(ORDER.iter_unpack(data[:whole]))

    def program(self, number: int) -> Program | None:
        """Return a program that has been handed over."""
        return self._programs.get(number)

    @property
    def host_gone(self) -> bool:
        """Whether the host has closed its end, or has left this process an orphan."""
        return self._ended or os.getppid() != self._host

    def keep(self, program: Program) -> None:
        """Take a program over, and let go of the oldest."""
        self._programs[program.number] = program
        if len(self._programs) > _KEPT:
            del self._programs[min(self._programs)]


def take_programs(bulk: socket.socket, inbox: SocketInbox) -> None:
    """Read programs until the host closes its end; a thread does this, in the cycle's pauses."""
    become_helper()
    while True:
        try:
            program = receive_pickle(bulk)
        except (EOFError, OSError):
            return
        if isinstance(program, Program):
            program.setpoint(program.trajectory.duration)  # whatever loads late loads here
            inbox.keep(program)
            gc.freeze()
        _answer(bulk, None)


def _answer(bulk: socket.socket, thing: object) -> None:
    """Answer the host, if it is still there; that it is gone is seen in the next cycle."""
    data = pickle.dumps(thing)
    with suppress(BrokenPipeError):
        bulk.sendall(LENGTH.pack(len(data)) + data)


def main(arguments: list[str]) -> int:
    """Stream until told to close, or until the host is gone and the drives are off."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the host hears them too, and stops the machine
    descriptor, orders, bulk = map(int, arguments)
    ring = Ring(descriptor)
    programs = socket.socket(fileno=bulk)
    inbox = SocketInbox(socket.socket(fileno=orders), ring, os.getppid())
    assignment = receive_pickle(programs)
    if not isinstance(assignment, Assignment):
        return 2
    try:
        link = BusLink(open_bus(assignment.bus, assignment.bit_rate))
    except BusError as error:
        _answer(programs, error)
        return 1
    settings = assignment.settings
    streamer = Streamer(link, settings, inbox, ring)
    threading.Thread(target=take_programs, args=(programs, inbox), daemon=True).start()
    granted = become_realtime()
    streamer.tell(Happening.READY, code=granted.fifo | granted.locked << 1 | granted.slack << 2)
    _answer(programs, None)
    run_cycles(streamer, MonotonicClock(), settings.cycle)
    link.close()
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except EOFError:
        sys.exit(1)  # the host was gone before it said what to do
