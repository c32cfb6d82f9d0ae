"""The least margin of every family along an admissible curve."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.singularity import FAMILIES, margins
from duoglide.motion.checked import CheckReport, LeastMargin
from duoglide.planning.check_rules import Intervals, Rules, judge_points
from duoglide.planning.check_search import first_intervals

_LOOKS = np.linspace(-1.0, 1.0, 5)  # at an interval, from its start to its end
_MANY = 200  # intervals; of more than these, a few are looked at closely
_KEPT = 6  # for each family
_CLOSER = np.linspace(-0.2, 0.2, 5)  # about where the least value is expected


def least_margins(rules: Rules) -> CheckReport:
    """Sample every interval with its ends, then look where a parabola through the least ones is."""
    names = (*rules.families, *FAMILIES)
    rows = np.arange(len(names))
    intervals = _promising(rules, first_intervals(rules))
    grid = intervals.middle[:, None] + intervals.half[:, None] * _LOOKS
    values = _measure(rules, grid.ravel()).reshape(*grid.shape, -1)
    guess, vertex = _vertices(values)
    interval = np.minimum(guess, values.min(axis=1)).argmin(axis=0)
    middle, half = intervals.middle[interval], intervals.half[interval]
    close = (vertex[interval, rows] + _CLOSER[:, None]).clip(-1.0, 1.0)
    near = _measure(rules, (middle + half * close).ravel())
    near = near.reshape(*close.shape, -1)[:, rows, rows]
    vertex = _vertices(near[None])[1] * _CLOSER[-1] + close[_CLOSER.size // 2]
    last = vertex.clip(-1.0, 1.0)
    at_last = _measure(rules, middle + half * last[0])[rows, rows]
    table = np.vstack([values[interval, :, rows].T, near, at_last])
    looks = np.vstack([np.tile(_LOOKS[:, None], rows.size), close, last])
    best = table.argmin(axis=0)
    least, where = table[best, rows], middle + half * looks[best, rows]
    required = np.concatenate([rules.required, np.zeros(len(FAMILIES))])
    lengths, points = rules.curve.arc_length(where), rules.curve.position(where)
    columns = (column.tolist() for column in (least, required, where, lengths, points))
    return CheckReport(
        tuple(
            LeastMargin(name, margin, needed, sigma, length, (x, y, z))
            for name, margin, needed, sigma, length, (x, y, z) in zip(names, *columns, strict=True)
        )
    )


def _promising(rules: Rules, intervals: Intervals) -> Intervals:
    """Keep, of very many intervals, those whose middles are the least of some family."""
    if intervals.middle.size <= _MANY:
        return intervals
    values = _measure(rules, intervals.middle)
    least = np.argpartition(values, _KEPT, axis=0)[:_KEPT]
    ends = np.array([[0], [intervals.middle.size - 1]])
    return intervals[np.unique(np.concatenate([least.ravel(), ends.ravel()]))]


def _measure(rules: Rules, sigma: FloatArray) -> FloatArray:
    """Margins of every family, not less what is required, shape (n, families)."""
    points = rules.curve.position(sigma)
    found = margins(rules.machine.geometry, points).by_family()
    surfaces = np.stack([np.abs(found[name]) for name in FAMILIES], axis=-1)
    return np.concatenate([judge_points(rules, points) + rules.required, surfaces], axis=1)


def _vertices(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lay a parabola through the least looks of each interval and their neighbours.

    Args:
        values: Shape (intervals, looks, families).

    Returns:
        Least value of each parabola, and where it is on [-1, 1], shape (intervals, families).
    """
    middle = values.argmin(axis=1).clip(1, _LOOKS.size - 2)[:, None]
    before, here, after = (np.take_along_axis(values, middle + i, axis=1)[:, 0] for i in (-1, 0, 1))
    bend = np.maximum(before - 2.0 * here + after, 1e-12)
    shift = (0.5 * (before - after) / bend).clip(-1.0, 1.0)
    least = here + 0.5 * shift * (after - before) + 0.5 * shift * shift * bend
    return least, _LOOKS[middle[:, 0]] + shift * (_LOOKS[1] - _LOOKS[0])
