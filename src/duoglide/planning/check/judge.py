"""Judges parts of a curve and single points by every rule of a machine."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.headroom.room import box_distance, outside
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.reach import reach_of
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.planning.check.margins import boxes, clearance, room_to_travel, travel
from duoglide.planning.check.rules import Intervals, Parts, Rules, Verdict


def judge(rules: Rules, intervals: Intervals) -> Verdict:
    """Evaluate every rule on intervals."""
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
    reach = reach_of(positions, rules.constants)
    inside = reach.lacking.max(axis=1) < 0.0
    clear = np.full(len(positions), np.inf)
    if cleared:
        near = nearest_surface(rules.machine.geometry, WORKING.v, positions[inside])
        clear[inside] = near.distance
    out = [box_distance(outside(box, positions)) for box in rules.machine.keep_out]
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
