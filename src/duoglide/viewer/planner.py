"""Planning and reading of files for the page, in a process of its own.

What plans holds the interpreter for long; in the page's process, an order would wait for it.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from typing import Any, TypeVar

from duoglide.errors import InputError

Result = TypeVar("Result")

_POLITE = 10  # nice value: what plans gives way to what moves


class Planner:
    """One process, begun when it is needed, that does one thing at a time."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._one = threading.Lock()

    def do(self, work: Callable[..., Result], *arguments: Any) -> Result:
        """Do some work there, and return what comes out.

        Raises:
            InputError: It is busy already, or it was ended from outside.
            Exception: What the work raises.
        """
        if not self._one.acquire(blocking=False):
            raise InputError("planning already; wait until it is done")
        try:
            if self._pool is None:
                self._pool = ProcessPoolExecutor(1, get_context("spawn"), initializer=_begin)
            return self._pool.submit(work, *arguments).result()
        except BrokenProcessPool as error:
            self._pool = None
            raise InputError("what plans has ended before it was done; try again") from error
        finally:
            self._one.release()

    def close(self) -> None:
        """End the process, whatever it does."""
        pool, self._pool = self._pool, None
        if pool is not None:
            for process in list((pool._processes or {}).values()):
                process.kill()
            pool.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """Leave Ctrl-C to the page, and processors to the stream; do not outlive the page."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(_POLITE)
    threading.Thread(target=_end_with_the_page, name="page-is-there", daemon=True).start()


def _end_with_the_page() -> None:
    """End when the process of the page does, even if it was killed."""
    page = parent_process()
    if page is not None:
        page.join()
        os._exit(1)
