"""Pictures of paths, plans and runs, for paper and screen; drawn by matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.errors import LogError
from duoglide.viewer.plots_style import COLOURS, LIMIT, WIDTHS, figure_file
from duoglide.viewer.plots_workspace import draw_section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from duoglide.machine import Machine
    from duoglide.motion.checked import CheckedPath
    from duoglide.motion.trajectory import Trajectory
    from duoglide.playback.run_data import RunData

_SAMPLES = 2000
_BEFORE, _AFTER = 5, 20  # cycles of rest that a picture shows


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
    with figure_file((7.0, 5.6), file) as figure:
        rows = figure.subplot_mosaic("aa;bc", height_ratios=(1.0, 1.6), width_ratios=(1.25, 1.0))
        rows["a"].plot(points[:, 1], points[:, 2], color=COLOURS[0])
        rows["a"].plot(*points[[0, -1], 1:].T, ".", color=COLOURS[0], markersize=6.0)
        rows["a"].set_aspect("equal", adjustable="datalim")
        rows["a"].set(title="Along the rails", xlabel="y [mm]", ylabel="z [mm]")
        draw_section(rows["b"], checked.machine, points)
        rows["c"].plot(along, room, color=COLOURS[0])
        rows["c"].axhline(checked.machine.clearance, color=LIMIT, linestyle="--", linewidth=1.0)
        rows["c"].set(title="Clearance [mm]", xlabel="along the path [mm]", ylim=(0.0, None))


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
    with figure_file((7.0, 7.4), file) as figure:
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
    moving = np.flatnonzero(data.on_program)
    if len(moving) == 0:
        raise LogError("a run without a cycle on its program cannot be drawn")
    shown = slice(max(int(moving[0]) - _BEFORE, 0), int(moving[-1]) + _AFTER)
    times = (data.time - data.time[moving[0]])[shown]
    planned = trajectory.at(data.path_time)
    velocity = planned.velocity * np.where(data.on_program, data.rate, 0.0)[:, None] / 1e3
    limits = trajectory.machine.limits.velocity / 1e3
    with figure_file((7.0, 6.0), file) as figure:
        rows = figure.subplots(3, 1, sharex=True)
        _carriages(rows[0], times, data.actual_mm[shown], data.machine)
        _limited(rows[1], times, velocity[shown], limits, "Velocity [m/s]")
        _curves(rows[2], times, data.following_error[shown] * 1e3)
        rows[2].set_title("Tracking error [µm], measured minus the setpoint that was due")
        rows[2].axhline(0.0, color=LIMIT, linewidth=0.7)
        _finish(rows, "time from the start of the program [s]")


def _carriages(axes: Axes, times: FloatArray, values: FloatArray, machine: Machine) -> None:
    _curves(axes, times, values)
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
    _curves(axes, times, values)
    for limit in sorted(set(limits.tolist())):
        for sign in (-1.0, 1.0):
            axes.axhline(sign * limit, color=LIMIT, linestyle="--", linewidth=1.0)
    axes.set_title(title)


def _curves(axes: Axes, times: FloatArray, values: FloatArray) -> None:
    """Draw one curve per carriage."""
    for axis in range(AXES):
        axes.plot(
            times,
            values[:, axis],
            color=COLOURS[axis],
            linewidth=WIDTHS[axis],
            label=f"carriage {axis + 1}",
        )


def _finish(rows: Any, label: str) -> None:
    rows[-1].set_xlabel(label)
    for axes in rows:
        axes.margins(x=0.01, y=0.1)
