"""Judges parts of a curve and single points by every rule of a machine."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.carriage_margin import margin_up_to
from duoglide.kinematics.headroom.room import PLENTY, box_distance, outside
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.reach import reach_of
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.planning.check.margins import (
    boxes,
    carriage_margin,
    clearance,
    room_to_travel,
    stroke_bends,
    travel,
)
from duoglide.planning.check.rules import (
    CARRIAGE_MARGIN,
    CLEARANCE,
    Intervals,
    Parts,
    Rules,
    Verdict,
)


def judge(rules: Rules, intervals: Intervals) -> Verdict:
    """Evaluate every rule on intervals."""
    states = rules.curve.derivatives(intervals.middle, intervals.piece)
    piece, half = intervals.piece, intervals.half[:, None]
    bounds = rules.bounds
    second = np.minimum(bounds.second[piece], np.abs(states[:, 2]) + bounds.third[piece] * half)
    first = np.minimum(bounds.first[piece], np.abs(states[:, 1]) + second * half)
    return judge_parts(rules, Parts(states, intervals.half, first, second))


def judge_points(rules: Rules, positions: FloatArray, without: Collection[int] = ()) -> FloatArray:
    """Evaluate every rule at single positions of the platform's centre.

    Args:
        rules: The rules.
        positions: Shape (n, 3) [mm].
        without: ``CLEARANCE`` or ``CARRIAGE_MARGIN`` where they are not asked for: infinite then.

    Returns:
        Margins less what is required [mm], shape (n, families); minus infinity out of reach. Of the
        carriage margin, no more than ``PLENTY``.
    """
    reach = reach_of(positions, rules.constants)
    inside = reach.lacking.max(axis=1) < 0.0
    machine = rules.machine
    clear, free = np.full((2, len(positions)), np.inf)
    if CLEARANCE not in without:
        near = nearest_surface(machine.geometry, WORKING.v, positions[inside])
        clear[inside] = near.distance
    if CARRIAGE_MARGIN not in without and machine.carriage_margin > 0.0:
        enough = machine.carriage_margin + PLENTY
        found = positions[inside], reach[inside]
        free[inside] = margin_up_to(machine.geometry, *found, enough=enough)
    out = [box_distance(outside(box, positions)) for box in machine.keep_out]
    travels = room_to_travel(rules, positions[:, 1], reach)
    margins = np.column_stack([clear, free, travels, *out]) - rules.required
    margins[~inside] = -np.inf
    return margins


def judge_parts(rules: Rules, parts: Parts) -> Verdict:
    """Evaluate every rule on parts of a curve."""
    reach = reach_of(parts.states[:, 0], rules.constants)
    inside = reach.lacking.max(axis=1) < 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        strokes = stroke_bends(parts, reach, rules.constants)
        carriages = travel(rules, parts, reach, strokes)
        free = carriage_margin(rules, parts, reach, strokes)
    clear = clearance(rules, parts, inside)
    columns = clear, free, carriages, boxes(rules.machine, parts)
    margins = np.concatenate([values for values, _ in columns], axis=1) - rules.required
    lowest = np.concatenate([bound for _, bound in columns], axis=1) - rules.required
    margins[~inside], lowest[~inside] = -np.inf, -np.inf
    return Verdict(margins, np.where(np.isnan(lowest), -np.inf, lowest))
