"""Margins of travel, order, clearance and boxes, and bounds of them between samples.

On a part of a curve a margin is bounded from below by Taylor's theorem: value, slope and a bound on
the second derivative that holds on the whole part. The clearance is a distance to a set, which
gives more: from any anchor C, clearance(p) >= clearance(C) - |p - C|. With C at the sample that is
the Lipschitz bound; with C further away from the surface it is one of second order, and asks
nothing else of the surface.

Legend, as in the kinematics: u = x - (b - d), A = l6 sin(beta), h the rise of the legs, P and Q the
strokes of legs and strut along y.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.constants import Constants
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.nearest import nearest_surface
from duoglide.kinematics.reach import Reach, reach_of
from duoglide.machine import Box, Machine
from duoglide.planning.check_rules import SURE, Parts, Rules

_FARTHEST_ANCHOR = 0.25  # of the leg's length

Stroke: TypeAlias = tuple[FloatArray, FloatArray]  # slope, bound on the bend
Bounded: TypeAlias = tuple[FloatArray, FloatArray]  # margins, and their lower bounds


def places(
    k: Constants, y: FloatArray, reach: Reach
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
    """Places of the carriages, and the way from carriage 1 to carriage 2."""
    half_coupler, (w1, w2, w3) = k[4], k[9:]
    one, other = y - half_coupler + w1 * reach.p, y + half_coupler + w2 * reach.p
    return (one, other, y + w3 * reach.q), 2.0 * half_coupler + (w2 - w1) * reach.p


def travel(rules: Rules, parts: Parts, reach: Reach) -> Bounded:
    """Margins of travel 1 to 3 and of the order of carriages 1 and 2, and their lower bounds."""
    (slope_p, bend_p), (slope_q, bend_q) = _strokes(parts, reach, rules.constants)
    (w1, w2, w3), limit = rules.constants[9:], rules.machine.geometry.rail_half_length
    half, square = parts.half, 0.5 * parts.half * parts.half
    found, gap = places(rules.constants, parts.states[:, 0, 1], reach)
    speed, bend = parts.states[:, 1, 1], parts.second[:, 1]
    margins, lowest = [], []
    for place, slope, more in zip(
        found, (w1 * slope_p, w2 * slope_p, w3 * slope_q), (bend_p, bend_p, bend_q), strict=True
    ):
        margins.append(limit - np.abs(place))
        lowest.append(margins[-1] - np.abs(speed + slope) * half - (bend + more) * square)
    margins.append(gap)
    lowest.append(gap - abs(w2 - w1) * (np.abs(slope_p) * half + bend_p * square))
    return np.stack(margins, axis=1), np.stack(lowest, axis=1)


def _strokes(parts: Parts, reach: Reach, k: Constants) -> tuple[Stroke, Stroke]:
    """Slope at the sample, and a bound on the second derivative, of P and of Q."""
    cx, _base, l6, l2, _half, xb, zb, l9, *_ = k
    half = parts.half
    (x, z), (dx, dz) = (parts.states[:, i, ::2].T for i in (0, 1))
    (vx, vz), (ax, az) = parts.first[:, ::2].T, parts.second[:, ::2].T
    u, X, Z = x - cx, x - xb, z - zb
    bend = vx * vx + (np.abs(u) + vx * half) * ax
    slope_a, bend_a = _root(l6, reach.A, u * u, u * dx, bend, half)
    dh, ah = dz - slope_a, az + bend_a
    vh = np.abs(dh) + ah * half
    bend = vh * vh + (np.abs(reach.h) + vh * half) * ah
    p = _root(l2, reach.p, reach.h * reach.h, reach.h * dh, bend, half)
    bend = vx * vx + vz * vz + (np.abs(X) + vx * half) * ax + (np.abs(Z) + vz * half) * az
    return p, _root(l9, reach.q, X * X + Z * Z, X * dx + Z * dz, bend, half)


def _root(  # noqa: PLR0917  # the five numbers of one formula
    length: float,
    root: FloatArray,
    square: FloatArray,
    rate: FloatArray,
    bend: FloatArray,
    half: FloatArray,
) -> Stroke:
    """Differentiate R = sqrt(L^2 - w) twice.

    Args:
        length: L.
        root: R at the sample.
        square: w at the sample.
        rate: w' / 2 there.
        bend: Bound on |w''| / 2 on the whole part.
        half: Half the length of the part.

    Returns:
        R' at the sample, and a bound on |R''| on the whole part; NaN where R may vanish.
    """
    steepest = np.abs(rate) + bend * half
    low = np.sqrt(length * length - (square + 2.0 * np.abs(rate) * half + bend * half * half))
    return -rate / root, bend / low + (steepest / low) ** 2 / low


def clearance(rules: Rules, parts: Parts, inside: BoolArray) -> Bounded:
    """Clearance at the samples, and its lower bound on the intervals."""
    states, half = parts.states, parts.half
    values, normal = np.full(half.size, -np.inf), np.zeros((half.size, 3))
    found = nearest_surface(rules.machine.geometry, WORKING.v, states[inside, 0])
    values[inside], normal[inside] = found.distance, found.away
    speed = np.hypot(states[:, 1, 0], states[:, 1, 2])
    bow = 0.5 * np.hypot(parts.second[:, 0], parts.second[:, 2]) * half * half
    lowest = values - speed * half - bow
    needed = rules.machine.clearance + SURE
    slope = np.abs((states[:, 1] * normal).sum(axis=1))
    spare = values - slope * half - bow - needed
    rows = np.flatnonzero((lowest < needed) & (spare > 0.0))
    if rows.size:
        chord = states[rows, 1] * half[rows, None]
        better = _from_anchors(rules, states[rows, 0], normal[rows], chord, spare[rows])
        lowest[rows] = np.maximum(lowest[rows], better - bow[rows])
    return values[:, None], lowest[:, None]


def _from_anchors(
    rules: Rules, position: FloatArray, normal: FloatArray, chord: FloatArray, spare: FloatArray
) -> FloatArray:
    """Bound the clearance on chords by that of anchors away from the nearest surface.

    The anchor is twice as far away as the chord's length asks for: with the offset l, the bound is
    short of the true value by about w^2 / (2 l) at a distance w along the surface.
    """
    geometry = rules.machine.geometry
    way = chord[:, ::2]
    offset = (way * way).sum(axis=1) / spare
    offset = offset.clip(1e-3, _FARTHEST_ANCHOR * geometry.leg_length)[:, None] * normal
    anchor = position + offset
    reached = reach_of(anchor, rules.constants).lacking.max(axis=1) < 0.0
    clear = np.full(spare.size, -np.inf)
    clear[reached] = nearest_surface(geometry, WORKING.v, anchor[reached]).distance
    ahead, behind = offset[:, ::2] - way, offset[:, ::2] + way
    bound: FloatArray = clear - np.maximum(np.hypot(*ahead.T), np.hypot(*behind.T))
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
