"""A program under way, seen from the host: its planner's process, and what it hands over in time.

Two threads do this, and nobody waits for them but whoever asks for the first part. One asks the
user's iterable for the next path when the planner wants one. The other takes parts from the planner
(or from a log) and hands them to the streamer, a few ahead of the one that moves.
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
from duoglide.planning.trajectory import Trajectory

if TYPE_CHECKING:
    from duoglide.control.channel.setpoints import PreparedSetpoints

LOOK_AHEAD = 5  # parts that the streamer has beyond the one that moves


class Source(Protocol):
    """Where the parts of a program come from: the planner's process, or a log.

    Attributes:
        failure: Why they have ended before their end; None: they have not.
    """

    failure: DuoglideError | None

    def take(self) -> PlannedPart | None:
        """Wait for the next part; None where there is none, and ``failure`` says why."""
        ...

    def close(self) -> None:
        """End whatever makes parts."""
        ...


class Taker(Protocol):
    """Who takes parts: the streamer's process."""

    def load(self, prepared: PreparedSetpoints) -> None:
        """Hand setpoints over."""
        ...

    def order(self, command: Command, argument: int = 0, value: float = 0.0) -> None:
        """Give an order."""
        ...


class PlannerProcess:
    """Has a program planned and prepared in a process of its own; a resource: ``close`` it.

    Args:
        order: How it is planned, and whether it is already.
        paths: Any iterable of paths, or of trajectories that are planned already, without an end
            perhaps; asked from a thread of its own, a few of them ahead of the motion.

    Attributes:
        failure: See ``Source``.

    Raises:
        InputError: It cannot be iterated.
    """

    def __init__(self, order: ProgramOrder, paths: Iterable[Path | Trajectory]) -> None:
        if isinstance(paths, Path):
            paths = (paths,)
        try:
            self._source = iter(paths)
        except TypeError:
            raise InputError(f"paths must be an iterable of Path, got {paths!r:.80}") from None
        self.failure: DuoglideError | None = None
        self._kind = Trajectory if order.planned else Path
        self._source_failure: DuoglideError | None = None
        self._closed = False
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
        threading.Thread(target=self._answer, name="duoglide-paths", daemon=True).start()

    @property
    def pid(self) -> int:
        """Its process number."""
        return self._process.pid

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

    def _next_path(self) -> Path | Trajectory | None:
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
        if path is None or isinstance(path, self._kind):
            return path
        kind = self._kind.__name__
        self._source_failure = InputError(f"a program is made of dg.{kind}, got {path!r:.80}")
        return None

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
            return part
        self.failure = part if isinstance(part, DuoglideError) else self._source_failure
        return None

    def close(self) -> None:
        """End the process; a path that is being made is waited for by nobody."""
        self._closed = True
        self._process.kill()
        self._process.wait()
        for end in (self._parts, self._paths):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)  # whoever waits there wakes up
            end.close()


class PartFeed:
    """Hands the parts of a program over in time; a resource: ``close`` it.

    Args:
        source: Where they come from.
        numbers: Of setpoints: the next ones that are handed over get the next number.
    """

    def __init__(self, source: Source, numbers: Iterator[int]) -> None:
        self._source, self._numbers = source, numbers
        self._room = threading.Condition()
        self._ahead: deque[int] = deque()  # numbers of the setpoints that wait for their turn
        self._newest = 0
        self._closed = False
        self._failure: DuoglideError | None = None

    @property
    def failure(self) -> DuoglideError | None:
        """Why the program has ended before its end; None: it has not."""
        return self._failure or self._source.failure

    def first(self) -> PlannedPart:
        """Wait for the first part.

        Raises:
            InputError: There is no path.
            DuoglideError: It cannot be planned.
        """
        part = self._source.take()
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
        work = threading.Thread(
            target=self._hand_over, args=(taker, tell), name="duoglide-feed", daemon=True
        )
        work.start()

    def _hand_over(self, taker: Taker, tell: Callable[[int, PlannedPart], None]) -> None:
        try:
            while (part := self._source.take()) is not None:
                if not self._wait_for_room():
                    return
                number = next(self._numbers)
                tell(number, part)
                self._ahead.append(number)
                after = part.after or self._newest
                taker.load(replace(part.prepared, number=number, after=after))
                self._newest = number
        except DuoglideError as error:
            self._failure = error
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
        """Hand nothing over any more, and end what makes the parts."""
        with self._room:
            self._closed = True
            self._room.notify_all()
        self._source.close()
