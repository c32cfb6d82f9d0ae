"""Certify in advance how fast the path rate of a motion may change.

With r = du/dtau, a carriage that follows q(u(tau)) has

    velocity q' r,   acceleration q'' r^2 + q' r',   jerk q''' r^3 + 3 q'' r r' + q' r''

(q', q'', q''' along the plan at rate 1). Within abs(r') <= R1 and abs(r'') <= R2, a rate that
begins and ends constant in [0, 1] also keeps r'^2 <= 2 R2 min(r, 1 - r): it must come from 0 or 1,
and be able to end there. So r' is small where r is near 1 and the plan's own acceleration counts
in full, and large only near r = 1/2, where a quarter of it counts. With the shape
rho = R1^2 / R2 <= 1 fixed, acceleration is linear and jerk quadratic in R1, and the largest R1 of
each cell of path time is a closed form. A change from any cell must last through its window, half
the stopping time. Signs count: a falling rate brakes where the plan accelerates, so falling and
rising rates have bounds of their own.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.machine import Machine
from duoglide.motion.motion import Motion, State
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import TIME, Profile
from duoglide.motion.stop_bounds import RateTable, StopBounds
from duoglide.planning.compare import first_least, whole
from duoglide.planning.force_limits import share_forces
from duoglide.planning.stops.kernel import find_largest_slopes, find_windows
from duoglide.planning.tolerances import CHUNK


class _Cells(NamedTuple):
    """How finely stops along a motion are certified.

    Attributes:
        shortest: Path time of a cell, at the least [s].
        per_stop: Cells that are enough for a stop, if stops are slow.
        most: Cells of a motion, at most.
        samples: Of the motion in a cell.
        slope: Of the rate [1/s]: no stop is asked to be quicker than 8 ms.
        reserve: Share of each stop limit that a change may use at least.
    """

    shortest: float = 0.002
    per_stop: int = 40
    most: int = 100_000
    samples: int = 6
    slope: float = 250.0
    reserve: float = 0.02


class Moving(Protocol):
    """What is certified: a ``Motion``, or one that goes over into another."""

    @property
    def machine(self) -> Machine:
        """Whose stop limits hold."""
        ...

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        ...

    def at(self, t: FloatArray) -> State:
        """Return the states at times [s], shape (n,)."""
        ...


class Handover:
    """A motion, and the one that takes over from it in motion.

    Args:
        before: Up to where the other one takes over.
        after: Begins in the state in which ``before`` ends.
    """

    def __init__(self, before: Motion, after: Motion) -> None:
        self.before, self.after = before, after
        self.machine, self.duration = after.machine, before.duration + after.duration

    def at(self, t: FloatArray) -> State:
        """Return the states at times [s], shape (n,)."""
        first = t < self.before.duration
        one, other = self.before.at(t[first]), self.after.at(t[~first] - self.before.duration)
        names = ("carriages", "velocity", "acceleration", "jerk")
        rows = [np.empty((t.size, AXES)) for _ in names]
        for name, row in zip(names, rows, strict=True):
            row[first], row[~first] = getattr(one, name), getattr(other, name)
        return State(*rows)


_CELLS = _Cells()
_WHOLE = np.array([[1.0] * 3, [np.inf] * 3])  # of each force limit, and no limit of its change
_SHAPES = np.array([1.0, 0.5, 0.2])  # rho
_LEVELS = 1.0 - np.linspace(np.sqrt(0.5), 0.0, 25) ** 2  # cells of r, even in what r' may be;
# below 1/2 every term is smaller than at 1/2


def certify_stops(motion: Moving) -> StopBounds:
    """Return the certified bounds of any change of the path rate along ``motion``.

    Of a ``Handover`` these are also the changes that begin before the seam and end after it.

    Where the plan itself uses nearly all of ``machine.stop_limits``, the bounds leave a change
    2 % of each limit all the same, so that every plan can be stopped: with the default reserve of
    half the limits this never happens.
    """
    duration = motion.duration
    if duration <= 0.0:
        return StopBounds.constant(0.0, _CELLS.slope, _CELLS.slope**2)
    cells = whole(duration / _choose_cell_length(motion))
    falling, rising = (_choose_shapes(allowed, duration) for allowed in _find_slopes(motion, cells))
    return StopBounds(duration, falling, rising)


def stop_bounds_until(motion: Motion, end: float) -> StopBounds:
    """Return the bounds of changes that begin before ``end``, and may come to their end after it.

    Args:
        motion: The whole of it, to rest.
        end: Where another motion takes over, unless a change is under way [s], above 0.
    """
    first = whole(end / _choose_cell_length(motion))
    cells = whole(motion.duration / (end / first))
    longer = _prolong(motion, end / first * cells)
    tables = []
    for allowed in _find_slopes(longer, cells):
        table = _choose_shapes(allowed, longer.duration)
        reach = np.minimum(table.until, motion.duration)
        tables.append(RateTable(table.slope[:first], table.bend[:first], reach[:first]))
    return StopBounds(end, *tables)


def _prolong(motion: Motion, duration: float) -> Motion:
    """Return a motion that rests at its end until it has taken so long [s]."""
    profile, seconds = motion.profile, duration - motion.duration
    if seconds <= 0.0:
        return motion
    return Motion(motion.path, Profile.join([profile, Profile.rest(profile.end, seconds)]))


def _choose_cell_length(motion: Moving) -> float:
    """Return how long a cell of path time lasts, at most [s]."""
    least = _estimate_stop(motion) / _CELLS.per_stop
    return max(_CELLS.shortest, motion.duration / _CELLS.most, least)


def _estimate_stop(motion: Moving) -> float:
    """Return how long the fastest carriage alone would need to stop [s], about."""
    limits = motion.machine.stop_limits
    speeds = np.abs(motion.at(np.linspace(0.0, motion.duration, 101)).velocity)
    v, a, j = speeds.max(axis=0), limits.acceleration, limits.jerk
    return float(np.where(v > a * (a / j), v / a + a / j, 2.0 * np.sqrt(v / j)).max())


def _find_slopes(motion: Moving, cells: int) -> FloatArray:
    """Return the largest R1 of each shape and cell, falling and rising, (2, shapes, cells)."""
    allowed = motion.machine.stop_limits
    limits = np.stack([allowed.acceleration, allowed.jerk])
    share = np.minimum(1.0, np.sqrt(2.0 * (1.0 - _LEVELS[:-1]) / _SHAPES[:, None]))
    both = np.empty((2, _SHAPES.size, cells))
    limited = bool(np.isfinite(allowed.force).any())
    for begin in range(0, cells, CHUNK):
        part = slice(begin, min(begin + CHUNK, cells))
        peaks = _bound_peaks(motion, cells, part)
        forces = _bound_forces(motion, cells, part) if limited else None
        for k, rho in enumerate(_SHAPES.tolist()):
            found = np.full((2, peaks.shape[2]), _CELLS.slope)
            levels = _LEVELS[1:], share[k]
            find_largest_slopes(peaks, (limits, _CELLS.reserve * limits), levels, rho, found)
            if forces is not None:
                find_largest_slopes(forces, (_WHOLE, _CELLS.reserve * _WHOLE), levels, rho, found)
            both[:, k, part] = found
    return both


def _choose_shapes(allowed: FloatArray, duration: float) -> RateTable:
    """Choose for each cell the shape with the quickest change."""
    slope, until = _allow_in_windows(allowed, duration)
    best = first_least((1.0 + _SHAPES[:, None]) / slope)
    columns = np.arange(best.size)
    chosen = slope[best, columns]
    return RateTable(chosen, chosen**2 / _SHAPES[best], until[best, columns])


def _bound_peaks(motion: Moving, cells: int, part: slice) -> FloatArray:
    """Bound velocity, acceleration and jerk in some of the cells, each sign by itself.

    The first two are rigorous: between samples they change at most by the next one's peak times
    half the spacing. Jerk is the largest sample of the cell and of one sample to each side. Where
    a machine has no jerk limit, its peak may be any size within next to no time, and tells nothing:
    there acceleration is looked at where the profile has its knots too.

    Returns:
        Largest positive and largest negative values, both as amounts, shape (2, 3, n, 3).
    """
    times, step = _sample_cells(motion, cells, part)
    state = motion.at(np.clip(times, 0.0, motion.duration))
    one = np.stack([state.velocity, state.acceleration, state.jerk])
    signed = np.stack([one, -one])
    between = np.maximum(signed[:, :, 1:], signed[:, :, :-1])
    jumps = bool(np.isinf(motion.machine.limits.jerk).any())
    if jumps:
        between[:, 1] = _find_extremes(motion, np.clip(times, 0.0, motion.duration))
    peaks = _gather(between)
    if not jumps:
        peaks[:, 1] += 0.5 * step * peaks[:, 2].max(axis=0)
    peaks[:, 0] += 0.5 * step * peaks[:, 1].max(axis=0)
    return np.maximum(peaks, 0.0)


def _bound_forces(motion: Moving, cells: int, part: slice) -> FloatArray:
    """Take the largest shares of ``stop_limits.force`` in some of the cells, each sign by itself.

    They follow the same law as accelerations: what a change of the pace adds stands for velocity,
    what the motion itself takes for acceleration, and nothing for jerk. Each is the largest sample
    of a cell and of one sample to each side.

    Returns:
        As ``_bound_peaks``.
    """
    times, _ = _sample_cells(motion, cells, part)
    states = motion.at(np.clip(times, 0.0, motion.duration))
    signed = share_forces(motion.machine, states)
    peaks = _gather(np.maximum(signed[:, :, 1:], signed[:, :, :-1]))
    whole_peaks = np.concatenate([peaks, np.zeros_like(peaks[:, :1])], axis=1)
    return whole_peaks.clip(0.0)


def _sample_cells(motion: Moving, cells: int, part: slice) -> tuple[FloatArray, float]:
    """Return times in some of the cells and one beside them, and how far they are apart [s]."""
    step = motion.duration / (cells * _CELLS.samples)
    times = np.arange(part.start * _CELLS.samples - 1, part.stop * _CELLS.samples + 2) * step
    return times, step


def _gather(between: FloatArray) -> FloatArray:
    """Return the largest of what is between the samples of each cell and one to each side."""
    wide = np.maximum(np.maximum(between[:, :, :-2], between[:, :, 1:-1]), between[:, :, 2:])
    signs, kinds = wide.shape[:2]
    peaks: FloatArray = wide.reshape(signs, kinds, -1, _CELLS.samples, 3).max(axis=3)
    return peaks


def _find_extremes(motion: Moving, times: FloatArray) -> FloatArray:
    """Return the largest accelerations between times, and the largest of the other sign.

    Between two knots, an acceleration is off its chord by an eighth of the step times the change
    of its slope.

    Returns:
        Shape (2, n - 1, 3); -inf where two times are the same.
    """
    knots = _find_knots(motion)
    inside = knots[(knots > times[0]) & (knots < times[-1])]
    fine = np.union1d(times, inside)
    after, before = motion.at(fine), motion.at(np.nextafter(fine, 0.0))
    bow = np.diff(fine)[:, None] / 8.0 * np.abs(before.jerk[1:] - after.jerk[:-1])
    first, last = after.acceleration[:-1], after.acceleration[1:]
    tops = np.stack([np.maximum(first, last) + bow, -np.minimum(first, last) + bow])
    begin, end = np.searchsorted(fine, times[:-1]), np.searchsorted(fine, times[1:])
    begin = np.minimum(begin, tops.shape[1] - 1)
    found: FloatArray = np.maximum.reduceat(tops, begin, axis=1)
    found[:, begin == end] = -np.inf
    return found


def _find_knots(motion: Moving) -> FloatArray:
    """Return the times where the acceleration may bend [s], shape (n,)."""
    if isinstance(motion, Handover):
        later = _find_knots(motion.after) + motion.before.duration
        return np.concatenate([_find_knots(motion.before), later])
    assert isinstance(motion, Motion)
    path = motion.path
    return path.breaks if isinstance(path, TransferPath) else motion.profile.knots[:, TIME]


def _allow_in_windows(largest: FloatArray, duration: float) -> tuple[FloatArray, FloatArray]:
    """Return for each shape and cell the R1 that its whole window allows, and the window's end.

    The window of R1 is as long as the way of a stop in path time. It grows cell by cell, and R1
    falls with it, until it is long enough; at the end of the motion it always is.
    """
    cells = largest.shape[1]
    cell = duration / cells
    found = [
        find_windows(row, 0.5 * (1.0 + rho) / cell)
        for row, rho in zip(largest, _SHAPES.tolist(), strict=True)
    ]
    slope, last = (np.stack(column) for column in zip(*found, strict=True))
    return slope, np.where(last == cells - 1, duration, cell * (last + 1.0))
