"""What ends a program from outside: Ctrl-C, a supervisor's SIGTERM, a terminal that is gone.

A machine in motion then stops along its path and its log is closed, before the program goes on its
way. Signals that come meanwhile wait: they would leave the machine to its watchdogs.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from types import FrameType

Handler: TypeAlias = "Callable[[int, FrameType | None], object]"
ENDINGS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def endings_interrupt() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise KeyboardInterrupt in a block, as Ctrl-C does.

    A program that handles or ignores them itself keeps its way.
    """
    with _handled([n for n in ENDINGS if signal.getsignal(n) is signal.SIG_DFL], _interrupt):
        yield


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


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt(signal.Signals(number).name)


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
