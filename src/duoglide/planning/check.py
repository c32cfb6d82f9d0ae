"""Checks a path, every point of it, and fixes its blends."""

from __future__ import annotations

import numpy as np

from duoglide.errors import PathError
from duoglide.kinematics.model import inverse, reachable
from duoglide.kinematics.singularity import clearance
from duoglide.machine import Machine
from duoglide.motion.blending import RoundedPath, round_corners
from duoglide.motion.checked import CheckedPath, CheckReport, LeastMargin, SpeedCap
from duoglide.motion.path import Path


def check_path(machine: Machine, path: Path) -> CheckedPath:
    """Check that a machine can follow a path.

    Raises:
        PathError: Names where, what and by how much.
    """
    rounded = round_corners(path)
    curve = rounded.curve.moved(np.subtract(machine.work_frame, machine.tool_offset))
    sigma = np.unique(np.concatenate([np.linspace(0, curve.end, 2000), curve.breaks]))
    points = curve.position(sigma)
    fine = reachable(machine.geometry, points)
    if not fine.all():
        i = int(np.argmin(fine))
        raise PathError(
            f"out of reach at {points[i]}",
            arc_length=float(curve.arc_length(float(sigma[i]))),
            position=points[i].tolist(),
            quantity="reach",
            amount=0.0,
        )
    q = inverse(machine.geometry, points)
    a = machine.geometry.rail_half_length
    table = {
        "clearance": (clearance(machine.geometry, points), machine.clearance),
        **{f"travel_{i + 1}": (a - np.abs(q[:, i]), 0.0) for i in range(3)},
        "order": (q[:, 1] - q[:, 0], machine.carriage_width),
    }
    least = []
    for family, (values, required) in table.items():
        i = int(np.argmin(values - required))
        s = float(curve.arc_length(float(sigma[i])))
        if values[i] < required + 1e-7:
            raise PathError(
                f"{family} {values[i]:.6g} mm, needs {required:g} mm, at {points[i]} mm, {s:.6g} mm along",
                arc_length=s,
                position=points[i].tolist(),
                quantity=family,
                amount=float(required - values[i]),
            )
        least.append(
            LeastMargin(
                family, float(values[i]), required, float(sigma[i]), s, tuple(points[i].tolist())
            )
        )
    actions = tuple((float(rounded.waypoints[i]), action) for i, action in path.actions)
    return CheckedPath(
        machine,
        path,
        curve,
        CheckReport(tuple(least)),
        tuple(rounded.waypoints.tolist()),
        actions,
        speed_caps(path, rounded),
    )


def speed_caps(path: Path, rounded: RoundedPath) -> tuple[SpeedCap, ...]:
    """Collect the caps on the tool's speed, those of the segments and that of the whole path."""
    caps: list[SpeedCap] = []
    ends = rounded.waypoints.tolist()
    for segment, start, end in zip(path.segments, ends[:-1], ends[1:], strict=True):
        speeds = [cap for cap in (segment.speed, path.tool_speed) if cap is not None]
        if not speeds:
            continue
        speed = min(speeds)
        if caps and caps[-1].end == start and caps[-1].speed == speed:
            start = caps.pop().start  # noqa: PLW2901  # one cap for both
        caps.append(SpeedCap(start, end, speed))
    return tuple(caps)
