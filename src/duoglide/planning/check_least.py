"""The least margin of every family along an admissible curve."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.singularity import FAMILIES, margins
from duoglide.motion.checked import CheckReport, LeastMargin
from duoglide.motion.path_segments import as_point
from duoglide.planning.check_rules import IndexArray, Rules, judge_points
from duoglide.planning.check_search import Search, first_intervals

_LOOKS = np.linspace(-1.0, 1.0, 9)


def least_margins(rules: Rules, found: Search) -> CheckReport:
    """Look closely at where the search has come nearest to breaking each rule."""
    brackets = np.concatenate([found.where, _surface_brackets(rules)])
    names = (*rules.families, *FAMILIES)
    column = np.repeat(np.arange(len(names)), _LOOKS.size)
    sigma = (brackets[:, :1] + brackets[:, 1:] * _LOOKS).clip(0.0, rules.curve.end)
    values = _measure(rules, sigma.ravel(), column).reshape(sigma.shape)
    vertex = _vertices(sigma, values)
    rows = np.arange(len(names))
    best = values.argmin(axis=1)
    least, where = values[rows, best], sigma[rows, best]
    at_vertex = _measure(rules, vertex, rows)
    where = np.where(at_vertex < least, vertex, where)
    least = np.minimum(least, at_vertex)
    required = np.concatenate([rules.required, np.zeros(len(FAMILIES))])
    lengths, points = rules.curve.arc_length(where), rules.curve.position(where)
    table = zip(names, least, required, where, lengths, points, strict=True)
    return CheckReport(
        tuple(
            LeastMargin(name, float(m), float(r), float(s), float(a), as_point(p, name))
            for name, m, r, s, a, p in table
        )
    )


def _surface_brackets(rules: Rules) -> FloatArray:
    """Where each singularity family comes nearest, by the first intervals' samples."""
    intervals = first_intervals(rules)
    table = _surfaces(rules, intervals.middle)
    rows = table.argmin(axis=0)
    return np.stack([intervals.middle[rows], intervals.half[rows]], axis=1)


def _surfaces(rules: Rules, sigma: FloatArray) -> FloatArray:
    """Absolute margins of the singularity families, shape (n, families)."""
    found = margins(rules.machine.geometry, rules.curve.position(sigma)).by_family()
    return np.stack([np.abs(found[name]) for name in FAMILIES], axis=-1)


def _measure(rules: Rules, sigma: FloatArray, column: IndexArray) -> FloatArray:
    """One margin at each sigma: that of the family in ``column``, not less what is required."""
    count = len(rules.families)
    own, others = np.flatnonzero(column < count), np.flatnonzero(column >= count)
    values = np.empty(sigma.size)
    table = judge_points(rules, rules.curve.position(sigma[own])) + rules.required
    values[own] = table[np.arange(own.size), column[own]]
    table = _surfaces(rules, sigma[others])
    values[others] = table[np.arange(others.size), column[others] - count]
    return values


def _vertices(sigma: FloatArray, values: FloatArray) -> FloatArray:
    """Lay a parabola through the least of evenly spaced values and its neighbours."""
    rows = np.arange(len(values))
    middle = values.argmin(axis=1).clip(1, values.shape[1] - 2)
    before, here, after = (values[rows, middle + i] for i in (-1, 0, 1))
    bend = before - 2.0 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend > 0.0, 0.5 * (before - after) / bend, 0.0).clip(-1.0, 1.0)
    step = sigma[rows, middle + 1] - sigma[rows, middle]
    vertex: FloatArray = sigma[rows, middle] + np.nan_to_num(shift) * step
    return vertex
