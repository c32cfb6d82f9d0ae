"""How following error and lateness went over a run: few numbers however long it was, a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from duoglide.arrays import AXES, FloatArray, read_only

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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

    def draw(self, marks: Sequence[float], size: tuple[float, float] = (7.0, 4.2)) -> Figure:
        """Draw both over time.

        Args:
            marks: When something stopped the run, on the monotonic clock [s].
            size: Of the figure [inch].
        """
        from duoglide.drawing.over_time import draw_curves, draw_key, finish
        from duoglide.drawing.picture import COLOURS, LIMIT, drawn

        worst = f", worst of every {self.cycles} cycles" if self.cycles > 1 else ""
        with drawn(size) as figure:
            error, late = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
            draw_curves(error, self.times, self.following_error * 1e3)
            error.set_title(f"Following error [µm]{worst}")
            draw_key(error)
            late.plot(self.times, self.lateness, color=COLOURS[0], linewidth=0.9)
            late.set_title(f"Lateness [µs]{worst}")
            for axes in (error, late):
                axes.set_ylim(bottom=0.0)
                for mark in marks:
                    axes.axvline(mark - self.start, color=LIMIT, linestyle=":", linewidth=1.0)
            finish((error, late), "time from the first cycle [s]")
        return figure


class Row(NamedTuple):
    """The worst of one or more cycles.

    Attributes:
        time: When the first of them began [ns].
        first: Following error of carriage 1 [increments], absolute.
        second: Of carriage 2.
        third: Of carriage 3.
        lateness: After the deadline [ns].
    """

    time: int
    first: int
    second: int
    third: int
    lateness: int


@dataclass(slots=True)
class HistoryTally:
    """Collects a history cycle by cycle, in bounded memory.

    Attributes:
        rows: The worst of every ``span`` cycles.
        span: How many cycles a row stands for.
        filled: How many of them the last row has.
    """

    rows: list[Row] = field(default_factory=list)
    span: int = 1
    filled: int = 0

    def add(self, time: int, following: tuple[int, int, int], lateness: int) -> None:
        """Count a cycle."""
        one, two, three = following
        new = Row(time, abs(one), abs(two), abs(three), lateness)
        if self.filled == 0:
            if len(self.rows) == _MOST:
                self.rows = list(map(_merge, self.rows[::2], self.rows[1::2]))
                self.span *= 2
            self.rows.append(new)
        else:
            self.rows[-1] = _merge(self.rows[-1], new)
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


def _merge(one: Row, other: Row) -> Row:
    """Return the time of the first of two rows and the worst of both."""
    return Row(one.time, *map(max, one[1:], other[1:]))
