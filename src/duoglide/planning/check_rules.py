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
from typing import Any

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics._distance import nearest_surface
from duoglide.kinematics._kernels import Constants, pose_constants
from duoglide.kinematics._reach import reach_of
from duoglide.kinematics.modes import WORKING
from duoglide.machine import Machine
from duoglide.motion.curve import Curve
from duoglide.motion.curve_bounds import CurveBounds, curve_bounds

TOUCHING = 1e-7  # [mm]; a margin this near to what is required counts as touching, and is refused
SURE = 0.9e-7  # [mm]; a bound this far above what is required certifies an interval
TRAVEL = ("travel_1", "travel_2", "travel_3")
BASE_FAMILIES = ("clearance", *TRAVEL, "order")
_REACH_OF_ANCHOR = 0.25  # of the leg's length, at most

IndexArray = np.ndarray[Any, np.dtype[np.intp]]


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
        result: BoolArray = (self.margins < TOUCHING).any(axis=1)
        return result

    @property
    def certified(self) -> BoolArray:
        """Where the whole interval keeps every rule."""
        result: BoolArray = (self.lowest >= SURE).all(axis=1)
        return result


def judge(rules: Rules, intervals: Intervals) -> Verdict:
    """Evaluate every rule on intervals."""
    states = rules.curve.derivatives(intervals.middle, intervals.piece)
    half = intervals.half
    first, second = _local_bounds(rules.bounds, states, intervals)
    k, position = rules.constants, states[:, 0]
    reach = reach_of(position, k)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        stroke_p, stroke_q = _strokes(states, first, second, half, reach, k)
        travel = _travel(rules, states, second, half, stroke_p, stroke_q)
    inside = (reach.lacking < 0.0).all(axis=1)
    clear = _clearance(rules, states, second, half, inside)
    boxes = _boxes(rules.machine, states, second, half)
    margins = np.column_stack([clear[0], travel[0], boxes[0]]) - rules.required
    lowest = np.column_stack([clear[1], travel[1], boxes[1]]) - rules.required
    margins[~inside], lowest[~inside] = -np.inf, -np.inf
    return Verdict(margins, np.where(np.isnan(lowest), -np.inf, lowest))


def _local_bounds(
    bounds: CurveBounds, states: FloatArray, intervals: Intervals
) -> tuple[FloatArray, FloatArray]:
    """Bound |p'| and |p''| by component on each interval, shape (n, 3)."""
    piece, half = intervals.piece, intervals.half[:, None]
    second = np.minimum(bounds.second[piece], np.abs(states[:, 2]) + bounds.third[piece] * half)
    first = np.minimum(bounds.first[piece], np.abs(states[:, 1]) + second * half)
    return first, second


def _strokes(
    states: FloatArray, first: FloatArray, second: FloatArray, half: FloatArray, reach: Any, k: Any
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]:
    """Value and slope at the sample, and a bound on the second derivative, of P and Q."""
    cx, _base, l6, l2, _half, xb, zb, l9, *_ = k
    (x, z), (dx, dz) = (states[:, i, ::2].T for i in (0, 1))
    (vx, vz), (ax, az) = first[:, ::2].T, second[:, ::2].T
    u, X, Z = x - cx, x - xb, z - zb
    top = np.abs(u) + vx * half
    low = np.sqrt((l6 - top) * (l6 + top))
    slope_a = top * vx / low
    bend_a = (vx * vx + top * ax + slope_a * slope_a) / low
    dh, vh, ah = dz + u * dx / reach.A, vz + slope_a, az + bend_a
    top = np.abs(reach.h) + vh * half
    low = np.sqrt((l2 - top) * (l2 + top))
    slope = top * vh / low
    p = reach.p, -reach.h * dh / reach.p, (vh * vh + top * ah + slope * slope) / low
    top_x, top_z = np.abs(X) + vx * half, np.abs(Z) + vz * half
    low = np.sqrt(l9 * l9 - (top_x * top_x + top_z * top_z))
    slope = (top_x * vx + top_z * vz) / low
    bend = (vx * vx + vz * vz + top_x * ax + top_z * az + slope * slope) / low
    return p, (reach.q, -(X * dx + Z * dz) / reach.q, bend)


