"""Absolute deadlines on the monotonic clock."""

from __future__ import annotations

import ctypes
import errno
import time
from typing import Protocol

NANOSECONDS = 1_000_000_000
_CLOCK_MONOTONIC = 1
_TIMER_ABSTIME = 1


class Clock(Protocol):
    """What the cycle needs of time; tests bring one that they move by hand."""

    def now(self) -> int:
        """Return the time [ns]; its zero means nothing."""
        ...

    def sleep_until(self, deadline: int) -> None:
        """Return when ``deadline`` [ns] has come, at once when it has passed."""
        ...


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class MonotonicClock:
    """The kernel's monotonic clock, with sleeps to absolute deadlines.

    ``time.sleep`` is relative: the time between reading the clock and falling asleep adds to every
    deadline. ``clock_nanosleep`` with TIMER_ABSTIME does not have that gap.
    """

    def __init__(self) -> None:
        self._sleep = ctypes.CDLL(None, use_errno=False).clock_nanosleep
        self._until = _Timespec()
        self._pointer = ctypes.byref(self._until)

    def now(self) -> int:
        """Return the time of CLOCK_MONOTONIC [ns]."""
        return time.monotonic_ns()

    def sleep_until(self, deadline: int) -> None:
        """Sleep until ``deadline`` [ns]; signals do not shorten it."""
        self._until.seconds, self._until.nanoseconds = divmod(deadline, NANOSECONDS)
        while self._sleep(_CLOCK_MONOTONIC, _TIMER_ABSTIME, self._pointer, None) == errno.EINTR:
            pass
