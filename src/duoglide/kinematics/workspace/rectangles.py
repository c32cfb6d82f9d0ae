"""The largest rectangle of admissible cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import InputError
from duoglide.kinematics.workspace.grid import Grid

Mask: TypeAlias = Callable[[FloatArray, FloatArray], BoolArray]  # of x and z

ROWS = 25  # places along the left and right side at which a refined rectangle is looked at
PLACES = 161  # from the middle to either end of bottom and top
INWARD = 2e-3  # [mm], for what lies between these places
SEARCH = 8.0  # cells by which a side may move
PARTS, ROUNDS = 16, 5  # 16^5 steps from the middle to where a side is sought at the farthest


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle of the xz plane, between low and high corners (x, z) [mm]."""

    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Its sides along x and z [mm]."""
        return self.high[0] - self.low[0], self.high[1] - self.low[1]

    @property
    def area(self) -> float:
        """Its area [mm^2]."""
        return self.size[0] * self.size[1]


Choice: TypeAlias = Callable[[Rectangle], tuple[float, Rectangle]]  # worth, and what is taken


def largest_rectangle(grid: Grid, mask: BoolArray) -> Rectangle:
    """Find the rectangle of largest area whose cells all lie in ``mask``.

    Args:
        grid: The grid.
        mask: Which cells are free, shape (nx, nz).

    Raises:
        InputError: No cell is free.
    """
    if not mask.any():
        raise InputError("no cell of the grid is free; take a finer step or looser constraints")
    depth = np.zeros(mask.shape[1], dtype=np.int64)
    best, corner = 0, (0, 0, 0, 0)
    for i, row in enumerate(mask):
        depth = np.where(row, depth + 1, 0)
        if depth.max() * mask.shape[1] <= best:
            continue
        area, width, start, end = _search_histogram(depth.tolist())
        if area > best:
            best, corner = area, (i - width + 1, i, start, end)
    i0, i1, k0, k1 = corner
    half = 0.5 * grid.step
    return Rectangle(
        (float(grid.x[i0]) - half, float(grid.z[k0]) - half),
        (float(grid.x[i1]) + half, float(grid.z[k1]) + half),
    )


def take_whole(rectangle: Rectangle) -> tuple[float, Rectangle]:
    """Take all of a rectangle for its area."""
    return rectangle.area, rectangle


def refine_rectangle(
    rectangle: Rectangle, free: Mask, step: float, choose: Choice = take_whole
) -> Rectangle:
    """Move the sides of a rectangle to the best place off the grid.

    Bottom and top are optimised by the simplex method; between them it is as wide as is free.

    Args:
        rectangle: Largest rectangle of a grid.
        free: Whether points (x, z) are free, for arrays of one shape.
        step: Side of the grid's cells [mm].
        choose: What to take of the widest rectangle between a bottom and a top, and its worth.
    """
    from scipy.optimize import minimize

    sides = Sides.around(rectangle, free, step)

    def between(bottom: float, top: float) -> tuple[float, Rectangle]:
        left, right = sides.between(bottom, top)
        if left >= right or bottom >= top:
            return 0.0, rectangle
        return choose(Rectangle((left, bottom), (right, top)))

    start = np.array([rectangle.low[1], rectangle.high[1]])
    simplex = start + step * np.array([[0.0, 0.0], [0.5, 0.0], [0.0, -1.0]])
    found = minimize(
        lambda edges: -between(*edges.tolist())[0], start, method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-2, "maxiter": 50},
    )  # fmt: skip
    _, best = between(*found.x.tolist())
    return Rectangle(
        (best.low[0] + INWARD, best.low[1] + INWARD),
        (best.high[0] - INWARD, best.high[1] - INWARD),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """Finds how far a rectangle may reach to the left and to the right.

    Attributes:
        free: Whether points (x, z) are free.
        middle: x inside the rectangle [mm].
        far: x beyond which neither side is sought [mm], shape (2,).
    """

    free: Mask
    middle: float
    far: FloatArray

    @classmethod
    def around(cls, rectangle: Rectangle, free: Mask, step: float) -> Sides:
        """Seek the sides some cells of ``step`` [mm] about those of a rectangle of the grid."""
        sides = np.array([rectangle.low[0], rectangle.high[0]])
        return cls(free, float(sides.mean()), sides + SEARCH * step * np.array([-1.0, 1.0]))

    def between(self, bottom: float, top: float) -> tuple[float, float]:
        """Return the ends of what is free about the middle at every height.

        At several heights, in ever finer steps; then bottom and top are looked at place by place.
        """
        z = np.linspace(bottom, top, ROWS)[:, None, None] * np.ones((2, PARTS + 1))
        inner, outer = np.full((ROWS, 2), self.middle), np.tile(self.far, (ROWS, 1))
        share = np.linspace(0.0, 1.0, PARTS + 1)
        for _ in range(ROUNDS):
            x = inner[..., None] + (outer - inner)[..., None] * share
            taken = ~self.free(x, z)
            taken[..., -1] = True
            first = np.maximum(taken.argmax(axis=-1), 1)[..., None]
            inner = np.take_along_axis(x, first - 1, axis=-1)[..., 0]
            outer = np.take_along_axis(x, first, axis=-1)[..., 0]
        left, right = float(inner[:, 0].max()), float(inner[:, 1].min())
        x, edge = np.meshgrid(np.linspace(self.far[0], self.far[1], 2 * PLACES), [bottom, top])
        taken = ~self.free(x, edge)
        before, after = x[taken & (x < self.middle)], x[taken & (x >= self.middle)]
        return max(left, before.max(initial=-np.inf)), min(right, after.min(initial=np.inf))


def _search_histogram(heights: list[int]) -> tuple[int, int, int, int]:
    """Find the largest rectangle under a histogram, in one pass with a stack of rising bars.

    Returns:
        Area, height, first and last column.
    """
    best = (0, 0, 0, 0)
    stack: list[tuple[int, int]] = []  # first column that the bar reaches back to, height
    for column, height in enumerate([*heights, 0]):
        start = column
        while stack and stack[-1][1] >= height:
            start, tall = stack.pop()
            area = tall * (column - start)
            if area > best[0]:
                best = (area, tall, start, column - 1)
        stack.append((start, height))
    return best
