"""Margins of travel, order, clearance, carriages and boxes, and bounds of them between samples.

On a part of a curve a margin is bounded from below by Taylor's theorem: value, slope and a bound on
the second derivative that holds on the whole part. The clearance is a distance to a set, which
gives more: see ``bound_from_anchors``.

Legend, as in the kinematics: u = x - (b - d), A = l6 sin(beta), h the rise of the legs, p and q the
strokes of legs and strut along y.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.carriage_margin import keeps_margin, margin_up_to
from duoglide.kinematics.constants import PoseConstants
from duoglide.kinematics.headroom.anchors import bound_from_anchors
from duoglide.kinematics.headroom.room import SURE, TOUCHING, box_distance, outside
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.reach import Reach
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.machine import Machine
from duoglide.planning.check.rules import Parts, Rules

Bounded: TypeAlias = tuple[FloatArray, FloatArray]  # margins, and their lower bounds

_KEPT = 0.5 * (SURE + TOUCHING)  # [mm] beyond what is required; sure in spite of rounding


class Bend(NamedTuple):
    """Slope of a length at the sample, and a bound on its second derivative on the whole part."""

    slope: FloatArray
    bound: FloatArray


def room_to_travel(rules: Rules, y: FloatArray, reach: Reach) -> FloatArray:
    """Margins of travel 1 to 3 and of the order of carriages 1 and 2, shape (n, 4)."""
    *_, half, _xb, _zb, _l9, _v, w1, w2, w3 = rules.constants
    limit = rules.machine.geometry.rail_half_length
    places = y - half + w1 * reach.p, y + half + w2 * reach.p, y + w3 * reach.q
    left = [limit - np.abs(place) for place in places]
    return np.stack([*left, 2.0 * half + (w2 - w1) * reach.p], axis=1)


def travel(rules: Rules, parts: Parts, reach: Reach, strokes: tuple[Bend, Bend]) -> Bounded:
    """Margins of travel and order, and their lower bounds."""
    margins = room_to_travel(rules, parts.states[:, 0, 1], reach)
    w1, w2, w3 = rules.constants.w1, rules.constants.w2, rules.constants.w3
    p, q = strokes
    speed, bend = parts.states[:, 1, 1], parts.second[:, 1]
    half, square = parts.half, 0.5 * parts.half * parts.half
    less = (
        np.abs(speed + w1 * p.slope) * half + (bend + p.bound) * square,
        np.abs(speed + w2 * p.slope) * half + (bend + p.bound) * square,
        np.abs(speed + w3 * q.slope) * half + (bend + q.bound) * square,
        abs(w2 - w1) * (np.abs(p.slope) * half + p.bound * square),
    )
    return margins, margins - np.stack(less, axis=1)


def stroke_bends(parts: Parts, reach: Reach, k: PoseConstants) -> tuple[Bend, Bend]:
    """Differentiate the strokes p and q by sigma; NaN where one of them may vanish."""
    (x, _, z), (dx, _, dz) = parts.states[:, 0].T, parts.states[:, 1].T
    (vx, _, vz), (ax, _, az), half = parts.first.T, parts.second.T, parts.half
    u, X, Z = x - k.cx, x - k.xb, z - k.zb
    bend = vx * vx + (np.abs(u) + vx * half) * ax
    A = _root(k.l6, reach.A, u * u, Bend(u * dx, bend), half)
    dh, ah = dz - A.slope, az + A.bound
    vh = np.abs(dh) + ah * half
    bend = vh * vh + (np.abs(reach.h) + vh * half) * ah
    p = _root(k.l2, reach.p, reach.h * reach.h, Bend(reach.h * dh, bend), half)
    bend = vx * vx + vz * vz + (np.abs(X) + vx * half) * ax + (np.abs(Z) + vz * half) * az
    q = _root(k.l9, reach.q, X * X + Z * Z, Bend(X * dx + Z * dz, bend), half)
    return p, q


def _root(length: float, root: FloatArray, square: FloatArray, w: Bend, half: FloatArray) -> Bend:
    """Differentiate R = sqrt(L^2 - w) twice.

    Args:
        length: L.
        root: R at the sample.
        square: w at the sample.
        w: Half of w' there, and a bound on half of w''.
        half: Half the length of the part.
    """
    rate = np.abs(w.slope)
    low = np.sqrt(length * length - (square + 2.0 * rate * half + w.bound * half * half))
    steep = (rate + w.bound * half) / low
    return Bend(-w.slope / root, w.bound / low + steep * steep / low)


def carriage_margin(
    rules: Rules, parts: Parts, reach: Reach, strokes: tuple[Bend, Bend]
) -> Bounded:
    """Carriage margins at the samples, as far as they count here, and their lower bounds.

    The margin changes by at most half of what the distance of any two carriages does. Only whether
    it is so much larger than needed is asked for first, however large the change: it takes far less
    time than the margin itself.
    """
    needed, k, (p, q) = rules.machine.carriage_margin, rules.constants, strokes
    values = np.full(parts.half.size, np.inf)
    if needed == 0.0:
        return values[:, None], values[:, None]
    geometry, places = rules.machine.geometry, parts.states[:, 0]
    half, square = parts.half, 0.5 * parts.half * parts.half
    legs = np.abs((k.w2 - k.w1) * p.slope) * half + abs(k.w2 - k.w1) * p.bound * square
    sides = [np.abs(k.w3 * q.slope - w * p.slope) * half for w in (k.w1, k.w2)]
    loss = 0.5 * np.maximum(legs, np.maximum(*sides) + (p.bound + q.bound) * square)
    kept = reach.lacking.max(axis=1) < 0.0
    near = kept.copy()
    kept[near] = keeps_margin(geometry, places[near], reach[near], (needed + _KEPT + loss)[near])
    near &= ~kept
    if near.any():
        enough = needed + 2.0 * TOUCHING
        values[near] = margin_up_to(geometry, places[near], reach[near], enough=enough)
    return values[:, None], np.where(kept, needed + _KEPT, -np.inf)[:, None]


def clearance(rules: Rules, parts: Parts, inside: BoolArray) -> Bounded:
    """Clearance at the samples, and its lower bound on the intervals."""
    states, half = parts.states, parts.half
    values, away = np.full(half.size, -np.inf), np.zeros((half.size, 3))
    found = nearest_surface(rules.machine.geometry, WORKING.v, states[inside, 0])
    values[inside], away[inside] = found.distance, found.away
    slope, normal = states[:, 1, ::2], away[:, ::2]
    far = np.sqrt((slope * slope).sum(axis=1)) * half
    near = np.abs((slope * normal).sum(axis=1)) * half
    bow = 0.5 * np.sqrt((parts.second[:, ::2] ** 2).sum(axis=1)) * half * half
    needed = rules.machine.clearance + SURE
    lowest, spare = values - far - bow, values - near - bow - needed
    rows = np.flatnonzero((lowest < needed) & (spare > 0.0))
    if rows.size:
        chord = slope[rows] * half[rows, None]
        ends = np.stack([chord, -chord], axis=1)
        pose = states[rows, 0], normal[rows]
        better = bound_from_anchors(rules.machine, pose, ends, spare[rows])
        lowest[rows] = np.maximum(lowest[rows], better - bow[rows])
    return values[:, None], lowest[:, None]


def boxes(machine: Machine, parts: Parts) -> Bounded:
    """Distance of each sample from each keep-out box, negative inside, and its lower bound."""
    values = np.zeros((parts.half.size, len(machine.keep_out)))
    lowest = values.copy()
    if machine.keep_out:
        half, position = parts.half[:, None], parts.states[:, 0]
        change = np.abs(parts.states[:, 1]) * half + 0.5 * parts.second * half * half
        for i, box in enumerate(machine.keep_out):
            out = outside(box, position)
            values[:, i] = box_distance(out)
            lowest[:, i] = box_distance(out - change)
    return values, lowest
