"""The least margin of every family along an admissible curve."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.kinematics.carriage_margin import carriage_margin, least_margin
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.singularity.margins import FAMILIES, margins
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.motion.path.checked import CheckReport, LeastMargin
from duoglide.planning.check.judge import judge_points
from duoglide.planning.check.rules import CARRIAGE_MARGIN, CLEARANCE, Intervals, Rules
from duoglide.planning.check.search import first_intervals

_LOOKS = np.linspace(-1.0, 1.0, 17)  # at an interval, from its start to its end
_MANY = 200  # intervals; of more than these, a few are looked at closely
_CHOSEN = 2  # intervals, for each family, that are zoomed into
_KEPT = 6  # for each family
_ZOOMS = 6  # by which a kink of the carriage margin is looked for, each with so many looks
_CLOSE_LOOKS = 17
_APART = 1e-9  # mm of sigma between two looks
_RESERVE = 1e-6  # [mm], by which no least value that is told is above the true one
_SETTLED = 1e-8  # [mm]; a zoom that gains less is the last


def least_margins(rules: Rules) -> CheckReport:
    """Sample every interval with its ends, then zoom in where parabolas through them lead."""
    names = (*rules.families, *FAMILIES)
    intervals = _select_promising(rules, first_intervals(rules))
    looks = intervals.middle[:, None] + intervals.half[:, None] * _LOOKS
    values = _measure(rules, rules.curve.position(looks.ravel())).reshape(*looks.shape, -1)
    guess = _vertices(values)
    promising = np.minimum(guess, values.min(axis=1)).argsort(axis=0)[:_CHOSEN]
    chosen, rows = promising.ravel(), np.tile(np.arange(len(names)), len(promising))
    best = values[chosen, :, rows].argmin(axis=1)
    step = intervals.half[chosen] * (_LOOKS[1] - _LOOKS[0])
    found, there = _zoom(rules, rows, (values[chosen, best, rows], looks[chosen, best]), step)
    better = found.reshape(promising.shape).argmin(axis=0) * len(names) + np.arange(len(names))
    least, where = found[better], there[better]
    nearest = _least_carriage_margin(rules, first_intervals(rules))
    least[CARRIAGE_MARGIN], where[CARRIAGE_MARGIN] = nearest
    required = np.concatenate([rules.required, np.zeros(len(FAMILIES))])
    least = np.maximum(least - _RESERVE, np.minimum(least, required))  # those are certified
    lengths, points = rules.curve.arc_length(where), rules.curve.position(where)
    columns = (column.tolist() for column in (least, required, where, lengths, points))
    return CheckReport(
        tuple(
            LeastMargin(name, margin, needed, sigma, length, (x, y, z))
            for name, margin, needed, sigma, length, (x, y, z) in zip(names, *columns, strict=True)
        )
    )


def _zoom(
    rules: Rules, family: IndexArray, best: tuple[FloatArray, FloatArray], step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Find least values of families within a step about where their least looks are.

    Args:
        rules: The rules.
        family: Of each place, (n,).
        best: Its least value so far, and sigma of that, (n,) each.
        step: How far to look to either side [mm], (n,).

    Returns:
        As ``best``.
    """
    (least, where), rows = best, np.arange(family.size)
    clear = family == CLEARANCE
    for _ in range(_ZOOMS):
        looks = (where + step * _LOOKS[:, None]).clip(0.0, rules.curve.end)
        points = rules.curve.position(looks)
        found = _measure(rules, points.reshape(-1, 3), (CLEARANCE,)).reshape(*looks.shape, -1)
        values = found[:, rows, family]
        near = nearest_surface(rules.machine.geometry, WORKING.v, points[:, clear])
        values[:, clear] = near.distance
        lowest = values.argmin(axis=0)
        gain = least - values[lowest, rows]
        where = np.where(gain > 0.0, looks[lowest, rows], where)
        least = np.minimum(least, values[lowest, rows])
        if gain.max() < _SETTLED:
            break
        step = step * (_LOOKS[1] - _LOOKS[0])
    return least, where


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
        looks = np.unique(np.append(np.linspace(about[0], about[2], _CLOSE_LOOKS), vertex))
        found, at = least_at(looks)
        if found < best:
            best, where = found, float(looks[at])
    return best, where


def _select_promising(rules: Rules, intervals: Intervals) -> Intervals:
    """Keep, of very many intervals, those whose middles are the least of some family."""
    if intervals.middle.size <= _MANY:
        return intervals
    values = _measure(rules, rules.curve.position(intervals.middle))
    least = np.argpartition(values, _KEPT, axis=0)[:_KEPT]
    ends = np.array([[0], [intervals.middle.size - 1]])
    return intervals[np.unique(np.concatenate([least.ravel(), ends.ravel()]))]


def _measure(rules: Rules, points: FloatArray, without: tuple[int, ...] = ()) -> FloatArray:
    """Margins of every family at points (n, 3), not less what is required, shape (n, families).

    That of the carriages is 0: see ``_least_carriage_margin``.
    """
    found = margins(rules.machine.geometry, points).by_family()
    surfaces = np.stack([np.abs(found[name]) for name in FAMILIES], axis=-1)
    ruled = judge_points(rules, points, (CARRIAGE_MARGIN, *without)) + rules.required
    ruled[:, CARRIAGE_MARGIN] = 0.0
    return np.concatenate([ruled, surfaces], axis=1)


def _vertices(values: FloatArray) -> FloatArray:
    """Return the least value of a parabola through the least looks of each interval.

    Args:
        values: Shape (intervals, looks, families).

    Returns:
        Shape (intervals, families).
    """
    count, looks, families = values.shape
    middle = np.minimum(np.maximum(values.argmin(axis=1), 1), looks - 2)
    rows, columns = np.arange(count)[:, None], np.arange(families)
    before, here, after = (values[rows, middle + i, columns] for i in (-1, 0, 1))
    bend = np.maximum(before - 2.0 * here + after, 1e-12)
    shift = np.minimum(np.maximum(0.5 * (before - after) / bend, -1.0), 1.0)
    least: FloatArray = here + 0.5 * shift * (after - before) + 0.5 * shift * shift * bend
    return least
