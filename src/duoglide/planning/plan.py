"""From a path to a trajectory in one call."""

from __future__ import annotations

from dataclasses import replace

from duoglide.arrays import FloatArray
from duoglide.machine import Machine, Timing
from duoglide.motion.motion import Motion
from duoglide.motion.path.carriage import map_to_carriages
from duoglide.motion.path.path import Path
from duoglide.planning.braking.make_safe import make_brake_safe
from duoglide.planning.check.check import check_rounded, require_noun
from duoglide.planning.rounding.choice import choose_blends
from duoglide.planning.stops.certificate import certify_stops
from duoglide.planning.timing.span import Effort
from duoglide.planning.timing.time_path import (
    Progress,
    choose_timing,
    time_path,
    wished_timing,
)
from duoglide.planning.timing.timed_curve import SigmaCap
from duoglide.planning.trajectory import Trajectory

_MANY = 100  # pieces of a curve; where there are more, each is short beside a stop
_FEW = 2  # cells that such a piece has at least: four gain nothing but work


def plan(
    machine: Machine,
    path: Path,
    brake_safe: bool = True,
    progress: Progress | None = None,
    timing: Timing | str | None = None,
) -> Trajectory:
    """Choose a path's blends, check it, carry it to the carriages, and time it.

    Args:
        machine: The machine that is to move.
        path: What it is to do.
        brake_safe: Slow the motion wherever drives that brake by themselves would break reach or
            clearance.
        progress: Called with the share that is done, 0 to 1.
        timing: How to time it: ``dg.Timing`` or its word. None: as the path says (a program may),
            else as the machine does, else by toppra if no carriage has a jerk limit, else
            near-optimal.

    Raises:
        InputError: No machine, no path, or no such timing.
        PathError: The machine cannot follow the path, or not hold a pose of it within the force
            limits; says where and by how much.
        LimitError: Drives that brake by themselves have not the force for it.
    """
    require_noun(machine, Machine)
    require_noun(path, Path)
    effort = Effort(timing=choose_timing(machine, wished_timing(path, timing)))
    rounded = choose_blends(machine, path, trials=effort.timing is not Timing.RUCKIG)
    checked = check_rounded(machine, rounded)
    carriages = map_to_carriages(checked)
    if carriages.curve.count > _MANY:
        effort = replace(effort, per_piece=_FEW)
    motion = time_path(carriages, effort, progress)
    if brake_safe:

        def retimed(sigma: FloatArray, cap: FloatArray) -> Motion:
            return time_path(carriages, effort, sigma_cap=SigmaCap(sigma, cap))

        motion = make_brake_safe(motion, retimed)
    return Trajectory.of(motion, certify_stops(motion))
