"""Judges parts of a curve and single points by every rule of a machine."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.nearest import nearest_surface
from duoglide.kinematics.reach import reach_of
from duoglide.planning.check_margins import boxes, clearance, outside, room_to_travel, travel
from duoglide.planning.check_rules import Intervals, Parts, Rules, Verdict

WORTH_LOADING = 3  # curves that numpy checks before compiled loops are loaded for the next
WORTH_COMPILING = 40  # the same, where the compiler has to make them first


class _Checked:
    """How many curves have been checked in this process, and after how many loops pay."""

    curves = 0
    enough: int | None = None


def count_curve() -> None:
    """Count one more curve that is checked."""
    _Checked.curves += 1


def kernel_pays() -> bool:
    """Whether this process checks so many curves that compiled loops are worth loading.

    numpy checks the first few: who has only those never waits for numba, nor for the compiler.
    """
    if _Checked.curves <= WORTH_LOADING:
        return False
    if _Checked.enough is None:
        from duoglide.planning import _check_kernel

        _Checked.enough = WORTH_LOADING if _check_kernel.ready() else WORTH_COMPILING
    return _Checked.curves > _Checked.enough


def measured(rules: Rules, positions: FloatArray) -> FloatArray:
    """Measure positions with compiled loops: see ``_check_kernel.measure``."""
    from duoglide.planning import _check_kernel

    return _check_kernel.measure(rules, positions)


def judge(rules: Rules, intervals: Intervals) -> Verdict:
    """Evaluate every rule on intervals."""
    if kernel_pays():
        from duoglide.planning import _check_kernel

        return _check_kernel.judge(rules, intervals)
    states = rules.curve.derivatives(intervals.middle, intervals.piece)
    piece, half = intervals.piece, intervals.half[:, None]
    bounds = rules.bounds
    second = np.minimum(bounds.second[piece], np.abs(states[:, 2]) + bounds.third[piece] * half)
    first = np.minimum(bounds.first[piece], np.abs(states[:, 1]) + second * half)
    return judge_parts(rules, Parts(states, intervals.half, first, second))


def judge_points(rules: Rules, positions: FloatArray, cleared: bool = True) -> FloatArray:
    """Evaluate every rule at single positions of the platform's centre.

    Args:
        rules: The rules.
        positions: Shape (n, 3) [mm].
        cleared: Whether the clearance is asked for; else it is infinite.

    Returns:
        Margins less what is required [mm], shape (n, families); minus infinity out of reach.
    """
    if kernel_pays():
        return measured(rules, positions)[:, : rules.required.size]
    reach = reach_of(positions, rules.constants)
    inside = reach.lacking.max(axis=1) < 0.0
    clear = np.full(len(positions), np.inf)
    if cleared:
        near = nearest_surface(rules.machine.geometry, WORKING.v, positions[inside])
        clear[inside] = near.distance
    out = [outside(box, positions).max(axis=1) for box in rules.machine.keep_out]
    travels = room_to_travel(rules, positions[:, 1], reach)
    margins = np.column_stack([clear, travels, *out]) - rules.required
    margins[~inside] = -np.inf
    return margins


def judge_parts(rules: Rules, parts: Parts) -> Verdict:
    """Evaluate every rule on parts of a curve."""
    reach = reach_of(parts.states[:, 0], rules.constants)
    inside = reach.lacking.max(axis=1) < 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        carriages = travel(rules, parts, reach)
    columns = clearance(rules, parts, inside), carriages, boxes(rules.machine, parts)
    margins = np.concatenate([values for values, _ in columns], axis=1) - rules.required
    lowest = np.concatenate([bound for _, bound in columns], axis=1) - rules.required
    margins[~inside], lowest[~inside] = -np.inf, -np.inf
    return Verdict(margins, np.where(np.isnan(lowest), -np.inf, lowest))
