"""Where the links close, seen from the carriages: a region of a plane, and what hexagons fit in it.

The mechanism does not change along y, so that only b = |B| = |yA2 - yA1 - l3| and g = |yA3 - y|
count. b gives the rise of the legs h, and with it the arm's foot at F = (F1, F3 = lift + h) seen
from B3; g gives the strut's projection rho. Arm (l6), strut (rho) and F make a triangle. Each of
the paper's surfaces bounds the region by a line or by a curve rho = R(h):

    legs vertical b = 0, legs flat b = 2 l2, strut g = 0;
    arm in line with strut (case 2): rho = |F| + l6, |F| - l6 or l6 - |F|;
    arm flat, where the branches v merge: rho^2 = (F1 -+ l6)^2 + F3^2.

Carriages that are anywhere in three intervals fill a hexagon: intervals of b, s = g + b/2 and
t = g - b/2, which are the differences of two carriages each. R grows with |F3| and rho falls with
g, so that each curve bounds an obstacle that reaches without end in one direction of b and one of
g, on each side of F3 = 0. So a hexagon meets an obstacle only if one of its corners is in it, or if
it holds something in these directions from a tip: a point of the curve that runs along a side of
the hexagon. (Where F3 = 0 the curves run along b, so that a tip comes before.) Tips depend on the
geometry alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import asin, inf, pi, sqrt
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.modes import AssemblyMode
from duoglide.machine import Geometry

SAMPLES = 4001  # of each curve, between which its tips are looked for
HALVINGS = 60
NOTHING = 1e-12  # share of a squared length that rounding leaves


class Tip(NamedTuple):
    """A point of an obstacle's curve that runs along a side of hexagons.

    Attributes:
        to_b: Sign of the direction of b in which the obstacle goes on.
        to_g: The same of g.
        b: Its place, times ``to_b`` [mm].
        g: Its place, times ``to_g`` [mm].
        start: Least b, times ``to_b``, of the side of F3 = 0 on which the obstacle is [mm].
        end: The largest.
    """

    to_b: float
    to_g: float
    b: float
    g: float
    start: float
    end: float


class RegionConstants(NamedTuple):
    """What ``depth_pose`` needs, all floats: numba wants one type.

    Attributes:
        l2: Leg length [mm].
        l6: Arm length [mm].
        l9: Strut length [mm].
        F1: As in ``Plane`` [mm].
        lift: The same.
        m: Sign of the rise of the legs.
        n: Side of case 2.
        v: Sign of sin(beta).
    """

    l2: float
    l6: float
    l9: float
    F1: float
    lift: float
    m: float
    n: float
    v: float


@dataclass(frozen=True, slots=True, eq=False)
class JointRegion:
    """The region of one geometry, one assembly mode and one sign of sin(beta).

    Attributes:
        constants: Its geometry and its modes in numbers.
        tips: The tips of all obstacles.
        fold: The b at which F3 = 0, and obstacles change their directions [mm]; inf where none is.
    """

    constants: RegionConstants
    tips: tuple[Tip, ...]
    fold: float


def depth_pose(b: float, g: float, k: RegionConstants) -> float:
    """Return a length that is positive just where (b, g) is in the region [mm]."""
    l6, half = k.l6, 0.5 * b
    F3 = k.lift + k.m * sqrt(max((k.l2 - half) * (k.l2 + half), 0.0))
    F = sqrt(k.F1 * k.F1 + F3 * F3)
    rho = sqrt(max((k.l9 - g) * (k.l9 + g), 0.0))
    up = 2.0 * (F3 >= 0.0) - 1.0
    side = k.F1 - up * k.n * l6
    legs, strut = min(b, 2.0 * k.l2 - b), min(g, k.l9 - g)
    flat, in_line = (
        k.v * up * (rho - sqrt(side * side + F3 * F3)),
        min(F + l6 - rho, rho - abs(F - l6)),
    )
    edges, surfaces = min(legs, strut), min(flat, in_line)
    return min(edges, surfaces)


@lru_cache(maxsize=128)
def joint_region(g: Geometry, assembly: AssemblyMode, v: int) -> JointRegion:
    """Return the region, with the tips of its obstacles."""
    plane = Plane.of(g)
    l2, lift, m = g.leg_length, plane.lift, assembly.m
    signs = 1.0 * m, 1.0 * assembly.n, 1.0 * v
    lengths = l2, g.arm_length, g.strut_length
    constants = RegionConstants(*lengths, plane.F1, lift, *signs)
    fold = 2.0 * sqrt((l2 - lift) * (l2 + lift)) if 0.0 < -m * lift < l2 else inf
    halves = [(0.0, 2.0 * l2, m if m * lift >= 0.0 else -m)]
    if fold < inf:
        halves = [(0.0, fold, m), (fold, 2.0 * l2, -m)]
    tips = [tip for half in halves for tip in _tips_of_half(constants, *half)]
    return JointRegion(constants=constants, tips=tuple(tips), fold=fold)


def _tips_of_half(k: RegionConstants, start: float, end: float, up: int) -> list[Tip]:
    """Find the tips of the four curves where F3 has the sign ``up``, b from ``start`` to ``end``.

    Each curve is R = grow |F'| + add with F' = (across, F3); it bounds rho from above or below.
    """
    l2, l6, F1 = k.l2, k.l6, k.F1
    falls = up * k.m  # +1 where |F3| falls as b grows
    flat_above = -k.v * up  # +1 where arm flat bounds rho from above
    tips = []
    for across, grow, add, above in (
        (F1, 1.0, l6, 1.0),
        (F1, 1.0, -l6, -1.0),
        (F1, -1.0, l6, -1.0),
        (F1 - up * k.n * l6, 1.0, 0.0, flat_above),
    ):
        to_b, to_g = falls * grow * above, -above
        low, high = sorted((start * to_b, end * to_b))
        theta = np.linspace(_angle(start, l2), _angle(end, l2), SAMPLES)
        for b, g in _touching(k, (across, grow, add), to_b * to_g, theta):
            tips.append(Tip(to_b, to_g, to_b * b, to_g * g, low, high))
    return tips


def _angle(b: float, l2: float) -> float:
    """Return the angle of the legs off the vertical, b = 2 l2 sin(theta)."""
    return asin(min(b / (2.0 * l2), 1.0)) if b < 2.0 * l2 else 0.5 * pi


def _touching(
    k: RegionConstants, curve: tuple[float, float, float], sign: float, theta: FloatArray
) -> list[tuple[float, float]]:
    """Find where a curve runs along the sides dg = -sign db / 2 of hexagons."""
    l2, l9 = k.l2, k.l9
    across, grow, add = curve

    def along(theta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """R, g, and what is 0 where the curve has the slope of the side: R R' - sign g b' / 2."""
        rise = l2 * np.cos(theta)
        F3 = k.lift + k.m * rise
        F = np.maximum(np.hypot(across, F3), NOTHING * l2)
        R = grow * F + add
        g = np.sqrt(np.maximum((l9 - R) * (l9 + R), 0.0))
        slope = -R * grow * F3 / F * k.m * l2 * np.sin(theta)
        return R, g, slope - sign * g * rise

    values = along(theta)[2]
    values[np.abs(values) < NOTHING * l9 * l9] = 0.0  # the curve is straight: its ends are corners
    cell = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    low, high, first = theta[cell], theta[cell + 1], values[cell]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = along(middle)[2] * first > 0.0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    R, g, _ = along(low)
    kept = (R >= 0.0) & (l9 >= R)
    return list(zip((2.0 * l2 * np.sin(low[kept])).tolist(), g[kept].tolist(), strict=True))
