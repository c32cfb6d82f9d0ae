"""What ends a program from outside: Ctrl-C, a supervisor's SIGTERM, a terminal that is gone.

A machine in motion then stops along its path and its log is closed, before the program goes on its
way. Signals that come meanwhile wait: they would leave the machine to its watchdogs.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from types import FrameType

Handler: TypeAlias = "Callable[[int, FrameType | None], object]"
ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_CLOSELY = 2.0  # [s] between two signals that mean one thing


@contextmanager
def endings_interrupt() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise KeyboardInterrupt in a block, as Ctrl-C does.

    A program that handles or ignores them itself keeps its way.
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

    return handle


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let signals that would end the program wait until a block is done.

    Where the block is already on the way out of an interrupt, they change nothing.
    """
    waiting: list[int] = []
    interrupted = isinstance(sys.exception(), KeyboardInterrupt)
    heard = [n for n in ENDINGS if signal.getsignal(n) is not signal.SIG_IGN]
    try:
        with _handled(heard, lambda number, frame: waiting.append(number)):
            yield
    finally:
        if waiting and not interrupted:
            signal.raise_signal(waiting[0])


@contextmanager
def _handled(numbers: list[signal.Signals], handler: Handler) -> Iterator[None]:
    """Set a handler for a block, where one can be set: in the main thread alone."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)
