"""One picture of a machine's workspace: its cross-section with room and surfaces, and along y."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from duoglide.arrays import FloatArray
from duoglide.drawing.picture import Picture, drawn
from duoglide.drawing.section import OUTLINE, ROOM, draw_section
from duoglide.kinematics.workspace import WorkspaceReport
from duoglide.machine import Machine
from duoglide.paper.figures.surfaces import COLOURS, within_reach, workspace_curves

_DEEP = "#cc0050"


def plot_workspace(machine: Machine, report: WorkspaceReport) -> Picture:
    """Draw the workspace of ``machine``.

    Args:
        machine: The machine.
        report: The figures of its workspace.
    """
    with drawn((8.4, 4.2)) as figure:
        across, along = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        _draw_across(across, machine, report)
        _draw_along(along, report)
        figure.legend(fontsize=7.5, loc="outside lower center", ncols=4)
        figure.suptitle(describe(report), fontsize=8.0, x=0.01, ha="left")
    return figure


def describe(report: WorkspaceReport) -> str:
    """Say the figures of a workspace in two lines."""
    box = report.largest_box
    x, _, z = report.deepest
    return (
        f"volume {report.volume * 1e-6:.2f} l, cross-section {report.area * 1e-2:.1f} cm²,"
        f" {report.constraints.clearance:g} mm clear of every singularity;"
        f" largest free box {box.size[0]:.0f} x {box.size[1]:.0f} mm\n"
        f"deepest point ({x:.0f}, {z:.0f}) mm, {report.depth:.1f} mm from any edge;"
        f" best inverse condition {report.inverse_condition:.3f} at"
        f" ({report.best_conditioned[0]:.0f}, {report.best_conditioned[2]:.0f}) mm"
    )


def _draw_across(axes: Axes, machine: Machine, report: WorkspaceReport) -> None:
    """Draw the cross-section: room, surfaces, largest box and deepest point."""
    draw_section(axes, machine, report.deepest)
    limits = axes.get_xlim(), axes.get_ylim()
    named: set[str] = set()
    for curve in workspace_curves(machine.geometry, v=1):
        for line in within_reach(machine.geometry, curve):
            label = None if curve.family in named else curve.family
            named.add(curve.family)
            axes.plot(*line.T, color=COLOURS[curve.family], linewidth=1.5, label=label)
    dashes = (0, (4, 2))
    axes.plot(*_corners(report), color=OUTLINE, lw=1.0, ls=dashes, label="largest free box")
    axes.plot(report.deepest[0], report.deepest[2], "+", color=_DEEP, label="deepest point")
    axes.set(xlim=limits[0], ylim=limits[1])


def _corners(report: WorkspaceReport) -> FloatArray:
    """Return the outline of the largest box, shape (2, 5)."""
    (x0, z0), (x1, z1) = report.largest_box.low, report.largest_box.high
    return np.array([[x0, x1, x1, x0, x0], [z0, z0, z1, z1, z0]])


def _draw_along(axes: Axes, report: WorkspaceReport) -> None:
    """Draw how far the platform can go along the rails, at each height."""
    grid = report.grid
    low, high = grid.lines.low, grid.lines.high
    y = np.linspace(report.low[1], report.high[1], 241)
    share = np.array([((low <= at) & (at <= high)).sum(axis=0) for at in y.tolist()])
    width = np.where(share > 0, share * grid.step, np.nan)
    shown = axes.pcolormesh(y, grid.z, width.T, cmap=ROOM, shading="nearest", vmin=0.0)
    shown.set_rasterized(True)
    axes.figure.colorbar(shown, ax=axes, label="width in x [mm]", shrink=0.85, pad=0.02)
    axes.set(title="From the side", xlabel="y [mm]", ylabel="z [mm]")
    axes.set_aspect("equal")
    axes.grid(visible=False)
