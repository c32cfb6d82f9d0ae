"""The picture of a motion, the carriages and their derivatives, and its notebook table."""

from __future__ import annotations

from math import isnan

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.drawing.notebook import notebook_html
from duoglide.drawing.over_time import draw_carriages, draw_limited, finish
from duoglide.drawing.picture import Picture, drawn
from duoglide.motion.forces import motion_forces
from duoglide.motion.motion import Motion
from duoglide.motion.path.segments import show
from duoglide.motion.timing_report import TimingReport

_SAMPLES = 2000


def plot_motion(motion: Motion) -> Picture:
    """Draw ``motion``: see ``Trajectory.plot``."""
    times = np.linspace(0.0, motion.duration, _SAMPLES)
    state = motion.at(times)
    with drawn((7.0, 9.2)) as figure:
        rows = figure.subplots(5, 1, sharex=True)
        draw_carriages(rows[0], times, state.carriages, motion.machine)
        for axes, (title, unit, values, limits) in zip(
            rows[1:], _list_rates(motion, times), strict=True
        ):
            draw_limited(axes, times, values, limits, f"{title} [{unit}]")
        finish(rows, "time [s]")
    return figure


def show_motion(motion: Motion, actions: int) -> str:
    """Return what a notebook shows of a motion with so many actions on its way."""
    times = np.linspace(0.0, motion.duration, _SAMPLES)
    start, end = motion.position_at([0.0, motion.duration])
    report = motion.report
    head = [
        ("duration", f"{motion.duration:.4f} s"),
        ("length", f"{float(motion.path.length):.1f} mm"),
        ("from", f"{show(start.round(3))} mm"),
        ("to", f"{show(end.round(3))} mm"),
        ("timing", " because ".join(filter(None, (report.method.value, report.reason)))),
        ("brake-safe", _describe_safety(report)),
        ("actions", f"{actions}"),
    ]
    peaks: list[tuple[str, ...]] = [("carriage", "1", "2", "3", "limit")]
    rates = _list_rates(motion, times)
    for title, unit, values, limits in rates:
        most = (f"{peak:.4g}" for peak in np.abs(values).max(axis=0))
        peaks.append((f"peak {title.lower()}", *most, _limits_in_words(limits, unit)))
    with drawn((5.4, 3.4)) as figure:
        rows = figure.subplots(2, 1, sharex=True)
        draw_carriages(rows[0], times, motion.at(times).carriages, motion.machine)
        title, unit, values, limits = rates[0]
        draw_limited(rows[1], times, values, limits, f"{title} [{unit}]")
        finish(rows, "time [s]")
    return notebook_html("Trajectory", [head, peaks], figure)


def _limits_in_words(limits: FloatArray, unit: str) -> str:
    """Return limits with their unit, or that there is none."""
    if np.isinf(limits).all():
        return f"none [{unit}]"
    return f"{', '.join(f'{limit:.4g}' for limit in dict.fromkeys(limits.tolist()))} {unit}"


def _describe_safety(report: TimingReport) -> str:
    """Say whether drives may brake by themselves anywhere, and how near they come."""
    if not report.brake_safe:
        return "no"
    if isnan(report.braking_clearance):
        return "yes"
    return f"yes, clearance while braking at least {report.braking_clearance:.2f} mm"


def _list_rates(motion: Motion, times: FloatArray) -> list[tuple[str, str, FloatArray, FloatArray]]:
    """Return name, unit, values of shape (n, 3) and limits of derivatives and forces."""
    state, limits = motion.at(times), motion.machine.limits
    return [
        ("Velocity", "m/s", state.velocity * 1e-3, limits.velocity * 1e-3),
        ("Acceleration", "m/s²", state.acceleration * 1e-3, limits.acceleration * 1e-3),
        ("Jerk", "m/s³", state.jerk * 1e-3, limits.jerk * 1e-3),
        ("Force", "N", motion_forces(motion, times), limits.force),
    ]
