"""The largest box of the workspace, with its extent along the rails."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TypeAlias

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.workspace.constraints import Constraints
from duoglide.kinematics.workspace.grid import Grid
from duoglide.kinematics.workspace.rectangles import Mask, Rectangle, refine_rectangle
from duoglide.machine import Geometry

Span: TypeAlias = tuple[FloatArray, FloatArray]  # from, to

CELLS = 40  # The coarse grid has so many cells along x, and as many along z.
SIDES = 17  # places of the left and of the right side at a time
ZOOMS = 5


@dataclass(frozen=True, slots=True)
class Cuboid:
    """A box between low and high corners (x, y, z) [mm]; endless along y on unlimited rails."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def size(self) -> tuple[float, float, float]:
        """Its sides along x, y and z [mm]."""
        x, y, z = (end - start for start, end in zip(self.low, self.high, strict=True))
        return x, y, z

    @property
    def volume(self) -> float:
        """Its volume [mm^3]."""
        x, y, z = self.size
        return x * y * z


def along_rails(
    geometry: Geometry, travel: float, x: Span, z: Span, mode: WorkingMode = WORKING
) -> Span:
    """Find from where to where along y all of a rectangle of the xz plane can be.

    Exact: the strokes of legs and strut are greatest and least where the rise of the legs and the
    distance from B3 are, and these are monotonous in x and z on either side of their zeros.

    Args:
        geometry: Dimensions of the robot.
        travel: The carriages stay within +-travel on their rails [mm].
        x: Left and right sides of rectangles within reach [mm], arrays of one shape or numbers.
        z: Their bottoms and tops.
        mode: Which of the inverse solutions.

    Returns:
        Least and greatest y [mm]; the least above the greatest where there is none.
    """
    g = geometry
    cx, base, xb, zb, *_ = Plane.of(g)
    arm = _bound_other_sides(g.arm_length, _bound_magnitudes(x[0] - cx, x[1] - cx))
    low, high = arm if mode.v > 0 else (-arm[1], -arm[0])
    p = _bound_other_sides(g.leg_length, _bound_magnitudes(z[0] - base - high, z[1] - base - low))
    across = _bound_magnitudes(x[0] - xb, x[1] - xb)
    up = _bound_magnitudes(z[0] - zb, z[1] - zb)
    q = _bound_other_sides(g.strut_length, (np.hypot(across[0], up[0]), np.hypot(across[1], up[1])))
    half = 0.5 * g.coupler_length
    ends = [
        (shift + np.minimum(w * s[0], w * s[1]), shift + np.maximum(w * s[0], w * s[1]))
        for shift, w, s in ((-half, mode.w1, p), (half, mode.w2, p), (0.0, mode.w3, q))
    ]
    least = np.min([end[0] for end in ends], axis=0)
    greatest = np.max([end[1] for end in ends], axis=0)
    return -travel - least, travel - greatest


def _bound_magnitudes(low: FloatArray, high: FloatArray) -> Span:
    """Return the least and the greatest magnitude between two numbers."""
    least = np.where(low * high <= 0.0, 0.0, np.minimum(np.abs(low), np.abs(high)))
    return least, np.maximum(np.abs(low), np.abs(high))


def _bound_other_sides(hypotenuse: float, sides: Span) -> Span:
    """Return the least and greatest other side of right triangles."""
    least, greatest = sides
    return (
        np.sqrt(np.maximum(hypotenuse**2 - greatest**2, 0.0)),
        np.sqrt(np.maximum(hypotenuse**2 - least**2, 0.0)),
    )


def largest_cuboid(
    geometry: Geometry,
    grid: Grid,
    constraints: Constraints,
    free: Mask,
    mode: WorkingMode = WORKING,
) -> Cuboid:
    """Find the box of greatest volume, all of whose poses are admissible, on rails that end.

    Every rectangle of a coarse grid is looked at; the best is then refined off the grid. Its
    extent along y is exact, and its other sides are at most where ``free`` ends.

    Args:
        geometry: Dimensions of the robot.
        grid: The grid; some of its cells are free.
        constraints: What limits the workspace, finite travel among it.
        free: Whether points (x, z) are free at some y, for arrays of one shape.
        mode: Which of the inverse solutions.
    """
    travel = constraints.travel
    start, step = _choose_of_grid(geometry, grid, travel, mode)

    def choose(widest: Rectangle) -> tuple[float, Rectangle]:
        return _choose_part(geometry, travel, widest, mode)

    best = refine_rectangle(start, free, step, choose)
    (x0, z0), (x1, z1) = best.low, best.high
    low, high = along_rails(geometry, travel, _measure_span(x0, x1), _measure_span(z0, z1), mode)
    return Cuboid((x0, float(low), z0), (x1, float(high), z1))


