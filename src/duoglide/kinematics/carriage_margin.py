"""How far the carriages may be off before a link parts or a singular surface is touched.

Clearance is a distance of the platform. Near legs flat it is quadratic in the carriages: 2 mm of it
are 0.025 mm of the carriages. What drives miss is a distance of the carriages, and so is this.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import BoolArray, FloatArray, IndexArray, as_triples
from duoglide.kinematics._joint_region import (
    JointRegion,
    RegionConstants,
    depth_pose,
    joint_region,
)
from duoglide.kinematics.compiled import compiled, share
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.kernels import in_numpy
from duoglide.kinematics.modes import ASSEMBLY, WORKING, AssemblyMode, WorkingMode
from duoglide.kinematics.reach import Reach, reach_of, require_reach
from duoglide.machine import Geometry

RESERVE = 1e-7  # [mm] by which the margin is below the exact one, for rounding
BRACKET = 2e-8  # [mm], to which the first corner that leaves the region is found
STEPS = 60
TINY = 1e-300
MANY = 64  # poses, from which compiled code answers, though loading it takes half a second

SAME = 1e-6  # [mm], within which two margins are one

# Corners of the hexagon of carriages within +-1, in b and g.
CORNERS = ((0.0, 2.0), (0.0, -2.0), (2.0, 1.0), (2.0, -1.0), (-2.0, 1.0), (-2.0, -1.0))
_ASIDE, _ALONG = np.array(CORNERS).T[:, :, None]
_depth = in_numpy(depth_pose)


def carriage_margin(
    geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING
) -> FloatArray:
    """Measure how far all carriages may be off at once, in any direction.

    It is the largest error e such that with every carriage anywhere within +-e of its place the
    links close, on the same side of every singular surface and edge of reach (the six families of
    ``margins``). It is 1e-7 mm below the exact value, and never above it. Links only: the ends of
    the rails are not looked at. It changes by at most what the carriage that moves most moves by,
    so that a sampled motion is proven between its samples.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        mode: Which of the inverse solutions; in the modes w1 = w2 every pose is singular.

    Returns:
        Errors of the carriages [mm], shape (...), 0 on a surface; of one pose, a number.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short.
    """
    array = as_triples(position, "position")
    k = pose_constants(geometry, mode)
    require_reach(array, k)
    flat = array.reshape(-1, 3)
    margin = margin_up_to(geometry, flat, reach_of(flat, k), mode)
    return margin.reshape(array.shape[:-1])[()]


def margin_up_to(
    geometry: Geometry,
    position: FloatArray,
    reach: Reach,
    mode: WorkingMode = WORKING,
    enough: float | FloatArray = np.inf,
) -> FloatArray:
    """Return the carriage margin, or ``enough`` where it is more: to know so takes far less time.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' within reach [mm], shape (n, 3).
        reach: What ``reach_of`` says of the positions.
        mode: Which of the inverse solutions.
        enough: Margin above which the exact one is not asked for [mm], a number or of shape (n,).
    """
    ceiling = np.broadcast_to(enough, len(position))
    margin = np.zeros(len(position))
    for region, own in _regions(geometry, position, reach, mode):
        places = _Places.of(region, reach[own])
        found = ceiling[own]
        rows = np.flatnonzero(~places.keep(found + RESERVE))
        found[rows] = np.minimum(places[rows].margins(), found[rows])
        margin[own] = found
    return margin


def keeps_margin(
    geometry: Geometry, position: FloatArray, reach: Reach, least: FloatArray
) -> BoolArray:
    """Tell where the carriage margin is above ``least``, without finding it.

    Args:
        geometry: Dimensions of the robot, in its working mode.
        position: Platform centre O' within reach [mm], shape (n, 3).
        reach: What ``reach_of`` says of the positions.
        least: Margin to be exceeded [mm], shape (n,); NaN and infinity never are.
    """
    kept = np.zeros(len(position), dtype=bool)
    for region, own in _regions(geometry, position, reach, WORKING):
        kept[own] = _Places.of(region, reach[own]).keep(least[own] + RESERVE)
    return kept


def least_margin(
    geometry: Geometry, position: FloatArray, loss: float | FloatArray = 0.0
) -> tuple[float, int]:
    """Find the least carriage margin of many poses, of which few are looked at closely.

    Args:
        geometry: Dimensions of the robot, in its working mode.
        position: Platform centre O' within reach [mm], shape (n, 3), n above 0.
        loss: What is taken off the margin of each pose [mm], a number or of shape (n,).

    Returns:
        The least margin less its loss [mm], to 1e-6 mm, and the index of its pose.
    """
    reach = reach_of(position, pose_constants(geometry, WORKING))
    less = np.broadcast_to(loss, len(position))
    best, index = np.inf, 0
    for region, own in _regions(geometry, position, reach, WORKING):
        places, rows = _Places.of(region, reach[own]), np.flatnonzero(own)
        order = places.high - less[rows]
        while rows.size:
            first = int(order.argmin())
            found = float(places[[first]].margins()[0] - less[rows[first]])
            if found < best:
                best, index = found, int(rows[first])
            ceiling = best - SAME + less[rows]
            depth = places.depth(ceiling)
            left = np.flatnonzero((depth <= 0.0) | (places.high <= ceiling))
            left = left[left != first]
            places, rows, order = places[left], rows[left], depth[left]
    if best == np.inf:  # every pose is on a surface
        return float(-less.max()), int(less.argmax())
    return best, index


def _regions(
    geometry: Geometry, position: FloatArray, reach: Reach, mode: WorkingMode
) -> Iterator[tuple[JointRegion, BoolArray]]:
    """Yield the region of every assembly mode, and which poses (n,) are in it; none if w1 = w2."""
    if mode.w1 == mode.w2:
        return
    k = pose_constants(geometry, mode)
    # which side of case 2 a pose is on, as in ``margins``
    side = (position[:, 0] - k.xb) * reach.A - (position[:, 2] - k.zb) * (position[:, 0] - k.cx)
    for m, above in ((1, reach.h > 0.0), (-1, reach.h < 0.0)):
        for n, beside in ((1, side > 0.0), (-1, side < 0.0)):
            own = above & beside
            if own.any():
                yield joint_region(geometry, AssemblyMode(m, n), mode.v), own


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Places in a region, and how large their hexagons can be before lines and tips count.

    Attributes:
        region: The region.
        b: See the region [mm], shape (n,); so are the others.
        g: The same.
        high: Largest error at which no edge of reach and no tip is met.
    """

    region: JointRegion
    b: FloatArray
    g: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, region: JointRegion, reach: Reach) -> _Places:
        """Place poses in the region."""
        p, q, h = reach.p, reach.q, reach.h
        k = region.constants
        b, g = 2.0 * p, q
        flat = h * h / (k.l2 + p)  # l2 - p, without cancellation
        high = np.minimum(np.minimum(p, flat), 0.5 * np.minimum(q, k.l9 - q))
        for tip in region.tips:
            b_to, g_to = tip.to_b * b, tip.to_g * g
            aside = np.abs(np.clip(b_to, max(tip.b, tip.start), tip.end) - b_to)
            beyond = 0.5 * (tip.g - g_to + 0.5 * aside)
            high = np.minimum(high, np.maximum(0.5 * aside, beyond))
        return cls(region, b, g, np.maximum(high, 0.0))

    def __getitem__(self, rows: IndexArray | list[int]) -> _Places:
        return _Places(self.region, self.b[rows], self.g[rows], self.high[rows])

    def depth(self, e: FloatArray) -> FloatArray:
        """Return the least depth of the corners of hexagons of carriages within +-e [mm], (n,)."""
        b, g = self.b + _ASIDE * e, self.g + _ALONG * e
        least: FloatArray = _depth(b, g, self.region.constants).min(axis=0)
        return least

    def keep(self, e: FloatArray) -> BoolArray:
        """Tell which margins are above ``e`` [mm], shape (n,)."""
        kept = self.high > e
        rows = np.flatnonzero(kept)
        kept[rows] = self[rows].depth(e[rows]) > 0.0
        return kept

    def margins(self) -> FloatArray:
        """Return the margins [mm], shape (n,)."""
        margin = np.empty(self.b.size)
        loop = _compiled_loop() if self.b.size >= MANY else largest_loop
        loop(np.stack([self.b, self.g, self.high], axis=1), self.region.constants, margin)
        return np.maximum(margin - RESERVE, 0.0)


