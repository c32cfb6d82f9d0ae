"""The least margin of every family along an admissible curve."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.kinematics.carriage_margin import SAME, carriage_margin, least_margin
from duoglide.kinematics.singularity.margins import FAMILIES, margins
from duoglide.motion.path.checked import CheckReport, LeastMargin
from duoglide.planning.check.judge import judge_points
from duoglide.planning.check.rules import CARRIAGE_MARGIN, CLEARANCE, Intervals, Rules
from duoglide.planning.check.search import first_intervals
from duoglide.planning.tolerances import PICOMETRE

_LOOKS = np.linspace(-1.0, 1.0, 17)  # at an interval, from its start to its end
_MANY = 200  # intervals; of more than these, a few are looked at closely
_KEPT = 6  # for each family
_ZOOMS = 6  # by which a kink of the carriage margin is looked for, each with so many looks
_CLOSE_LOOKS = 17
_APART = 1e-9  # mm of sigma between two looks
_CLOSER = np.linspace(-0.2, 0.2, 5)  # about where the least value is expected


def least_margins(rules: Rules) -> CheckReport:
    """Sample every interval with its ends, then look where parabolas through the samples lead."""
    names = (*rules.families, *FAMILIES)
    rows = np.arange(len(names))
    intervals = _select_promising(rules, first_intervals(rules))
    looks = intervals.middle[:, None] + intervals.half[:, None] * _LOOKS
    values = _measure(rules, looks.ravel()).reshape(*looks.shape, -1)
    guess, vertex = _vertices(values)
    chosen = np.minimum(guess, values.min(axis=1)).argmin(axis=0)
    best = values[chosen, :, rows].argmin(axis=1)
    least, where = values[chosen, best, rows], looks[chosen, best]
    deeper = np.flatnonzero(guess[chosen, rows] < least - PICOMETRE)
    if deeper.size:
        there = vertex[chosen, rows][deeper]
        found = _look_closer(rules, intervals[chosen[deeper]], deeper, there)
        better = found[0] < least[deeper]
        least[deeper[better]], where[deeper[better]] = found[0][better], found[1][better]
    nearest = _least_carriage_margin(rules, first_intervals(rules))
    least[CARRIAGE_MARGIN], where[CARRIAGE_MARGIN] = nearest
    required = np.concatenate([rules.required, np.zeros(len(FAMILIES))])
    lengths, points = rules.curve.arc_length(where), rules.curve.position(where)
    columns = (column.tolist() for column in (least, required, where, lengths, points))
    return CheckReport(
        tuple(
            LeastMargin(name, margin, needed, sigma, length, (x, y, z))
            for name, margin, needed, sigma, length, (x, y, z) in zip(names, *columns, strict=True)
        )
    )


def _look_closer(
    rules: Rules, intervals: Intervals, family: IndexArray, vertex: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Find the least value of one family in each interval, about where it is expected.

    Returns:
        The value, and its sigma.
    """
    rows = np.arange(family.size)
    close = (vertex + _CLOSER[:, None]).clip(-1.0, 1.0)
    without = () if (family == CLEARANCE).any() else (CLEARANCE,)
    near = _measure(rules, (intervals.middle + intervals.half * close).ravel(), without)
    near = near.reshape(*close.shape, -1)[:, rows, family]
    again = _vertices(near[None])[1] * _CLOSER[-1] + close[_CLOSER.size // 2]
    looks = np.vstack([close, again.clip(-1.0, 1.0)])
    last = _measure(rules, intervals.middle + intervals.half * looks[-1], without)[rows, family]
    table = np.vstack([near, last])
    best = table.argmin(axis=0)
    return table[best, rows], intervals.middle + intervals.half * looks[best, rows]


def _least_carriage_margin(rules: Rules, intervals: Intervals) -> tuple[float, float]:
    """Find the least carriage margin, and its sigma: it is asked for at few places."""
    g = rules.machine.geometry

    def least_at(sigma: FloatArray) -> tuple[float, int]:
        return least_margin(g, rules.curve.position(sigma))

    if intervals.middle.size > _MANY:
        _, at = least_at(intervals.middle)
        intervals = intervals[slice(max(at - 1, 0), at + 2)]
    looks = np.unique(intervals.middle[:, None] + intervals.half[:, None] * _LOOKS)
    looks = looks[np.append(True, np.diff(looks) > _APART)]  # ends of two intervals are one look
    found, at = least_at(looks)
    best, where = found, float(looks[at])
    for _ in range(_ZOOMS):
        about = looks[max(at - 1, 0) : at + 2]
        if about.size < 3:
            break
        values = carriage_margin(g, rules.curve.position(about))
        slopes = np.diff(values) / np.diff(about)
        bend = (slopes[1] - slopes[0]) / (about[2] - about[0])  # of the parabola through all three
        if not bend > 0.0:
            break
        vertex = np.clip(0.5 * (about[0] + about[1] - slopes[0] / bend), about[0], about[2])
        before = best
        looks = np.unique(np.append(np.linspace(about[0], about[2], _CLOSE_LOOKS), vertex))
        found, at = least_at(looks)
        if found < best:
            best, where = found, float(looks[at])
        if best > before - SAME:
            break
    return best, where


def _select_promising(rules: Rules, intervals: Intervals) -> Intervals:
    """Keep, of very many intervals, those whose middles are the least of some family."""
    if intervals.middle.size <= _MANY:
        return intervals
    values = _measure(rules, intervals.middle)
    least = np.argpartition(values, _KEPT, axis=0)[:_KEPT]
    ends = np.array([[0], [intervals.middle.size - 1]])
    return intervals[np.unique(np.concatenate([least.ravel(), ends.ravel()]))]


def _measure(rules: Rules, sigma: FloatArray, without: tuple[int, ...] = ()) -> FloatArray:
    """Margins of every family, not less what is required, shape (n, families).

    That of the carriages is 0: see ``_least_carriage_margin``.
    """
    points = rules.curve.position(sigma)
    found = margins(rules.machine.geometry, points).by_family()
    surfaces = np.stack([np.abs(found[name]) for name in FAMILIES], axis=-1)
    ruled = judge_points(rules, points, (CARRIAGE_MARGIN, *without)) + rules.required
    ruled[:, CARRIAGE_MARGIN] = 0.0
    return np.concatenate([ruled, surfaces], axis=1)


def _vertices(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lay a parabola through the least looks of each interval and their neighbours.

    Args:
        values: Shape (intervals, looks, families).

    Returns:
        Least value of each parabola, and where it is on [-1, 1], shape (intervals, families).
    """
    count, looks, families = values.shape
    middle = np.minimum(np.maximum(values.argmin(axis=1), 1), looks - 2)
    rows, columns = np.arange(count)[:, None], np.arange(families)
    before, here, after = (values[rows, middle + i, columns] for i in (-1, 0, 1))
    bend = np.maximum(before - 2.0 * here + after, 1e-12)
    shift = np.minimum(np.maximum(0.5 * (before - after) / bend, -1.0), 1.0)
    least = here + 0.5 * shift * (after - before) + 0.5 * shift * shift * bend
    return least, _LOOKS[middle] + shift * (_LOOKS[1] - _LOOKS[0])
