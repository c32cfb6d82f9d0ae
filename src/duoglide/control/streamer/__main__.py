"""The streamer's process: ``python -m duoglide.control.streamer RING ORDERS BULK SIGNALS``.

Started by ``control.host.process`` with four inherited descriptors; not for people.
"""

from __future__ import annotations

import gc
import os
import signal
import socket
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

from duoglide.control.channel.events import Happening
from duoglide.control.channel.orders import ORDER, Assignment, Order, pack_object, receive_object
from duoglide.control.channel.ring import Ring
from duoglide.control.channel.setpoints import PreparedSetpoints
from duoglide.control.streamer.clock import MonotonicClock, run_cycles
from duoglide.control.streamer.cycle import Streamer
from duoglide.control.streamer.link import BusLink
from duoglide.control.streamer.realtime import become_helper, become_realtime
from duoglide.drives.bus.buses import open_bus
from duoglide.drives.pdo import NMT, Nmt, pack_nmt
from duoglide.errors import BusError, DuoglideError
from duoglide.motion.path.transfer import TransferPath
from duoglide.planning.trajectory import Trajectory

_LOADED_EARLY = (Trajectory, TransferPath)  # an import while cycles run would hold them up
_ASK_ANYWAY = 8  # cycles after which the socket is asked for its end, announced or not
_DEAF = 0.7  # [s] after which a host that is silent, and was told to end, is ended
_KEPT = 12  # prepared setpoints: what moves, its look-ahead, and what a run ahead of it prepares


class SocketInbox:
    """Orders and setpoints from the host, over two sockets.

    Args:
        orders: Fixed-size orders.
        ring: In which the host announces them: to ask a socket is expensive.
        host: Process number of the host.
        signals: Where signals come that it has not taken yet; they are looked at, and left there.
    """

    def __init__(
        self, orders: socket.socket, ring: Ring, host: int, signals: socket.socket
    ) -> None:
        orders.setblocking(False)
        self._socket, self._ring, self._host = orders, ring, host
        self._signals, self._told = signals, 0.0
        self._known = self._unasked = 0
        self._rest = b""
        self._ended = False
        self._prepared: dict[int, PreparedSetpoints] = {}
        self._following: dict[int, PreparedSetpoints] = {}

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
        return list(map(Order._make, ORDER.iter_unpack(data[:whole])))

    def prepared(self, number: int) -> PreparedSetpoints | None:
        """Return setpoints that have been handed over."""
        return self._prepared.get(number)

    def following(self, number: int) -> PreparedSetpoints | None:
        """Return the setpoints that go on from others."""
        return self._following.get(number)

    @property
    def host_gone(self) -> bool:
        """Whether the host has closed its end, or has left this process an orphan."""
        return self._ended or os.getppid() != self._host

    @property
    def host_waited(self) -> int:
        """For how long the host's threads have waited for a processor [ns]; 0 where unknown."""
        waited = 0
        for file in Path(f"/proc/{self._host}/task").glob("*/schedstat"):
            with suppress(OSError, ValueError, IndexError):
                waited += int(file.read_text().split()[1])
        return waited

    def end_deaf_host(self) -> None:
        """End a host in which nothing goes on any more, if a signal has told it to end."""
        try:
            numbers = self._signals.recv(64, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except OSError:
            return
        if any(self._ring.fatal_signals >> number & 1 for number in numbers):
            now = time.monotonic()
            self._told = self._told or now
            if now - self._told > _DEAF and not self.host_gone:
                os.kill(self._host, signal.SIGKILL)

    def keep(self, prepared: PreparedSetpoints) -> None:
        """Take setpoints over, and let go of the oldest."""
        self._prepared[prepared.number] = prepared
        if prepared.after:
            self._following[prepared.after] = prepared
        if len(self._prepared) > _KEPT:
            oldest = self._prepared.pop(min(self._prepared))
            self._following.pop(oldest.after, None)


def receive_setpoints(bulk: socket.socket, inbox: SocketInbox) -> None:
    """Read setpoints until the host closes its end; a thread does this, in the cycle's pauses.

    What goes wrong with them is answered, whatever it is: the host would wait for a dead thread.
    """
    become_helper()
    while True:
        try:
            _keep(receive_object(bulk), inbox)
        except (EOFError, OSError):
            return
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            _answer(bulk, DuoglideError(f"the streamer cannot take the setpoints over: {why}"))
        else:
            _answer(bulk, None)


def _keep(received: object, inbox: SocketInbox) -> None:
    if isinstance(received, PreparedSetpoints):
        received.at(received.trajectory.duration)  # whatever loads late loads here
        inbox.keep(received)
        gc.freeze()


def _answer(bulk: socket.socket, thing: object) -> None:
    """Answer the host, if it is still there; that it is gone is seen in the next cycle."""
    with suppress(BrokenPipeError):
        bulk.sendall(pack_object(thing))


def main(arguments: list[str]) -> int:
    """Stream until told to close, or until the host is gone and the drives are off."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the host hears them too, and stops the machine
    descriptor, orders, objects, signals = map(int, arguments)
    ring = Ring(descriptor)
    bulk = socket.socket(fileno=objects)
    heard = socket.socket(fileno=signals)
    inbox = SocketInbox(socket.socket(fileno=orders), ring, os.getppid(), heard)
    assignment = receive_object(bulk)
    if not isinstance(assignment, Assignment):
        return 2
    try:
        link = BusLink(open_bus(assignment.bus, assignment.bit_rate))
        # Before the first SYNC: whatever a maker's PDOs would answer or do at a SYNC, they do not.
        link.send([(NMT, pack_nmt(Nmt.ENTER_PRE_OPERATIONAL, 0))])
    except BusError as error:
        _answer(bulk, error)
        return 1
    settings = assignment.settings
    streamer = Streamer(link, settings, inbox, ring)
    threading.Thread(target=receive_setpoints, args=(bulk, inbox), daemon=True).start()
    privileges = become_realtime()
    streamer.tell(Happening.READY, code=privileges.to_bits())
    _answer(bulk, None)
    run_cycles(streamer, MonotonicClock(), settings.cycle)
    link.close()
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except EOFError:
        sys.exit(1)  # the host was gone before it said what to do