def corners_depth(b: float, g: float, e: float, k: RegionConstants) -> float:
    """Return the least depth of the corners of the hexagon of carriages within +-e [mm]."""
    least = depth_pose(b, g, k)
    for aside, along in CORNERS:
        least = min(least, depth_pose(b + aside * e, g + along * e, k))
    return least


def largest_error(b: float, g: float, high: float, k: RegionConstants) -> float:
    """Return the largest e up to ``high`` whose hexagon has its corners in the region [mm].

    False position with Illinois' rule, at least half a bracket from either end, so that a good
    guess closes it; now and then a step halves. The lower end is certain.
    """
    low, inside = 0.0, depth_pose(b, g, k)
    if not inside > 0.0:
        return 0.0
    high = max(high - BRACKET, 0.0)  # a corner is on the edge itself otherwise
    outside = corners_depth(b, g, high, k)
    if outside > 0.0:
        return high
    kept = 0
    for step in range(STEPS):
        if high - low <= BRACKET:
            break
        e = (low * outside - high * inside) / min(outside - inside, -TINY)
        e = min(max(e, low + 0.5 * BRACKET), high - 0.5 * BRACKET)
        if step % 6 == 5:
            e = 0.5 * (low + high)
        depth = corners_depth(b, g, e, k)
        if depth > 0.0:
            low, inside = e, depth
            if kept > 0:
                outside *= 0.5
            kept = 1
        else:
            high, outside = e, depth
            if kept < 0:
                inside *= 0.5
            kept = -1
    return low


def largest_loop(rows: FloatArray, k: RegionConstants, out: FloatArray) -> None:
    """Run ``largest_error`` along b, g and the largest e of each pose, shape (n, 3)."""
    for i in range(len(rows)):
        out[i] = largest_error(float(rows[i, 0]), float(rows[i, 1]), float(rows[i, 2]), k)


@cache
def _compiled_loop() -> Any:
    """Compile the loop, or load it from numba's cache."""
    share(depth_pose, corners_depth, largest_error)
    return compiled(largest_loop, nogil=True)


def fold_of(geometry: Geometry) -> float:
    """Return the b at which obstacles of the region change their directions [mm]; inf if none."""
    return joint_region(geometry, ASSEMBLY, WORKING.v).fold
