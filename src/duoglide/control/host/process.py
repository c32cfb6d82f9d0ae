"""The streamer as a process of its own, seen from the host.

Not ``multiprocessing``: that imports the user's script again in the child, and a first script of
ten lines has no ``if __name__`` guard. The child is a fresh interpreter that inherits three
descriptors: the ring, a socket for orders, and a socket for prepared setpoints.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING

from duoglide.control.channel.orders import ORDER, Command, pack_object, receive_object
from duoglide.control.channel.ring import Ring
from duoglide.control.host.interrupt import EndingWatch
from duoglide.errors import BusError, DuoglideError

if TYPE_CHECKING:
    from duoglide.control.channel.orders import Assignment
    from duoglide.control.channel.setpoints import PreparedSetpoints

_START_PATIENCE = 20.0  # [s] a loaded computer may take to start an interpreter
_LOAD_PATIENCE = 5.0  # [s] for setpoints, beside what their size takes; the monitor waits 3 s
_SLOWEST = 1e6  # [byte/s] at which a busy streamer, which reads between cycles, takes them over
_CLOSE_PATIENCE = 12.0  # [s] for what still moves to stop on its path, and the power to go off


class StreamerProcess:
    """A running streamer; a resource: ``close`` it, or use ``with``.

    Args:
        assignment: Which bus, which machine.

    Attributes:
        ring: Where its records are.
        endings: Hears signals that mean the end; the streamer looks there too, where this process
            cannot any more.

    Raises:
        BusError: It could not start, or could not open the bus.
    """

    def __init__(self, assignment: Assignment) -> None:
        descriptor = Ring.allocate()
        self.ring = Ring(descriptor)
        self._ordering, self._loading = threading.Lock(), threading.Lock()
        self._orders, orders = socket.socketpair()
        self._bulk, bulk = socket.socketpair()
        self.endings = EndingWatch()
        theirs = (descriptor, orders.fileno(), bulk.fileno(), self.endings.fileno())
        command = [sys.executable, "-P", "-m", "duoglide.control.streamer", *map(str, theirs)]
        try:
            # A session of its own: Ctrl-C and Ctrl-Z in the terminal are for the host alone.
            self._process = subprocess.Popen(
                command, pass_fds=theirs, start_new_session=True, stdin=subprocess.DEVNULL
            )
        finally:
            orders.close()
            bulk.close()
            os.close(descriptor)
        try:
            self._hand_over(assignment, _START_PATIENCE)
        except DuoglideError:
            self.close()
            raise

    @property
    def pid(self) -> int:
        """Its process number."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def order(self, command: Command, argument: int = 0, value: float = 0.0) -> None:
        """Give an order; it is obeyed in the next cycle.

        Raises:
            BusError: The streamer is gone.
        """
        try:
            with self._ordering:
                self._orders.sendall(ORDER.pack(command, argument, value))
                self.ring.announce_order()
        except OSError as error:
            raise BusError("the streamer process is gone; the drives have stopped") from error

    def load(self, prepared: PreparedSetpoints) -> None:
        """Hand setpoints over; returns when the streamer has them.

        Raises:
            BusError: The streamer is gone, or stuck.
        """
        self._hand_over(prepared, _LOAD_PATIENCE)

    def close(self, hopeless: bool = False) -> None:
        """End the process: politely, then firmly.

        Args:
            hopeless: Whether it has not answered for long; then firmly at once.
        """
        if hopeless:
            self._process.kill()
        elif self.alive:
            try:
                self.order(Command.CLOSE)
                self._process.wait(_CLOSE_PATIENCE)
            except (BusError, subprocess.TimeoutExpired):
                self._process.kill()
        self._process.wait()
        self._orders.close()
        self._bulk.close()
        self.endings.close()
        self.ring.close()

    def _hand_over(self, thing: object, patience: float) -> None:
        """Send one pickled object and wait until the streamer says that it has it."""
        with self._loading:
            self._exchange(pack_object(thing), patience)

    def _exchange(self, data: bytes, patience: float) -> None:
        patience += len(data) / _SLOWEST
        self._bulk.settimeout(patience)
        try:
            self._bulk.sendall(data)
            answer = receive_object(self._bulk)
        except TimeoutError as error:
            raise BusError(
                f"the streamer process {self.pid} is stuck: it has not answered for {patience:.1f}"
                " s; the drives stop by themselves"
            ) from error
        except (OSError, EOFError) as error:
            code = self._exit_code()
            raise BusError(f"the streamer process has ended (exit code {code})") from error
        if isinstance(answer, DuoglideError):
            raise answer

    def _exit_code(self) -> int | None:
        deadline = time.monotonic() + 1.0
        while self.alive and time.monotonic() < deadline:
            time.sleep(0.01)
        return self._process.poll()
