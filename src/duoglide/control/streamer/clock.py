"""When cycles begin: absolute deadlines on the monotonic clock, late ones skipped."""

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


class Cyclic(Protocol):
    """Something that is done once a cycle.

    Attributes:
        done: Whether there is nothing left to do.
        standstill: Up to which lateness the schedule is moved, as simulated drives stand still with
            this computer; 0 on real ones [ns].
    """

    done: bool
    standstill: int

    def cycle(self, number: int, time: int, lateness: int, skipped: int) -> None:
        """Do one cycle.

        Args:
            number: Of this cycle; skipped ones count.
            time: Now [ns].
            lateness: How long after its deadline it begins [ns].
            skipped: How many cycles before it were left out.
        """
        ...


def run_cycles(work: Cyclic, clock: Clock, period: int) -> None:
    """Run cycles on absolute deadlines until the work is done.

    A cycle that begins more than a period late has missed the next ones: they are skipped, and
    the schedule stays what it was. Nothing is ever sent twice to catch up.

    Where the drives are simulated on this computer and it stands still, they stand still too: the
    schedule is moved by what was lost, and no cycle is skipped.

    Args:
        work: What to do.
        clock: Whose deadlines.
        period: Of the cycle [ns].
    """
    deadline, number = clock.now() + period, 0
    while not work.done:
        clock.sleep_until(deadline)
        now = clock.now()
        lateness = now - deadline
        skipped = lateness // period
        if skipped and lateness <= work.standstill:
            skipped, deadline = 0, now
        deadline += (1 + skipped) * period
        number += 1 + skipped
        work.cycle(number, now, lateness, skipped)
