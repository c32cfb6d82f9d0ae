"""A picture of a run: what was streamed and measured, over time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.drawing.over_time import draw_carriages, draw_curves, draw_limited, finish
from duoglide.drawing.picture import CURVE, LIMIT, Picture, drawn
from duoglide.errors import LogError
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.headroom.room import locate
from duoglide.machine import Machine
from duoglide.planning.trajectory import Trajectory
from duoglide.playback.run_data import RunData

_BEFORE, _AFTER = 5, 20  # cycles of rest that a picture shows
_MOST = 20_000  # points of a smooth curve, however long the run


def plot_run(data: RunData, plans: Mapping[int, Trajectory]) -> Picture:
    """Draw a run: carriages, their velocities with the limits, tracking error, what is left.

    Args:
        data: What was streamed and measured.
        plans: What was meant, by the part of a program; part 0 of any other run.

    Raises:
        LogError: The run has no cycle on its plan.
    """
    moving = np.flatnonzero(data.on_plan)
    if len(moving) == 0:
        raise LogError("a run without a cycle on its plan cannot be drawn")
    first, last = max(int(moving[0]) - _BEFORE, 0), int(moving[-1]) + _AFTER
    shown, some = slice(first, last), slice(first, last, (last - first) // _MOST + 1)
    times = data.time - data.time[moving[0]]
    rate = np.where(data.on_plan, data.rate, 0.0)[some, None]
    velocity = np.zeros((len(rate), AXES))
    for part, plan in plans.items():
        its = data.part[some] == part
        whole = plan.whole or plan
        velocity[its] = whole.at(data.path_time[some][its]).velocity * rate[its] / 1e3
    limits = data.machine.limits.velocity / 1e3
    measured = data.measured_mm[some]
    with drawn((7.0, 7.4)) as figure:
        rows = figure.subplots(4, 1, sharex=True)
        draw_carriages(rows[0], times[some], measured, data.machine)
        if np.isnan(measured).any():
            rows[0].set_title("Carriages [mm]; gaps: no answer in time")
        draw_limited(rows[1], times[some], velocity, limits, "Velocity [m/s]")
        draw_curves(rows[2], times[shown], data.following_error[shown] * 1e3)  # every worst one
        rows[2].set_title("Tracking error [µm], measured minus the setpoint that was due")
        rows[2].axhline(0.0, color=LIMIT, linewidth=0.7)
        rows[3].plot(times[some], _carriage_margin(data.machine, measured), color=CURVE)
        rows[3].axhline(data.machine.carriage_margin, color=LIMIT, linestyle="--", linewidth=1.0)
        rows[3].set_title("Carriage margin [mm] where the carriages were, and what is needed")
        rows[3].set_ylim(bottom=0.0)
        finish(rows, "time from the start of the plan [s]")
    return figure


def _carriage_margin(machine: Machine, carriages: FloatArray) -> FloatArray:
    """Return the margin at carriages (n, 3) [mm]: 0 out of reach, NaN without an answer."""
    position, closed = locate(machine, carriages)
    margin = np.where(np.isnan(carriages).any(axis=-1), np.nan, 0.0)
    margin[closed] = carriage_margin(machine.geometry, position[closed])
    return margin
