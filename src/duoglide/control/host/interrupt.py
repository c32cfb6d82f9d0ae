"""What ends a process from outside: Ctrl-C, a supervisor's SIGTERM, a terminal that is gone.

A machine in motion then stops along its path and its log is closed, before the process goes on its
way. Signals that come meanwhile wait: they would leave the machine to its watchdogs.
"""

from __future__ import annotations

import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from types import FrameType

Handler: TypeAlias = "Callable[[int, FrameType | None], object]"
ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_CLOSELY = 2.0  # [s] between two signals that mean one thing
_GRACE = 0.8  # [s] that a process gets to begin what it was told by a signal
_LAST = 1.7  # [s] that its main thread gets to hear it at all
_HEARD_BEFORE = 1.0  # [s] by which a busy computer may tell here later what a handler did in time


@dataclass(frozen=True)
class EndingHandler:
    """A handler that stands for the end of the process, not for what a process does of its own.

    Attributes:
        handle: What is done.
        last_call: When any of them was called last [s]: there is one main thread, and one end.
    """

    handle: Handler
    last_call: ClassVar[float] = -float("inf")

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle it."""
        EndingHandler.last_call = time.monotonic()
        self.handle(number, frame)


class Ending(NamedTuple):
    """A signal that means the end, and what handles it."""

    number: int
    handler: Handler


class EndingWatch:
    """Hears signals that mean the end, also while the main thread cannot; ``close`` it.

    Python runs handlers in the main thread, and that may be in a library's call that does not
    return. But it tells every signal at once to one file of the process, and this is its reader. It
    is silent where that file is somebody else's (asyncio's, another robot's), or where it was not
    made in the main thread.
    """

    def __init__(self) -> None:
        self._heard, self._told = socket.socketpair()
        self._heard.setblocking(False)
        self._told.setblocking(False)
        self._works = _is_main()
        if self._works:
            former = signal.set_wakeup_fd(self._told.fileno(), warn_on_full_buffer=False)
            if former != -1:
                signal.set_wakeup_fd(former)
                self._works = False

    def fileno(self) -> int:
        """Return the end at which signals are heard: another process may look, but not take."""
        return self._heard.fileno()

    @property
    def fatal(self) -> int:
        """Bit n: signal n means the end of the process now, and not only of what it does."""
        handled = (n for n in ENDINGS if isinstance(signal.getsignal(n), EndingHandler))
        return sum(1 << number for number in handled) if self._works else 0

    def take(self) -> list[Ending]:
        """Return signals that have come and mean the end, without waiting."""
        try:
            numbers = self._heard.recv(64)
        except OSError:
            return []
        handlers = ((number, signal.getsignal(number)) for number in numbers if number in ENDINGS)
        return [
            Ending(number, handler)
            for number, handler in handlers
            if isinstance(handler, EndingHandler) or handler is signal.default_int_handler
        ]

    def close(self) -> None:
        """Hear no more."""
        self._heard.close()
        if self._works and not _is_main():
            self._told.detach()  # it cannot be taken back here, and its number must not be reused
            return
        if self._works:
            former = signal.set_wakeup_fd(-1)
            if former not in (-1, self._told.fileno()):
                with suppress(ValueError):
                    signal.set_wakeup_fd(former)
        self._told.close()


class Ultimatum:
    """How long a process that was told to end may take until its machine is stopped all the same.

    Python's own handler of Ctrl-C may mean less than the end, at a prompt: it is enough that the
    process gives an order of any kind, or that nothing moves. Otherwise the power has to go off,
    and a process whose main thread does not even hear the signal has to end.
    """

    def __init__(self) -> None:
        self._since: float | None = None
        self._unheard: tuple[int, float] | None = None  # signal, and when it came
        self._orders = 0
        self._firm = False

    def begin(
        self, ending: Ending, now: float, orders: int, *, moving: bool, powered: bool
    ) -> None:
        """Note a signal, and how many orders had been given; what is under way is not put off."""
        firm = ending.handler is not signal.default_int_handler
        if firm and powered and self._unheard is None:
            self._unheard = ending.number, now
        if not (firm or moving):
            return
        if self._since is None or firm > self._firm:
            self._since, self._orders, self._firm = now, orders, firm

    def is_over(self, now: float, orders: int, powered: bool) -> bool:
        """Whether the process has had its time and has not begun to end; says so once."""
        if self._since is None or now - self._since < _GRACE:
            return False
        self._since = None
        return powered and (self._firm or orders == self._orders)

    @property
    def waits(self) -> bool:
        """Whether the main thread may yet hear a signal."""
        return self._unheard is not None

    def unheard(self, now: float) -> int:
        """Return the signal that the main thread has had its time to hear, and has not; or 0."""
        if self._unheard is None:
            return 0
        number, came = self._unheard
        if EndingHandler.last_call > came - _HEARD_BEFORE:
            self._unheard = None
            return 0
        return number if now - came > _LAST else 0


def _is_main() -> bool:
    return threading.current_thread() is threading.main_thread()


@contextmanager
def endings_interrupt() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise KeyboardInterrupt in a block, as Ctrl-C does.

    A process that handles or ignores them itself keeps its way.
    """
    default = (signal.SIG_DFL, signal.default_int_handler)
    with _handled([n for n in ENDINGS if signal.getsignal(n) in default], interrupting()):
        yield


def interrupting(error: type[KeyboardInterrupt] = KeyboardInterrupt) -> Handler:
    """Return a handler that raises ``error``, once for signals that follow closely.

    Whoever presses Ctrl-C three times means one thing; the second would come while the first is on
    its way to whoever stops the machine. It is raised again for whoever insists.
    """
    last = -_CLOSELY

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _CLOSELY:
            last = now
            raise error

    return EndingHandler(handle)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let signals that would end the process wait until a block is done.

    Where the block is already on the way out of an interrupt, they change nothing.
    """
    waiting: list[int] = []
    interrupted = isinstance(sys.exception(), KeyboardInterrupt)
    heard = [n for n in ENDINGS if signal.getsignal(n) is not signal.SIG_IGN]
    try:
        with _handled(heard, EndingHandler(lambda number, frame: waiting.append(number))):
            yield
    finally:
        if waiting and not interrupted:
            signal.raise_signal(waiting[0])


@contextmanager
def _handled(numbers: list[signal.Signals], handler: Handler) -> Iterator[None]:
    """Set a handler for a block, where one can be set: in the main thread alone."""
    if not _is_main():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)
