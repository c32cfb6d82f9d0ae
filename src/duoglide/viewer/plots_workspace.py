"""The workspace across the rails, which looks the same all along y, as far as the rails go."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray
from duoglide.kinematics.model import reachable
from duoglide.kinematics.singularity import clearance
from duoglide.viewer.plots_style import COLOURS, figure_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from duoglide.kinematics.workspace import WorkspaceReport
    from duoglide.machine import Machine

_CELLS = 180


def draw_section(axes: Axes, machine: Machine, points: ArrayLike = ()) -> None:
    """Draw the clearance across the rails, and a path on it.

    Args:
        axes: Where to.
        machine: Whose; what is nearer to a singular surface than its clearance is left white.
        points: Positions of the platform [mm], shape (n, 3); none, if there is no path.
    """
    path = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    x, z, room = _field(machine, path)
    drawn = axes.contourf(x, z, room, levels=12, cmap="Greys", alpha=0.8, antialiased=False)
    axes.figure.colorbar(drawn, ax=axes, label="clearance [mm]")
    if len(path):
        axes.plot(path[:, 0], path[:, 2], color=COLOURS[1], linewidth=2.0)
        axes.plot(*path[[0, -1]][:, ::2].T, ".", color=COLOURS[1], markersize=6.0)
    shown = np.isfinite(room)
    columns, lines = np.flatnonzero(shown.any(axis=0)), np.flatnonzero(shown.any(axis=1))
    axes.set(xlim=x[columns[[0, -1]]], ylim=z[lines[[0, -1]]])
    axes.set_aspect("equal", adjustable="box")
    axes.set(title="Across the rails", xlabel="x [mm]", ylabel="z [mm]")
    axes.grid(visible=False)


def draw_workspace(machine: Machine, report: WorkspaceReport, file: str | Path) -> None:
    """Draw the cross-section of the workspace, its deepest point and its largest free rectangle.

    Args:
        machine: Whose.
        report: Its figures.
        file: Where to; the suffix says how (png, pdf, svg).

    Raises:
        LogError: The file cannot be written.
    """
    box = report.largest_box
    with figure_file((5.6, 5.0), file) as figure:
        axes = figure.subplots()
        draw_section(axes, machine)
        (left, low), (right, high) = box.low, box.high
        wide, tall = box.size
        axes.plot(
            [left, right, right, left, left],
            [low, low, high, high, low],
            color=COLOURS[0],
            label=f"largest box, {wide:.0f} by {tall:.0f} mm",
        )
        x, _, z = report.deepest
        label = f"deepest, {report.depth:.1f} mm from any edge"
        axes.plot(x, z, "o", color=COLOURS[1], label=label)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.06), ncols=2)


def _field(machine: Machine, path: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x, z and the clearance over them, NaN where it is less than the machine's."""
    g = machine.geometry
    wide = g.arm_length + g.platform_half_width + g.rail_half_spacing
    high = g.carriage_height + g.strut_length + g.strut_drop
    x = np.linspace(min([-wide, *path[:, 0]]), max([wide, *path[:, 0]]), _CELLS + 1)
    z = np.linspace(min([0.0, *path[:, 2]]), max([1.05 * high, *path[:, 2]]), _CELLS + 1)
    y = path[0, 1] if len(path) else 0.0
    grid = np.stack(np.broadcast_arrays(x[None, :], y, z[:, None]), axis=-1)
    within = reachable(g, grid)
    room = np.full(within.shape, np.nan)
    room[within] = clearance(g, grid[within])
    room[room < machine.clearance] = np.nan
    return x, z, room