def _travel(
    rules: Rules, states: FloatArray, second: FloatArray, half: FloatArray, p: Any, q: Any
) -> tuple[FloatArray, FloatArray]:
    """Margins of travel 1 to 3 and of the order of carriages 1 and 2, and their lower bounds."""
    half_coupler, (w1, w2, w3) = rules.constants[4], rules.constants[9:]
    limit = rules.machine.geometry.rail_half_length
    margins, lowest = [], []
    for shift, w, (stroke, slope, bend) in (
        (-half_coupler, w1, p),
        (half_coupler, w2, p),
        (0.0, w3, q),
    ):
        place = states[:, 0, 1] + shift + w * stroke
        rate = np.abs(states[:, 1, 1] + w * slope)
        margins.append(limit - np.abs(place))
        lowest.append(margins[-1] - rate * half - 0.5 * (second[:, 1] + bend) * half * half)
    stroke, slope, bend = p
    margins.append(2.0 * half_coupler + (w2 - w1) * stroke)
    change = np.abs(slope) * half + 0.5 * bend * half * half
    lowest.append(margins[-1] - abs(w2 - w1) * change)
    return np.stack(margins, axis=1), np.stack(lowest, axis=1)


def _clearance(
    rules: Rules, states: FloatArray, second: FloatArray, half: FloatArray, inside: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Clearance at the samples, and its lower bound on the intervals."""
    geometry = rules.machine.geometry
    needed = rules.machine.clearance + SURE
    values = np.full(half.size, -np.inf)
    normal = np.zeros((half.size, 3))
    values[inside], normal[inside] = nearest_surface(geometry, WORKING.v, states[inside, 0])
    speed = np.hypot(states[:, 1, 0], states[:, 1, 2])
    bow = 0.5 * np.hypot(second[:, 0], second[:, 2]) * half * half
    lowest = values - speed * half - bow
    slope = np.abs(np.sum(states[:, 1] * normal, axis=1))
    spare = values - slope * half - bow - needed
    rows = np.flatnonzero((lowest < needed) & (spare > 0.0))
    if rows.size:
        lowest[rows] = np.maximum(
            lowest[rows],
            _from_anchors(rules, states[rows], normal[rows], half[rows], spare[rows]) - bow[rows],
        )
    return values, lowest


def _from_anchors(
    rules: Rules, states: FloatArray, normal: FloatArray, half: FloatArray, spare: FloatArray
) -> FloatArray:
    """Bound the clearance on chords by that of anchors away from the nearest surface.

    The anchor is twice as far away as the chord's length asks for: with the offset l, the bound is
    short of the true value by about w^2 / (2 l) at a distance w along the surface.
    """
    chord = states[:, 1, ::2] * half[:, None]
    longest = _REACH_OF_ANCHOR * rules.machine.geometry.leg_length
    offset = np.minimum(np.maximum(np.sum(chord**2, axis=1) / spare, 1e-3), longest)
    anchor = states[:, 0] + offset[:, None] * normal
    reached = (reach_of(anchor, rules.constants).lacking < 0.0).all(axis=1)
    clear = np.full(half.size, -np.inf)
    clear[reached], _ = nearest_surface(rules.machine.geometry, WORKING.v, anchor[reached])
    way = offset[:, None] * normal[:, ::2]
    ends = [np.hypot(*(way + side * chord).T) for side in (-1.0, 1.0)]
    return clear - np.maximum(*ends)


def _boxes(
    machine: Machine, states: FloatArray, second: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How far outside each keep-out box a sample is, along the axis that is farthest out."""
    if not machine.keep_out:
        empty = np.zeros((half.size, 0))
        return empty, empty
    width = half[:, None]
    change = np.abs(states[:, 1]) * width + 0.5 * second * width * width
    margins, lowest = [], []
    for box in machine.keep_out:
        below, above = np.subtract(box.low, states[:, 0]), states[:, 0] - np.array(box.high)
        outside = np.maximum(below, above)
        margins.append(outside.max(axis=1))
        lowest.append((outside - change).max(axis=1))
    return np.stack(margins, axis=1), np.stack(lowest, axis=1)