def _choose_part(
    geometry: Geometry, travel: float, widest: Rectangle, mode: WorkingMode
) -> tuple[float, Rectangle]:
    """Choose left and right sides: a narrower box may be longer along y. Ever finer grids."""
    (x0, z0), (x1, z1) = widest.low, widest.high
    lower, upper = np.array([x0, x0]), np.array([x1, x1])
    sides = np.array([x0, x1])
    for _ in range(ZOOMS):
        ends = (np.linspace(lower[i], upper[i], SIDES) for i in (0, 1))
        left, right = np.meshgrid(*ends, indexing="ij")
        low, high = along_rails(geometry, travel, (left, right), _measure_span(z0, z1), mode)
        volume = np.maximum(right - left, 0.0) * np.maximum(high - low, 0.0) * (z1 - z0)
        at = int(volume.argmax())
        sides = np.array([left.flat[at], right.flat[at]])
        step = (upper - lower) / (SIDES - 1)
        lower, upper = np.maximum(sides - step, x0), np.minimum(sides + step, x1)
    return float(volume.flat[at]), Rectangle((float(sides[0]), z0), (float(sides[1]), z1))


def make_endless(rectangle: Rectangle) -> Cuboid:
    """Return the box over a rectangle on rails without an end."""
    (x0, z0), (x1, z1) = rectangle.low, rectangle.high
    return Cuboid((x0, -inf, z0), (x1, inf, z1))


def _measure_span(low: float, high: float) -> Span:
    return np.array(low), np.array(high)


def _choose_of_grid(
    geometry: Geometry, grid: Grid, travel: float, mode: WorkingMode
) -> tuple[Rectangle, float]:
    """Look at every rectangle of whole cells of a coarse grid; return the best, and their side."""
    stride = max(-(-max(grid.lines.mask.shape) // CELLS), 1)
    mask: BoolArray = _coarsen(grid.lines.mask, stride)
    if not mask.any():
        stride, mask = 1, grid.lines.mask
    side = stride * grid.step
    edge_x = grid.x[0] - 0.5 * grid.step + side * np.arange(mask.shape[0] + 1)
    edge_z = grid.z[0] - 0.5 * grid.step + side * np.arange(mask.shape[1] + 1)
    count = np.zeros((edge_x.size, edge_z.size), dtype=np.int64)
    count[1:, 1:] = mask.cumsum(axis=0).cumsum(axis=1)
    k0, k1 = np.triu_indices(edge_z.size, 1)
    best, corners = -inf, (0, 1, 0, 1)
    for i0 in range(mask.shape[0]):
        i1 = np.arange(i0 + 1, edge_x.size)[:, None]
        taken = count[i1, k1] - count[i0, k1] - count[i1, k0] + count[i0, k0]
        i, j = np.nonzero(taken == (i1 - i0) * (k1 - k0))
        if not i.size:
            continue
        right, bottom, top = edge_x[i0 + 1 + i], edge_z[k0[j]], edge_z[k1[j]]
        left = np.full(right.shape, edge_x[i0])
        low, high = along_rails(geometry, travel, (left, right), (bottom, top), mode)
        volume = (right - left) * (top - bottom) * (high - low)
        if volume.max() > best:
            at = int(volume.argmax())
            best, corners = float(volume[at]), (i0, i0 + 1 + i[at], k0[j[at]], k1[j[at]])
    x0, x1, z0, z1 = corners
    low_corner, high_corner = (edge_x[x0], edge_z[z0]), (edge_x[x1], edge_z[z1])
    return Rectangle(_make_plain(low_corner), _make_plain(high_corner)), side


def _coarsen(mask: BoolArray, stride: int) -> BoolArray:
    """Return which blocks of ``stride`` by ``stride`` cells are free throughout."""
    nx, nz = (size // stride for size in mask.shape)
    blocks = mask[: nx * stride, : nz * stride].reshape(nx, stride, nz, stride)
    return np.asarray(blocks.all(axis=(1, 3)))


def _make_plain(corner: tuple[FloatArray, FloatArray]) -> tuple[float, float]:
    return float(corner[0]), float(corner[1])
