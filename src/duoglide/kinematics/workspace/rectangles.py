"""The largest rectangle of admissible cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import InputError
from duoglide.kinematics.workspace.grid import Grid

ROWS = 25  # places along the left and right side at which a refined rectangle is looked at
PLACES = 161  # from the middle to either end of bottom and top
INWARD = 2e-3  # [mm], for what lies between these places
SEARCH = 8.0  # cells by which a side may move
BISECTIONS = 20


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
        area, width, start, end = _under_histogram(depth.tolist())
        if area > best:
            best, corner = area, (i - width + 1, i, start, end)
    i0, i1, k0, k1 = corner
    half = 0.5 * grid.step
    return Rectangle(
        (float(grid.x[i0]) - half, float(grid.z[k0]) - half),
        (float(grid.x[i1]) + half, float(grid.z[k1]) + half),
    )


def refined(
    rectangle: Rectangle, free: Callable[[FloatArray, FloatArray], BoolArray], step: float
) -> Rectangle:
    """Move the sides of a rectangle to the best place off the grid.

    For a bottom and a top the free interval around the middle is found by bisection at several
    heights; bottom and top are then optimised by the simplex method.

    Args:
        rectangle: Largest rectangle of a grid.
        free: Whether points (x, z) are free, for arrays of one shape.
        step: Side of the grid's cells [mm].
    """
    from scipy.optimize import minimize

    margin = np.array([-SEARCH * step, SEARCH * step])
    middle = 0.5 * (rectangle.low[0] + rectangle.high[0])
    far = np.array([rectangle.low[0], rectangle.high[0]]) + margin

    def sides(bottom: float, top: float) -> FloatArray:
        z = np.linspace(bottom, top, ROWS)[:, None] * np.ones(2)
        x, y = np.meshgrid(np.linspace(middle, far[0], PLACES), [bottom, top])
        x2, _ = np.meshgrid(np.linspace(middle, far[1], PLACES), [bottom, top])
        inner, outer = np.full(z.shape, middle), np.broadcast_to(far, z.shape)
        for _ in range(BISECTIONS):
            centre = 0.5 * (inner + outer)
            inside = free(centre, z)
            inner, outer = np.where(inside, centre, inner), np.where(inside, outer, centre)
        ends = np.array([inner[:, 0].max(), inner[:, 1].min()])
        holes = [(x[~free(x, y)], ends[0], -1.0), (x2[~free(x2, y)], ends[1], 1.0)]
        for k, (taken, end, sign) in enumerate(holes):  # on the bottom or the top, short of the end
            before = taken[sign * taken < sign * end]
            if before.size:
                ends[k] = sign * (sign * before).min()
        return ends

    def loss(edges: FloatArray) -> float:
        left, right = sides(*edges)
        return -float((right - left) * (edges[1] - edges[0]))

    start = np.array([rectangle.low[1], rectangle.high[1]])
    simplex = start + step * np.array([[0.0, 0.0], [0.5, 0.0], [0.0, -1.0]])
    found = minimize(
        loss, start, method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-2, "maxiter": 50},
    )  # fmt: skip
    left, right = sides(*found.x)
    return Rectangle(
        (float(left) + INWARD, float(found.x[0]) + INWARD),
        (float(right) - INWARD, float(found.x[1]) - INWARD),
    )


def _under_histogram(heights: list[int]) -> tuple[int, int, int, int]:
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
