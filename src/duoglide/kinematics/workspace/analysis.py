"""The figures of a workspace in one report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import TypeAlias

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import ConfigError
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.singularity.margins import clearance
from duoglide.kinematics.transmission import transmission
from duoglide.kinematics.workspace.columns import columns
from duoglide.kinematics.workspace.constraints import Constraints
from duoglide.kinematics.workspace.cuboids import Cuboid, largest_cuboid, make_endless
from duoglide.kinematics.workspace.grid import Grid, grid_over_reach
from duoglide.kinematics.workspace.rectangles import (
    Rectangle,
    largest_rectangle,
    refine_rectangle,
)
from duoglide.kinematics.workspace.section import section
from duoglide.machine import Geometry, Machine

Measure: TypeAlias = Callable[[FloatArray], FloatArray]

COARSE = 4.0  # [mm], of the searches that are refined afterwards
REFINEMENTS = 12


@dataclass(frozen=True, slots=True, eq=False)
class WorkspaceReport:
    """What Section 4 of [Shen2021]_ asks about.

    Attributes:
        constraints: What limits the workspace.
        grid: The admissible cells, for pictures.
        area: Area of the cross-section in the xz plane, from the grid [mm^2]; of finite rails, of
            all poses together.
        exact_area: Area of the cross-section from arcs and quartic, links and carriage width alone
            [mm^2].
        volume: Volume of the admissible poses [mm^3]; infinite on unlimited rails.
        low: Corner of the bounding box with the smallest coordinates [mm], shape (3,).
        high: Corner with the largest [mm].
        largest_box: The largest free rectangle of the cross-section.
        largest_cuboid: The largest box, extent along y included; on unlimited rails that over
            ``largest_box``.
        deepest: Position farthest from every surface and edge, y = 0 [mm], shape (3,).
        depth: Its clearance [mm].
        best_conditioned: Position with the best conditioned Jacobian, y = 0 [mm], shape (3,).
        inverse_condition: Inverse of its condition number.
    """

    constraints: Constraints
    grid: Grid
    area: float
    exact_area: float
    volume: float
    low: FloatArray
    high: FloatArray
    largest_box: Rectangle
    largest_cuboid: Cuboid
    deepest: FloatArray
    depth: float
    best_conditioned: FloatArray
    inverse_condition: float

    @property
    def litres_per_metre(self) -> float:
        """Volume per metre of travel along y, on unlimited rails [l/m]."""
        return self.area * 1e-3


def analyse(
    machine: Machine | Geometry,
    constraints: Constraints | None = None,
    step: float = 1.0,
    mode: WorkingMode = WORKING,
) -> WorkspaceReport:
    """Determine the workspace.

    Args:
        machine: A machine, or a geometry alone.
        constraints: What limits the workspace. None: what the machine's file says; of a geometry
            alone, the links.
        step: Side of a grid cell [mm].
        mode: Which of the inverse solutions.

    Raises:
        ConfigError: Nothing is admissible.
        InputError: The step is not above zero.
    """
    geometry = machine.geometry if isinstance(machine, Machine) else machine
    if constraints is None:
        constraints = Constraints.of(machine) if isinstance(machine, Machine) else Constraints()
    grid = grid_over_reach(geometry, constraints, step, mode)
    free = grid.lines.mask
    if not free.any():
        raise ConfigError(f"no pose on a grid of {step:g} mm satisfies {constraints}")
    low, high = _find_bounding_box(grid, free)

    def is_free(x: FloatArray, z: FloatArray) -> BoolArray:
        return columns(geometry, x, z, constraints, mode).mask

    def depth(poses: FloatArray) -> FloatArray:
        return clearance(geometry, poses, mode)

    def conditioning(poses: FloatArray) -> FloatArray:
        return 1.0 / transmission(geometry, poses, mode).condition_number

    deepest, most = _maximise(grid, free, depth)
    best, condition = _maximise(grid, free, conditioning)
    rectangle = refine_rectangle(largest_rectangle(grid, free), is_free, step)
    cuboid = make_endless(rectangle)
    if constraints.travel < inf:
        cuboid = largest_cuboid(geometry, grid, constraints, is_free, mode)
    exact = Constraints(
        carriage_width=constraints.carriage_width, beyond_case_2=constraints.beyond_case_2
    )
    return WorkspaceReport(
        constraints=constraints,
        grid=grid,
        area=grid.area,
        exact_area=section(geometry, exact, 0.0, mode).area,
        volume=grid.volume,
        low=low,
        high=high,
        largest_box=rectangle,
        largest_cuboid=cuboid,
        deepest=deepest,
        depth=most,
        best_conditioned=best,
        inverse_condition=condition,
    )


def _find_bounding_box(grid: Grid, free: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the corners of the box around the admissible cells."""
    half = 0.5 * grid.step
    along_x, along_z = grid.x[free.any(axis=1)], grid.z[free.any(axis=0)]
    y_low, y_high = grid.lines.low[free].min(), grid.lines.high[free].max()
    return (
        np.array([along_x[0] - half, y_low, along_z[0] - half]),
        np.array([along_x[-1] + half, y_high, along_z[-1] + half]),
    )


def _maximise(grid: Grid, free: BoolArray, measure: Measure) -> tuple[FloatArray, float]:
    """Maximise a quantity of the xz plane: a coarse look, then ever smaller neighbourhoods."""
    stride = max(int(COARSE / grid.step), 1)
    i, k = np.nonzero(free[::stride, ::stride])
    if not len(i):
        stride = 1
        i, k = np.nonzero(free)
    inner = np.stack([grid.x[::stride][i], np.zeros(len(i)), grid.z[::stride][k]], axis=-1)
    values = measure(inner)
    best, value = inner[values.argmax()], float(values.max())
    offsets = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [0.0], [-1.0, 0.0, 1.0]), -1).reshape(-1, 3)
    reach = stride * grid.step
    for _ in range(REFINEMENTS):
        around = best + reach * offsets
        around = around[_lie_in_free_cells(grid, free, around)]
        values = measure(around)
        if values.max(initial=-np.inf) > value:
            best, value = around[values.argmax()], float(values.max())
        else:
            reach /= 2.0
    return best, value


def _lie_in_free_cells(grid: Grid, free: BoolArray, poses: FloatArray) -> BoolArray:
    """Whether poses lie in admissible cells whose neighbours are admissible too."""
    i = np.round((poses[:, 0] - grid.x[0]) / grid.step).astype(int)
    k = np.round((poses[:, 2] - grid.z[0]) / grid.step).astype(int)
    inside: BoolArray = (i > 0) & (k > 0) & (i < len(grid.x) - 1) & (k < len(grid.z) - 1)
    i, k = np.clip(i, 1, len(grid.x) - 2), np.clip(k, 1, len(grid.z) - 2)
    for di in (-1, 0, 1):
        for dk in (-1, 0, 1):
            inside &= free[i + di, k + dk]
    return inside
