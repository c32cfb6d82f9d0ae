"""The rules that a path must keep, at samples and on the intervals about them.

Every rule is a margin that must stay above what is required. On an interval it is bounded from
below by Taylor's theorem: value, slope and a bound on the second derivative that holds on the whole
interval. The clearance is a distance to a set, which gives more: from any anchor C,
clearance(p) >= clearance(C) - |p - C|. With C at the sample that is the Lipschitz bound; with C
further away from the surface it is one of second order, and asks nothing else of the surface.

Legend, as in the kinematics: u = x - (b - d), A = l6 sin(beta), h the rise of the legs, P and Q the
strokes of legs and strut along y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics._distance import nearest_surface
from duoglide.kinematics._kernels import Constants, pose_constants
from duoglide.kinematics._reach import Reach, reach_of
from duoglide.kinematics.modes import WORKING
from duoglide.machine import Box, Machine
from duoglide.motion.curve import Curve
from duoglide.motion.curve_bounds import CurveBounds, curve_bounds

TOUCHING = 1e-7  # [mm]; a margin this near to what is required counts as touching, and is refused
SURE = 0.9e-7  # [mm]; a bound this far above what is required certifies an interval
TRAVEL = ("travel_1", "travel_2", "travel_3")
BASE_FAMILIES = ("clearance", *TRAVEL, "order")
_FARTHEST_ANCHOR = 0.25  # of the leg's length

IndexArray: TypeAlias = NDArray[np.intp]
Stroke: TypeAlias = tuple[FloatArray, FloatArray]  # slope, bound on the bend


@dataclass(frozen=True, slots=True, eq=False)
class Rules:
    """A machine's rules along a curve.

    Attributes:
        machine: The machine.
        curve: Where its platform's centre goes, in the base frame.
        bounds: Bounds on the derivatives of the curve.
        constants: The kinematics' constants.
    """

    machine: Machine
    curve: Curve
    bounds: CurveBounds
    constants: Constants

    @classmethod
    def of(cls, machine: Machine, curve: Curve) -> Rules:
        """Collect what the rules need."""
        return cls(machine, curve, curve_bounds(curve), pose_constants(machine.geometry, WORKING))

    @property
    def families(self) -> tuple[str, ...]:
        """Names of the rules, in the order of the columns of margins."""
        return (*BASE_FAMILIES, *(f"keep_out {box.name}" for box in self.machine.keep_out))

    @property
    def required(self) -> FloatArray:
        """What each margin must be at least [mm]."""
        boxes = [0.0] * len(self.machine.keep_out)
        return np.array(
            [self.machine.clearance, 0.0, 0.0, 0.0, self.machine.carriage_width, *boxes]
        )


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Parts of a curve: each within one piece, around a sample.

    Attributes:
        piece: Which piece, shape (n,).
        middle: Sigma of the sample [mm].
        half: Half of the interval's length [mm].
    """

    piece: IndexArray
    middle: FloatArray
    half: FloatArray

    def split(self, parts: int) -> Intervals:
        """Cut every interval into equal parts."""
        offsets = (2.0 * np.arange(parts) + 1.0) / parts - 1.0
        middle = (self.middle[:, None] + self.half[:, None] * offsets).ravel()
        return Intervals(np.repeat(self.piece, parts), middle, np.repeat(self.half / parts, parts))

    def __getitem__(self, rows: Any) -> Intervals:
        return Intervals(self.piece[rows], self.middle[rows], self.half[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What is known about intervals.

    Attributes:
        margins: Margins at the samples, minus what is required [mm], shape (n, families); minus
            infinity out of reach.
        lowest: Lower bounds of the same on the whole intervals.
    """

    margins: FloatArray
    lowest: FloatArray

    @property
    def failed(self) -> BoolArray:
        """Where a sample breaks a rule, or touches."""
        mask: BoolArray = self.margins.min(axis=1) < TOUCHING
        return mask

    @property
    def certified(self) -> BoolArray:
        """Where the whole interval keeps every rule."""
        mask: BoolArray = self.lowest.min(axis=1) >= SURE
        return mask


def judge(rules: Rules, intervals: Intervals) -> Verdict:
    """Evaluate every rule on intervals."""
    states = rules.curve.derivatives(intervals.middle, intervals.piece)
    piece, half = intervals.piece, intervals.half[:, None]
    bounds = rules.bounds
    second = np.minimum(bounds.second[piece], np.abs(states[:, 2]) + bounds.third[piece] * half)
    first = np.minimum(bounds.first[piece], np.abs(states[:, 1]) + second * half)
    return judge_parts(rules, Parts(states, intervals.half, first, second))


def judge_points(rules: Rules, positions: FloatArray) -> FloatArray:
    """Evaluate every rule at single positions of the platform's centre.

    Returns:
        Margins less what is required [mm], shape (n, families); minus infinity out of reach.
    """
    reach = reach_of(positions, rules.constants)
    inside = reach.lacking.max(axis=1) < 0.0
    clear = np.full(len(positions), -np.inf)
    clear[inside], _ = nearest_surface(rules.machine.geometry, WORKING.v, positions[inside])
    places, gap = _places(rules.constants, positions[:, 1], reach)
    outside = [_outside(box, positions).max(axis=1) for box in rules.machine.keep_out]
    limit = rules.machine.geometry.rail_half_length
    margins = np.stack([clear, *(limit - np.abs(place) for place in places), gap, *outside], axis=1)
    margins -= rules.required
    margins[~inside] = -np.inf
    return margins


def _places(
    k: Constants, y: FloatArray, reach: Reach
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], FloatArray]:
    """Places of the carriages, and the way from carriage 1 to carriage 2."""
    half_coupler, (w1, w2, w3) = k[4], k[9:]
    one, other = y - half_coupler + w1 * reach.p, y + half_coupler + w2 * reach.p
    return (one, other, y + w3 * reach.q), 2.0 * half_coupler + (w2 - w1) * reach.p


def _outside(box: Box, position: FloatArray) -> FloatArray:
    """How far outside a box positions are along each axis, shape (n, 3)."""
    outside: FloatArray = np.maximum(np.array(box.low) - position, position - np.array(box.high))
    return outside


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """Parts of a curve, each about its middle.

    Attributes:
        states: Position and three derivatives in the middle, shape (n, 4, 3).
        half: Half the length in sigma [mm], shape (n,).
        first: Bound on the components of p' on the whole part, shape (n, 3).
        second: Bound on those of p'' [1/mm].
    """

    states: FloatArray
    half: FloatArray
    first: FloatArray
    second: FloatArray


def judge_parts(rules: Rules, parts: Parts) -> Verdict:
    """Evaluate every rule on parts of a curve."""
    reach = reach_of(parts.states[:, 0], rules.constants)
    inside = reach.lacking.max(axis=1) < 0.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        travel = _travel(rules, parts, reach)
    columns = _clearance(rules, parts, inside), travel, _boxes(rules.machine, parts)
    margins = np.concatenate([values for values, _ in columns], axis=1) - rules.required
    lowest = np.concatenate([bound for _, bound in columns], axis=1) - rules.required
    margins[~inside], lowest[~inside] = -np.inf, -np.inf
    return Verdict(margins, np.where(np.isnan(lowest), -np.inf, lowest))


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


def _travel(rules: Rules, parts: Parts, reach: Reach) -> tuple[FloatArray, FloatArray]:
    """Margins of travel 1 to 3 and of the order of carriages 1 and 2, and their lower bounds."""
    (slope_p, bend_p), (slope_q, bend_q) = _strokes(parts, reach, rules.constants)
    (w1, w2, w3), limit = rules.constants[9:], rules.machine.geometry.rail_half_length
    half, square = parts.half, 0.5 * parts.half * parts.half
    places, gap = _places(rules.constants, parts.states[:, 0, 1], reach)
    speed, bend = parts.states[:, 1, 1], parts.second[:, 1]
    margins, lowest = [], []
    for place, slope, more in zip(
        places, (w1 * slope_p, w2 * slope_p, w3 * slope_q), (bend_p, bend_p, bend_q), strict=True
    ):
        margins.append(limit - np.abs(place))
        lowest.append(margins[-1] - np.abs(speed + slope) * half - (bend + more) * square)
    margins.append(gap)
    lowest.append(gap - abs(w2 - w1) * (np.abs(slope_p) * half + bend_p * square))
    return np.stack(margins, axis=1), np.stack(lowest, axis=1)


def _clearance(rules: Rules, parts: Parts, inside: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Clearance at the samples, and its lower bound on the intervals."""
    states, half = parts.states, parts.half
    values, normal = np.full(half.size, -np.inf), np.zeros((half.size, 3))
    found = nearest_surface(rules.machine.geometry, WORKING.v, states[inside, 0])
    values[inside], normal[inside] = found
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
    clear[reached], _ = nearest_surface(geometry, WORKING.v, anchor[reached])
    ahead, behind = offset[:, ::2] - way, offset[:, ::2] + way
    bound: FloatArray = clear - np.maximum(np.hypot(*ahead.T), np.hypot(*behind.T))
    return bound


def _boxes(machine: Machine, parts: Parts) -> tuple[FloatArray, FloatArray]:
    """How far outside each keep-out box a sample is, along the axis that is farthest out."""
    values = np.zeros((parts.half.size, len(machine.keep_out)))
    lowest = values.copy()
    if machine.keep_out:
        half, position = parts.half[:, None], parts.states[:, 0]
        change = np.abs(parts.states[:, 1]) * half + 0.5 * parts.second * half * half
        for i, box in enumerate(machine.keep_out):
            outside = _outside(box, position)
            values[:, i] = outside.max(axis=1)
            lowest[:, i] = (outside - change).max(axis=1)
    return values, lowest
