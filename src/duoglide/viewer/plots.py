"""Pictures of paths, plans and runs, for paper and screen; drawn by matplotlib."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.errors import LogError
from duoglide.storage.atomic import appearing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from duoglide.machine import Machine
    from duoglide.motion.checked import CheckedPath
    from duoglide.motion.trajectory import Trajectory
    from duoglide.playback.run_data import RunData

COLOURS = ("#0072b2", "#d55e00", "#009e73")  # carriages 1 to 3, told apart by everybody
LIMIT = "#7f7f7f"
_SAMPLES = 2000
_STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.size": 8.5,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}


def draw_path(checked: CheckedPath, file: str | Path) -> None:
    """Draw a checked path: along the rails, across them among the clearances, and along its way.

    Args:
        checked: What to draw.
        file: Where to; the suffix says how (png, pdf, svg).

    Raises:
        LogError: The file cannot be written.
    """
    from duoglide.kinematics.singularity import clearance

    sigma = np.linspace(0.0, checked.curve.end, _SAMPLES)
    points = checked.curve.derivatives(sigma)[:, 0]
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    room = clearance(checked.machine.geometry, points)
    with _figure((7.0, 5.6), file) as figure:
        rows = figure.subplot_mosaic("aa;bc", height_ratios=(1.0, 1.6), width_ratios=(1.25, 1.0))
        rows["a"].plot(points[:, 1], points[:, 2], color=COLOURS[0])
        rows["a"].plot(*points[[0, -1], 1:].T, ".", color=COLOURS[0], markersize=6.0)
        rows["a"].set_aspect("equal", adjustable="datalim")
        rows["a"].set(title="Along the rails", xlabel="y [mm]", ylabel="z [mm]")
        _section(rows["b"], checked.machine, points)
        rows["c"].plot(along, room, color=COLOURS[0])
        rows["c"].axhline(checked.machine.clearance, color=LIMIT, linestyle="--", linewidth=1.0)
        rows["c"].set(title="Clearance [mm]", xlabel="along the path [mm]", ylim=(0.0, None))


def _section(axes: Axes, machine: Machine, points: FloatArray) -> None:
    """Draw the path across the rails over the clearance there, which does not depend on y."""
    from duoglide.kinematics.model import reachable
    from duoglide.kinematics.singularity import clearance

    geometry = machine.geometry
    wide = geometry.arm_length + geometry.platform_half_width + geometry.rail_half_spacing
    x = np.linspace(points[:, 0].min() - wide, points[:, 0].max() + wide, 181)
    high = geometry.carriage_height + geometry.strut_length + geometry.strut_drop
    z = np.linspace(0.0, max(high * 1.05, points[:, 2].max() + 10.0), 161)
    grid = np.stack(np.broadcast_arrays(x[None, :], points[0, 1], z[:, None]), axis=-1)
    within = reachable(geometry, grid)
    room = np.full(within.shape, np.nan)
    room[within] = clearance(geometry, grid[within])
    shown = np.where(room >= machine.clearance, room, np.nan)
    drawn = axes.contourf(x, z, shown, levels=12, cmap="Greys", alpha=0.8, antialiased=False)
    axes.figure.colorbar(drawn, ax=axes, label="clearance [mm]")
    axes.plot(points[:, 0], points[:, 2], color=COLOURS[1], linewidth=2.0)
    axes.plot(*points[[0, -1]][:, ::2].T, ".", color=COLOURS[1], markersize=6.0)
    columns, lines = np.flatnonzero(within.any(axis=0)), np.flatnonzero(within.any(axis=1))
    axes.set(xlim=x[columns[[0, -1]]], ylim=z[lines[[0, -1]]])
    axes.set_aspect("equal", adjustable="box")
    axes.set(title="Across the rails", xlabel="x [mm]", ylabel="z [mm]")
    axes.grid(visible=False)


def draw_plan(trajectory: Trajectory, file: str | Path) -> None:
    """Draw a plan: the carriages and their three derivatives, with the limits.

    Args:
        trajectory: What to draw.
        file: Where to; the suffix says how (png, pdf, svg).

    Raises:
        LogError: The file cannot be written.
    """
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    state = trajectory.at(times)
    limits = trajectory.machine.limits
    with _figure((7.0, 7.4), file) as figure:
        rows = figure.subplots(4, 1, sharex=True)
        _carriages(rows[0], times, state.carriages, trajectory.machine)
        for axes, values, limit, title, scale, unit in (
            (rows[1], state.velocity, limits.velocity, "Velocity", 1e3, "m/s"),
            (rows[2], state.acceleration, limits.acceleration, "Acceleration", 1e3, "m/s²"),
            (rows[3], state.jerk, limits.jerk, "Jerk", 1e3, "m/s³"),
        ):
            _limited(axes, times, values / scale, limit / scale, f"{title} [{unit}]")
        _finish(rows, "time [s]")


def draw_run(data: RunData, trajectory: Trajectory, file: str | Path) -> None:
    """Draw a run: carriages, their velocities with the limits, and the tracking error.

    Args:
        data: What was streamed and measured.
        trajectory: What was meant.
        file: Where to; the suffix says how (png, pdf, svg).

    Raises:
        LogError: The run has no cycles, or the file cannot be written.
    """
    if len(data) == 0:
        raise LogError("a run without cycles cannot be drawn")
    moving = np.flatnonzero(data.on_program)
    first = int(moving[0]) if len(moving) else 0
    times = data.time - data.time[first]
    planned = trajectory.at(data.path_time)
    velocity = planned.velocity * np.where(data.on_program, data.rate, 0.0)[:, None] / 1e3
    limits = trajectory.machine.limits.velocity / 1e3
    with _figure((7.0, 6.0), file) as figure:
        rows = figure.subplots(3, 1, sharex=True)
        _carriages(rows[0], times, data.actual_mm, data.machine)
        _limited(rows[1], times, velocity, limits, "Velocity [m/s]")
        error = data.following_error * 1e3
        for axis in range(AXES):
            rows[2].plot(times, error[:, axis], color=COLOURS[axis], linewidth=1.0)
        rows[2].set_title("Tracking error [µm], measured minus the setpoint that was due")
        rows[2].axhline(0.0, color=LIMIT, linewidth=0.7)
        _finish(rows, "time from the start of the program [s]")


def _carriages(axes: Axes, times: FloatArray, values: FloatArray, machine: Machine) -> None:
    for axis in range(AXES):
        axes.plot(times, values[:, axis], color=COLOURS[axis], label=f"carriage {axis + 1}")
    travel = machine.geometry.rail_half_length
    for end in (-travel, travel):
        axes.axhline(end, color=LIMIT, linestyle="--", linewidth=1.0)
    axes.set_title("Carriages [mm]")
    axes.plot([], [], color=LIMIT, linestyle="--", linewidth=1.0, label="limit")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, borderaxespad=0.1)


def _limited(
    axes: Axes, times: FloatArray, values: FloatArray, limits: FloatArray, title: str
) -> None:
    """Draw three curves and the limits that they keep."""
    for axis in range(AXES):
        axes.plot(times, values[:, axis], color=COLOURS[axis])
    for limit in sorted(set(limits.tolist())):
        for sign in (-1.0, 1.0):
            axes.axhline(sign * limit, color=LIMIT, linestyle="--", linewidth=1.0)
    axes.set_title(title)


def _finish(rows: Any, label: str) -> None:
    rows[-1].set_xlabel(label)
    for axes in rows:
        axes.margins(x=0.01, y=0.1)


@contextmanager
def _figure(size: tuple[float, float], file: str | Path) -> Iterator[Figure]:
    """Give an empty figure, and save it when it is drawn; no window, no global state."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=size)
        FigureCanvasAgg(figure)
        yield figure
        suffix = Path(file).suffix.removeprefix(".")
        known = figure.canvas.get_supported_filetypes()
        if suffix not in known:
            raise LogError(f"{file}: a picture must end in one of .{', .'.join(sorted(known))}")
        with appearing(file) as temporary:
            figure.savefig(temporary)
