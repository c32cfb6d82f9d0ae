"""A program under way, seen from the host: its planner's process, and what it hands over in time.

Two threads do this, and nobody waits for them but whoever asks for the first part. One asks the
user's iterable for the next path when the planner wants one. The other takes parts from the planner
and hands them to the streamer, a few ahead of the one that moves.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from duoglide.control.channel.orders import Command, pack_object, receive_object
from duoglide.control.host.run.parts import PlannedPart, ProgramOrder
from duoglide.errors import DuoglideError, InputError
from duoglide.motion.path.path import Path

if TYPE_CHECKING:
    from duoglide.control.channel.setpoints import PreparedSetpoints

LOOK_AHEAD = 5  # parts that the streamer has beyond the one that moves


class Taker(Protocol):
    """Who takes parts: the streamer's process."""

    def load(self, prepared: PreparedSetpoints) -> None:
        """Hand setpoints over."""
        ...

    def order(self, command: Command, argument: int = 0, value: float = 0.0) -> None:
        """Give an order."""
        ...


class ProgramFeed:
    """Has a program planned in a process of its own; a resource: ``close`` it.

    Args:
        order: How it is planned.
        paths: Any iterable of paths, without an end perhaps; asked from a thread of its own, a few
            paths ahead of the motion.
        numbers: Of setpoints: the next ones that are handed over get the next number.

    Attributes:
        failure: Why the program has ended before its end; None: it has not.
        planned: Parts that have been planned.

    Raises:
        InputError: It cannot be iterated.
    """

    def __init__(self, order: ProgramOrder, paths: Iterable[Path], numbers: Iterator[int]) -> None:
        if isinstance(paths, Path):
            paths = (paths,)
        try:
            self._source = iter(paths)
        except TypeError:
            raise InputError(f"paths must be an iterable of Path, got {paths!r:.80}") from None
        self.failure: DuoglideError | None = None
        self.planned, self._numbers = 0, numbers
        self._room = threading.Condition()
        self._ahead: deque[int] = deque()  # numbers of the setpoints that wait for their turn
        self._newest = 0
        self._closed = False
        self._source_failure: DuoglideError | None = None
        self._parts, parts = socket.socketpair()
        self._paths, asked = socket.socketpair()
        theirs = (parts.fileno(), asked.fileno())
        command = [sys.executable, "-P", "-m", "duoglide.control.host.planner", *map(str, theirs)]
        try:
            self._process = subprocess.Popen(
                command, pass_fds=theirs, start_new_session=True, stdin=subprocess.DEVNULL
            )
        finally:
            parts.close()
            asked.close()
        self._parts.sendall(pack_object(order))
        self._begin(self._answer, "duoglide-paths")

    @staticmethod
    def _begin(work: Callable[[], None], name: str) -> None:
        threading.Thread(target=work, name=name, daemon=True).start()

    @property
    def pid(self) -> int:
        """Process number of the planner."""
        return self._process.pid

    # Paths

    def _answer(self) -> None:
        """Give the planner a path whenever it asks for one."""
        while True:
            try:
                if not self._paths.recv(1):
                    return
                answer = pack_object(self._next_path())
                self._paths.sendall(answer)
            except OSError:
                return

    def _next_path(self) -> Path | None:
        """Return the next path of the user's iterable; None where it ends, or fails."""
        try:
            path: object = next(self._source, None)
        except DuoglideError as error:
            self._source_failure = error
            return None
        except Exception as error:  # of the user's own: it is named, and the motion comes to rest
            self._source_failure = DuoglideError(
                f"the source of the program's paths has failed: {type(error).__name__}: {error}"
            )
            self._source_failure.__cause__ = error
            return None
        if path is None or isinstance(path, Path):
            return path
        self._source_failure = InputError(f"a program is made of dg.Path, got {path!r:.80}")
        return None

    # Parts

    def take(self) -> PlannedPart | None:
        """Wait for the next part; None where the program ends, and ``failure`` says why."""
        try:
            part = receive_object(self._parts)
        except (OSError, EOFError):
            if not self._closed:
                code = self._process.wait()
                self.failure = DuoglideError(f"the planning process has ended (exit code {code})")
            return None
        if isinstance(part, PlannedPart):
            self.planned += 1
            return part
        self.failure = part if isinstance(part, DuoglideError) else self._source_failure
        return None

    def first(self) -> PlannedPart:
        """Wait for the first part.

        Raises:
            InputError: There is no path.
            DuoglideError: It cannot be planned.
        """
        part = self.take()
        if part is None:
            raise self.failure or InputError("the program has no path")
        return part

    def feed(self, taker: Taker, newest: int, tell: Callable[[int, PlannedPart], None]) -> None:
        """Hand over all that comes after the first part, on a thread of its own.

        Args:
            taker: The streamer.
            newest: Number of the setpoints of the first part.
            tell: Called with the number of each part, before it is handed over.
        """
        self._newest = newest
        self._begin(lambda: self._hand_over(taker, tell), "duoglide-feed")

    def _hand_over(self, taker: Taker, tell: Callable[[int, PlannedPart], None]) -> None:
        try:
            while (part := self.take()) is not None:
                if not self._wait_for_room():
                    return
                number = next(self._numbers)
                tell(number, part)
                self._ahead.append(number)
                taker.load(replace(part.prepared, number=number, after=self._newest))
                self._newest = number
        except DuoglideError as error:
            self.failure = error
        if not self._closed:
            with suppress(DuoglideError):  # a streamer that is gone has stopped all
                taker.order(Command.END, self._newest)

    def _wait_for_room(self) -> bool:
        """Wait until the streamer may have another part; whether it still wants one."""
        with self._room:
            self._room.wait_for(lambda: self._closed or len(self._ahead) < LOOK_AHEAD)
        return not self._closed

    def pass_on(self, number: int) -> None:
        """Take it that the setpoints of this number are moved along now."""
        with self._room:
            while self._ahead and self._ahead[0] <= number:
                self._ahead.popleft()
            self._room.notify_all()

    def close(self) -> None:
        """End the process and the threads; a path that is being made is waited for by nobody."""
        with self._room:
            self._closed = True
            self._room.notify_all()
        self._process.kill()
        self._process.wait()
        for end in (self._parts, self._paths):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)  # whoever waits there wakes up
            end.close()
