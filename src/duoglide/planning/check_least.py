"""The least margin of every family along an admissible curve."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.singularity import FAMILIES, margins
from duoglide.motion.checked import CheckReport, LeastMargin
from duoglide.motion.path_segments import as_point
from duoglide.planning.check_rules import Rules, judge_points
from duoglide.planning.check_search import first_intervals

_LOOKS = np.linspace(-1.0, 1.0, 9)


def least_margins(rules: Rules) -> CheckReport:
    """Sample every piece, then look closely at where each family comes nearest to its bound."""
    names = (*rules.families, *FAMILIES)
    rows = np.arange(len(names))
    best, spacing = _coarse(rules)
    sigma = (best[:, None] + spacing[:, None] * _LOOKS).clip(0.0, rules.curve.end)
    values = _measure(rules, sigma.ravel()).reshape(*sigma.shape, -1)[rows, :, rows]
    vertex = _vertices(sigma, values)
    sigma = np.column_stack([sigma, vertex])
    values = np.column_stack([values, _measure(rules, vertex)[rows, rows]])
    nearest = values.argmin(axis=1)
    where, least = sigma[rows, nearest], values[rows, nearest]
    required = np.concatenate([rules.required, np.zeros(len(FAMILIES))])
    lengths, points = rules.curve.arc_length(where), rules.curve.position(where)
    table = zip(names, least, required, where, lengths, points, strict=True)
    return CheckReport(
        tuple(
            LeastMargin(name, float(m), float(r), float(s), float(a), as_point(p, name))
            for name, m, r, s, a, p in table
        )
    )


def _coarse(rules: Rules) -> tuple[FloatArray, FloatArray]:
    """Where each family is least among the middles and ends of the first intervals."""
    intervals = first_intervals(rules)
    starts = intervals.middle - intervals.half
    sigma = np.concatenate([intervals.middle, starts, [rules.curve.end]])
    spacing = np.concatenate([intervals.half, intervals.half, intervals.half[-1:]])
    rows = _measure(rules, sigma).argmin(axis=0)
    return sigma[rows], spacing[rows]


def _measure(rules: Rules, sigma: FloatArray) -> FloatArray:
    """Margins of every family, not less what is required, shape (n, families)."""
    points = rules.curve.position(sigma)
    found = margins(rules.machine.geometry, points).by_family()
    surfaces = np.stack([np.abs(found[name]) for name in FAMILIES], axis=-1)
    return np.concatenate([judge_points(rules, points) + rules.required, surfaces], axis=1)


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
