"""From a path to a trajectory in one call."""

from __future__ import annotations

from duoglide.machine import Machine
from duoglide.motion.carriage_path import map_to_carriages
from duoglide.motion.path import Path
from duoglide.motion.trajectory import Trajectory
from duoglide.planning.braking_caps import make_brake_safe
from duoglide.planning.check import check_path
from duoglide.planning.timing import Progress, time_path


def plan(
    machine: Machine, path: Path, brake_safe: bool = True, progress: Progress | None = None
) -> Trajectory:
    """Check a path, carry it to the carriages, and time it.

    Args:
        machine: The machine that is to move.
        path: What it is to do.
        brake_safe: Slow the motion wherever drives that brake by themselves would break reach or
            clearance.
        progress: Called with the share that is done, 0 to 1.

    Raises:
        PathError: The machine cannot follow the path; says where and by how much.
        LimitError: No motion keeps the limits.
    """
    checked = check_path(machine, path)
    draft = time_path(map_to_carriages(checked), progress=progress)
    return make_brake_safe(draft) if brake_safe else draft
