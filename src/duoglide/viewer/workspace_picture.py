"""One picture of a machine's workspace: its cross-section with room and surfaces, and along y."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import ConfigError
from duoglide.kinematics.singularity import clearance
from duoglide.kinematics.workspace import Section, WorkspaceReport, analyse, section
from duoglide.machine import Machine
from duoglide.viewer.figures.surfaces import COLOURS, within_reach, workspace_curves

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLE = {"font.size": 8.0, "axes.linewidth": 0.6, "axes.titlelocation": "left", "savefig.dpi": 200}
_BOX, _DEEP = "#222222", "#cc0050"


def write_workspace(machine: Machine, file: str | Path, step: float = 1.0) -> WorkspaceReport:
    """Draw the workspace of ``machine`` and return its figures.

    Args:
        machine: The machine; its travel, carriage width and clearance count.
        file: Where to; the suffix says how (png, pdf, svg).
        step: Side of a grid cell [mm].

    Raises:
        ConfigError: Nothing is admissible, or the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    report = analyse(machine, step=step)
    exact = section(machine.geometry)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(8.4, 4.2), layout="constrained")
        FigureCanvasAgg(figure)
        across, along = figure.subplots(1, 2, width_ratios=(1.25, 1.0))
        _across(across, machine, report, exact)
        _along(along, report)
        figure.legend(fontsize=6.5, frameon=False, loc="outside lower center", ncols=6)
        figure.suptitle(describe(report), fontsize=8.0, x=0.01, ha="left")
        try:
            figure.savefig(file)
        except (OSError, ValueError) as error:  # ValueError: a suffix that matplotlib cannot write
            raise ConfigError(f"cannot write the workspace to {file}: {error}") from error
    return report


def describe(report: WorkspaceReport) -> str:
    """Say the figures of a workspace in two lines."""
    box = report.largest_box
    x, _, z = report.deepest
    return (
        f"volume {report.volume * 1e-6:.2f} l, cross-section {report.area * 1e-2:.1f} cm²,"
        f" {report.constraints.clearance:g} mm clear of every singularity;"
        f" largest free box {box.size[0]:.0f} x {box.size[1]:.0f} mm\n"
        f"deepest point ({x:.0f}, {z:.0f}), {report.depth:.1f} mm from any edge;"
        f" best inverse condition {report.inverse_condition:.3f} at"
        f" ({report.best_conditioned[0]:.0f}, {report.best_conditioned[2]:.0f})"
    )


def _across(axes: Axes, machine: Machine, report: WorkspaceReport, exact: Section) -> None:
    """Draw the cross-section: room, surfaces, largest box and deepest point."""
    grid = report.grid
    room = np.full(grid.lines.mask.shape, np.nan)
    i, k = np.nonzero(grid.lines.mask)
    poses = np.stack([grid.x[i], np.zeros(len(i)), grid.z[k]], axis=-1)
    room[i, k] = clearance(machine.geometry, poses)
    shown = axes.pcolormesh(grid.x, grid.z, room.T, cmap="Greens", shading="nearest", vmin=0.0)
    shown.set_rasterized(True)
    axes.figure.colorbar(shown, ax=axes, label="clearance [mm]", shrink=0.85, pad=0.02)
    named: set[str] = set()
    for curve in workspace_curves(machine.geometry, v=1):
        for line in within_reach(machine.geometry, curve):
            label = None if curve.family in named else curve.family
            named.add(curve.family)
            axes.plot(*line.T, color=COLOURS[curve.family], lw=1.5, label=label)
    for _, line in exact.outline():
        axes.plot(*line.T, color=_BOX, lw=0.5)
    axes.plot(*_corners(report), color=_BOX, lw=1.0, ls=(0, (4, 2)), label="largest box")
    axes.plot(report.deepest[0], report.deepest[2], "+", color=_DEEP, label="deepest point")
    lowest = min(float(line[:, 1].min()) for _, line in exact.outline())
    axes.set(title="across the rails", xlabel="x [mm]", ylabel="z [mm]")
    axes.set_xlim(grid.x[0] - 15.0, grid.x[-1] + 15.0)
    axes.set_ylim(lowest - 15.0, grid.z[-1] + 15.0)
    axes.set_aspect("equal")


def _corners(report: WorkspaceReport) -> FloatArray:
    """Return the outline of the largest box, shape (2, 5)."""
    (x0, z0), (x1, z1) = report.largest_box.low, report.largest_box.high
    return np.array([[x0, x1, x1, x0, x0], [z0, z0, z1, z1, z0]])


def _along(axes: Axes, report: WorkspaceReport) -> None:
    """Draw how far the platform can go along the rails, at each height."""
    grid = report.grid
    low, high = grid.lines.low, grid.lines.high
    y = np.linspace(report.low[1], report.high[1], 241)
    share = np.array([((low <= at) & (at <= high)).sum(axis=0) for at in y.tolist()])
    width = np.where(share > 0, share * grid.step, np.nan)
    shown = axes.pcolormesh(y, grid.z, width.T, cmap="Blues", shading="nearest", vmin=0.0)
    shown.set_rasterized(True)
    axes.figure.colorbar(shown, ax=axes, label="width in x [mm]", shrink=0.85, pad=0.02)
    axes.set(title="along the rails", xlabel="y [mm]", ylabel="z [mm]")
    axes.set_aspect("equal")
