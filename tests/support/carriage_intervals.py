"""Whether links close wherever the carriages are within intervals: what margins are held to."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import BoolArray, FloatArray, as_triples
from duoglide.kinematics._joint_region import JointRegion, Tip, depth_pose, joint_region
from duoglide.kinematics.carriage_margin import RESERVE
from duoglide.kinematics.kernels import in_numpy
from duoglide.kinematics.modes import ASSEMBLY, WORKING, AssemblyMode, WorkingMode
from duoglide.machine import Geometry

_depth = in_numpy(depth_pose)


def closes_throughout(
    geometry: Geometry,
    lowest: ArrayLike,
    highest: ArrayLike,
    assembly: AssemblyMode = ASSEMBLY,
    working: WorkingMode = WORKING,
) -> BoolArray:
    """Tell whether the links close wherever the carriages are within intervals, on one side.

    Exact up to rounding, which is decided against closing: where it is true, every triple of
    carriages in the intervals closes in these modes, and none is on a singular surface or an edge
    of reach, nor would one be crossed between two of them. Links only: the ends of the rails are
    not looked at.

    Args:
        geometry: Dimensions of the robot.
        lowest: Lowest place of each carriage [mm], shape (..., 3).
        highest: Highest place of each carriage [mm], the same shape.
        assembly: Which of the forward solutions.
        working: Which of the inverse solutions; in the modes w1 = w2 every pose is singular.

    Returns:
        Boolean mask of shape (...); false, too, where a lowest place is above the highest.
    """
    low, high = as_triples(lowest, "lowest"), as_triples(highest, "highest")
    if working.w1 == working.w2:
        return np.zeros(low.shape[:-1], dtype=bool)[()]
    region = joint_region(geometry, assembly, working.v)
    hexagon = _hexagon(low, high, geometry.coupler_length, side_of(working))
    good: BoolArray = _inside(region, hexagon) & (low <= high).all(axis=-1)
    return good[()]


def _hexagon(
    low: FloatArray, high: FloatArray, coupler: float, side: tuple[float, float]
) -> tuple[FloatArray, ...]:
    """Return the lowest and the highest b, s and t of carriages within intervals [mm]."""
    (low1, low2, low3), (high1, high2, high3) = np.moveaxis(low, -1, 0), np.moveaxis(high, -1, 0)
    half = 0.5 * coupler
    to_b, to_g = side
    b = _turned(low2 - high1 - coupler, high2 - low1 - coupler, to_b)
    s = _turned(low3 - high1 - half, high3 - low1 - half, to_g)
    t = _turned(low3 - high2 + half, high3 - low2 + half, to_g)
    return (*b, *s, *t) if to_b * to_g > 0.0 else (*b, *t, *s)


def _turned(low: FloatArray, high: FloatArray, sign: float) -> tuple[FloatArray, FloatArray]:
    """Return an interval, or its mirror image, a little larger for rounding."""
    first, last = (low, high) if sign > 0.0 else (-high, -low)
    return first - RESERVE, last + RESERVE


def _inside(region: JointRegion, hexagon: tuple[FloatArray, ...]) -> BoolArray:
    """Tell which hexagons lie in the region."""
    b_low, b_high, s_low, s_high, t_low, t_high = hexagon
    top, bottom = s_high - t_high, s_low - t_low
    b = np.stack([b_low, b_low, top, b_high, b_high, bottom])
    g = np.minimum(s_high - 0.5 * b, t_high + 0.5 * b)
    g[::2] = np.maximum(s_low - 0.5 * b[::2], t_low + 0.5 * b[::2])
    g[2], g[5] = 0.5 * (s_high + t_high), 0.5 * (s_low + t_low)
    good: BoolArray = _depth(b, g, region.constants).min(axis=0) > 0.0
    for tip in region.tips:
        good &= ~_holds(tip, hexagon)
    return good


def _holds(tip: Tip, hexagon: tuple[FloatArray, ...]) -> BoolArray:
    """Tell which hexagons hold something of the obstacle in its directions from a tip."""
    b_low, b_high, s_low, s_high, t_low, t_high = hexagon
    # mirrored so that the obstacle goes on in the directions of larger b and g
    low, high = (b_low, b_high) if tip.to_b > 0.0 else (-b_high, -b_low)
    if tip.to_g > 0.0:
        s, t = (s_high, t_high) if tip.to_b > 0.0 else (t_high, s_high)
    else:
        s, t = (-t_low, -s_low) if tip.to_b > 0.0 else (-s_low, -t_low)
    start, end = np.maximum(low, max(tip.b, tip.start)), np.minimum(high, tip.end)
    b = np.clip(s - t, start, np.maximum(end, start))
    held: BoolArray = (start <= end) & (np.minimum(s - 0.5 * b, t + 0.5 * b) >= tip.g)
    return held


def side_of(mode: WorkingMode) -> tuple[float, float]:
    """Return the signs of B and of yA3 - y in a working mode with w1 != w2."""
    return 0.5 * (mode.w2 - mode.w1), 1.0 * mode.w3
