"""A trajectory run at another pace."""

from __future__ import annotations

from duoglide.motion.motion import Motion
from duoglide.planning.certify import renew_report
from duoglide.planning.stops.certificate import certify_stops
from duoglide.planning.trajectory import Trajectory


def slowed(trajectory: Trajectory, override: float) -> Trajectory:
    """Return a trajectory at a share of its speed, 0 to 1, as a trajectory of its own.

    Unlike an override of the stream it stays within slower limits whatever the operator does.
    """
    if override == 1.0:
        return trajectory
    if trajectory.plan is not None and trajectory.pace is not None:
        return Trajectory.repaced(trajectory.plan, trajectory.pace.slowed(override))
    profile = trajectory.profile.stretch(1.0 / override)
    slow = renew_report(Motion(trajectory.path, profile, report=trajectory.report))
    return Trajectory.of(slow, certify_stops(slow))
