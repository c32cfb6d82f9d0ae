"""How following error and lateness went over a run, in a few numbers however long it was."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from duoglide.arrays import AXES, FloatArray, read_only

_MOST = 1024  # rows; when they are full, neighbours are put together


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """The worst of every few cycles of a run.

    Attributes:
        start: When the run's first cycle began, on the monotonic clock [s].
        times: When each row begins, from then on [s], shape (n,).
        following_error: Worst distance of each carriage from its setpoint [mm], shape (n, 3).
        lateness: Worst lateness [us], shape (n,).
        cycles: How many cycles a row stands for.
    """

    start: float = 0.0
    times: FloatArray = field(default_factory=lambda: read_only(np.empty(0)))
    following_error: FloatArray = field(default_factory=lambda: read_only(np.empty((0, AXES))))
    lateness: FloatArray = field(default_factory=lambda: read_only(np.empty(0)))
    cycles: int = 1


@dataclass(slots=True)
class HistoryTally:
    """Collects a history cycle by cycle, in bounded memory.

    Attributes:
        rows: Time [ns], worst following error of each carriage [increments], worst lateness [ns].
        span: How many cycles a row stands for.
        filled: How many of them the last row has.
    """

    rows: list[list[int]] = field(default_factory=list)
    span: int = 1
    filled: int = 0

    def add(self, time: int, following: tuple[int, int, int], lateness: int) -> None:
        """Count a cycle."""
        one, two, three = following
        new = [time, abs(one), abs(two), abs(three), lateness]
        if self.filled == 0:
            if len(self.rows) == _MOST:
                self.rows = list(map(_worse, self.rows[::2], self.rows[1::2]))
                self.span *= 2
            self.rows.append(new)
        else:
            self.rows[-1] = _worse(self.rows[-1], new)
        self.filled = (self.filled + 1) % self.span

    def history(self, mm_per_increment: FloatArray) -> History:
        """Sum up.

        Args:
            mm_per_increment: Of each drive, shape (3,).
        """
        table = np.array(self.rows, dtype=np.float64).reshape(-1, 2 + AXES)
        return History(
            start=float(table[0, 0]) * 1e-9 if len(table) else 0.0,
            times=read_only((table[:, 0] - table[:1, 0]) * 1e-9),
            following_error=read_only(table[:, 1:-1] * mm_per_increment),
            lateness=read_only(table[:, -1] * 1e-3),
            cycles=self.span,
        )


def _worse(one: list[int], other: list[int]) -> list[int]:
    """Return the time of the first of two rows and the worst of both."""
    return [one[0], *map(max, one[1:], other[1:])]
