"""A thread for long work while drives have power: below the streamer, and out of a signal's way.

The main thread waits for it, and a thread that waits hears Ctrl-C and its like at once, whatever
the work is doing: Python runs their handlers in the main thread alone, between two of its steps.
"""

from __future__ import annotations

import gc
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from functools import cache
from queue import SimpleQueue
from typing import TypeVar

import numpy as np

from duoglide.errors import DuoglideError

T = TypeVar("T")
_NICE = 10  # the streamer and the bus have 0, or more priority than that, where they are granted it


class Background:
    """Does one thing after another, with little priority; a resource: ``close`` it.

    Begins its thread at once: where there is power, it may be too late to get one.

    Raises:
        DuoglideError: This computer gives no thread.
    """

    def __init__(self) -> None:
        self._tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._closing, self._closed = threading.Lock(), False
        thread = threading.Thread(target=self._work, name="duoglide-background", daemon=True)
        try:
            thread.start()
        except RuntimeError as error:
            raise DuoglideError(
                f"this computer gives no thread to plan in ({error}): give the process more memory"
                " (ulimit -v) or processes (ulimit -u)"
            ) from error

    def do(self, task: Callable[[], T]) -> T:
        """Do something there, wait for it, and return or raise what it does.

        Whoever is interrupted while waiting goes on at once; what was begun is then ended for
        nobody. After ``close``, whoever asks does it: nobody waits for a thread that has ended.
        """
        future: Future[T] = Future()
        with self._closing:
            closed = self._closed
            if not closed:
                self._tasks.put(lambda: _fulfil(future, task))
        return task() if closed else future.result()

    def close(self) -> None:
        """Let the thread end when what it does is done; it keeps nobody waiting."""
        with self._closing:
            self._closed = True
            self._tasks.put(None)

    def _work(self) -> None:
        with suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        while (task := self._tasks.get()) is not None:
            task()


def _fulfil(future: Future[T], task: Callable[[], T]) -> None:
    try:
        future.set_result(task())
    except BaseException as error:  # whatever it is, whoever waits has to hear of it
        future.set_exception(error)


@cache
def load_planning() -> None:
    """Load all that a motion is planned with, and try it: nothing loads once there is power.

    What is loaded then stays, and is not looked at any more when rubbish is collected: on a busy
    computer that would keep the threads of this process waiting for most of a second.
    """
    from duoglide.kinematics.home import home_position
    from duoglide.machine import Machine
    from duoglide.planning.limit_use import require_limits
    from duoglide.planning.transfer import recover, transfer  # noqa: F401

    machine = Machine.default()
    home = home_position(machine)
    way = transfer.transfer(machine, home, home + np.array((0.0, 1.0, 0.0)))
    require_limits(way, machine.limits)
    gc.collect()
    gc.freeze()
