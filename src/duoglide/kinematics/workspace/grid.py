"""A regular grid over the reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import InputError
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.workspace.columns import Columns, columns
from duoglide.kinematics.workspace.constraints import Constraints
from duoglide.machine import Geometry

BLOCK = 32  # rows of the grid


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Cells of the xz plane, evaluated at their centres.

    Attributes:
        x: Centres along x [mm], shape (nx,).
        z: Centres along z [mm], shape (nz,).
        step: Side of a cell [mm].
        lines: What is admissible on the lines along y, arrays of shape (nx, nz).
    """

    x: FloatArray
    z: FloatArray
    step: float
    lines: Columns

    @property
    def area(self) -> float:
        """Area of the admissible cells [mm^2]."""
        return float(self.lines.mask.sum()) * self.step**2

    @property
    def volume(self) -> float:
        """Volume of the admissible poses [mm^3]; infinite on unlimited rails."""
        return float(self.lines.length.sum()) * self.step**2


def grid_over_reach(
    geometry: Geometry,
    constraints: Constraints,
    step: float,
    mode: WorkingMode = WORKING,
) -> Grid:
    """Evaluate a grid over a rectangle that holds everything arm, legs and strut reach.

    Args:
        geometry: Dimensions of the robot.
        constraints: What limits the workspace.
        step: Side of a cell [mm].
        mode: Which of the inverse solutions.

    Raises:
        InputError: The step is not above zero.
    """
    if not step > 0.0:
        raise InputError(f"step = {step}: must be above 0 [mm]")
    g = geometry
    cx, base, xb, zb, *_ = Plane.of(g)
    x = _place_centres(
        max(cx - g.arm_length, xb - g.strut_length),
        min(cx + g.arm_length, xb + g.strut_length),
        step,
    )
    lowest, highest = sorted((base, base + mode.v * g.arm_length))
    z = _place_centres(
        max(lowest, zb - g.strut_length),
        min(highest + g.leg_length, zb + g.strut_length),
        step,
    )
    low, high = np.empty((2, x.size, z.size))
    for start in range(0, x.size, BLOCK):  # a few rows at a time stay in the cache
        rows = slice(start, start + BLOCK)
        mesh = np.meshgrid(x[rows], z, indexing="ij")
        lines = columns(g, mesh[0], mesh[1], constraints, mode)
        low[rows], high[rows] = lines.low, lines.high
    return Grid(x, z, step, Columns(low, high))


def count_poses(grid: Grid, y: FloatArray) -> int:
    """Count the admissible poses of the grid times ``y`` [mm], shape (n,), one by one."""
    low, high = grid.lines.low, grid.lines.high
    return sum(int(np.count_nonzero((low <= at) & (at <= high))) for at in y)


def _place_centres(low: float, high: float, step: float) -> FloatArray:
    """Return centres of cells of ``step`` that cover the interval, symmetric about its middle."""
    count = max(int(np.ceil((high - low) / step)), 1)
    middle = 0.5 * (low + high)
    return middle + step * (np.arange(count, dtype=np.float64) - 0.5 * (count - 1))
