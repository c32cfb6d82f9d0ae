"""Margins of travel, order, clearance and boxes, and bounds of them between samples, in numpy."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.kernels import in_numpy
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.nearest import nearest_surface
from duoglide.kinematics.reach import Reach, reach_of
from duoglide.machine import Box, Machine
from duoglide.planning.check import formulas as check_formulas
from duoglide.planning.check.rules import SURE, Parts, Rules

Bounded: TypeAlias = tuple[FloatArray, FloatArray]  # margins, and their lower bounds

_root = in_numpy(check_formulas.root_part)
_strokes = in_numpy(check_formulas.strokes_part, root_part=_root)
_travel_less = in_numpy(check_formulas.travel_part)
_travel = in_numpy(check_formulas.travel_pose)
_leads = in_numpy(check_formulas.clear_part)
_anchor = in_numpy(check_formulas.anchor_part)
_farther = in_numpy(check_formulas.chord_part)


def room_to_travel(rules: Rules, y: FloatArray, reach: Reach) -> FloatArray:
    """Margins of travel 1 to 3 and of the order of carriages 1 and 2, shape (n, 4)."""
    limit = rules.machine.geometry.rail_half_length
    return np.stack(_travel(y, reach.p, reach.q, limit, rules.constants)[3:], axis=1)


def travel(rules: Rules, parts: Parts, reach: Reach) -> Bounded:
    """Margins of travel and order, and their lower bounds."""
    at, slope = (parts.states[:, i, ::2].T for i in (0, 1))
    first, second = parts.first[:, ::2].T, parts.second[:, ::2].T
    links = reach.A, reach.h, reach.p, reach.q
    strokes = _strokes(at, slope, first, second, parts.half, links, rules.constants)
    y, speed = parts.states[:, 0, 1], parts.states[:, 1, 1]
    margins = room_to_travel(rules, y, reach)
    less = _travel_less(speed, parts.second[:, 1], parts.half, strokes, rules.constants)
    return margins, margins - np.stack(less, axis=1)


def clearance(rules: Rules, parts: Parts, inside: BoolArray) -> Bounded:
    """Clearance at the samples, and its lower bound on the intervals."""
    states, half = parts.states, parts.half
    values, away = np.full(half.size, -np.inf), np.zeros((half.size, 3))
    found = nearest_surface(rules.machine.geometry, WORKING.v, states[inside, 0])
    values[inside], away[inside] = found.distance, found.away
    slope = states[:, 1, ::2].T
    far, near, bow = _leads(away[:, ::2].T, slope, parts.second[:, ::2].T, half)
    needed = rules.machine.clearance + SURE
    lowest, spare = values - far - bow, values - near - bow - needed
    rows = np.flatnonzero((lowest < needed) & (spare > 0.0))
    if rows.size:
        chord = slope[:, rows] * half[rows]
        better = _from_anchors(rules, states[rows, 0], away[rows, ::2].T, chord, spare[rows])
        lowest[rows] = np.maximum(lowest[rows], better - bow[rows])
    return values[:, None], lowest[:, None]


def _from_anchors(
    rules: Rules, position: FloatArray, away: FloatArray, chord: FloatArray, spare: FloatArray
) -> FloatArray:
    """Bound the clearance on chords by that of anchors away from the nearest surface."""
    geometry = rules.machine.geometry
    offset = _anchor(away, chord, spare, geometry.leg_length)
    anchor = position.copy()
    anchor[:, 0] += offset[0]
    anchor[:, 2] += offset[1]
    reached = reach_of(anchor, rules.constants).lacking.max(axis=1) < 0.0
    clear = np.full(spare.size, -np.inf)
    clear[reached] = nearest_surface(geometry, WORKING.v, anchor[reached]).distance
    bound: FloatArray = clear - _farther(offset, chord)
    return bound


def outside(box: Box, position: FloatArray) -> FloatArray:
    """How far outside a box positions are along each axis, shape (n, 3)."""
    result: FloatArray = np.maximum(np.array(box.low) - position, position - np.array(box.high))
    return result


def boxes(machine: Machine, parts: Parts) -> Bounded:
    """How far outside each keep-out box a sample is, along the axis that is farthest out."""
    values = np.zeros((parts.half.size, len(machine.keep_out)))
    lowest = values.copy()
    if machine.keep_out:
        half, position = parts.half[:, None], parts.states[:, 0]
        change = np.abs(parts.states[:, 1]) * half + 0.5 * parts.second * half * half
        for i, box in enumerate(machine.keep_out):
            out = outside(box, position)
            values[:, i] = out.max(axis=1)
            lowest[:, i] = (out - change).max(axis=1)
    return values, lowest
