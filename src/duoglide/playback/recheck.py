"""Whether a machine can follow a trajectory that was made for another, or for itself long ago."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.control.host.fitness import measure_cycles
from duoglide.errors import LimitError
from duoglide.machine import Machine
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.trajectory import Trajectory
from duoglide.planning.check.check import check_curve
from duoglide.planning.stops.certificate import stop_bounds
from duoglide.planning.transfer.certificate import certify

_ALLOWED = 1.001  # use of a limit, as audits allow it
_NAMES = ("velocity", "acceleration", "jerk")


def recheck(machine: Machine, trajectory: Trajectory, override: float = 1.0) -> Trajectory:
    """Check a planned trajectory again, and make it one of this machine.

    Args:
        machine: Who shall follow it.
        trajectory: What.
        override: The share of the plan's speed that it runs at already, for the error.

    Returns:
        The same motion, bound to ``machine``.

    Raises:
        PathError: The machine cannot follow the path; says where, what and by how much.
        LimitError: It asks more of a carriage than ``machine.limits``; names which, how much, and
            the override that would do.
    """
    bound = _bind(machine, trajectory)
    audit = bound.audit()
    _require_limits(np.array([audit.velocity, audit.acceleration, audit.jerk]), override)
    return bound


def recheck_repaced(machine: Machine, trajectory: Trajectory) -> Trajectory:
    """Do what ``recheck`` does for the motion of a run whose pace was changed on the way.

    A change of pace may use ``machine.stop_limits``, and is known at the cycles only.

    Raises:
        PathError: The machine cannot follow the path.
        LimitError: It asks more of a carriage than ``machine.stop_limits``; a run whose last
            cycles were filtered out breaks off at speed, and does.
    """
    bound = _bind(machine, trajectory)
    use = measure_cycles(bound, machine)
    if use.max() > _ALLOWED:
        order, carriage = np.unravel_index(int(np.argmax(use)), use.shape)
        raise LimitError(
            f"the recorded motion asks for {100.0 * use.max():.1f} % of stop_limits."
            f"{_NAMES[order]} of carriage {carriage + 1} of this machine; --override 100 replays"
            " its plan instead"
        )
    return bound


def _bind(machine: Machine, trajectory: Trajectory) -> Trajectory:
    """Certify the path of a trajectory for a machine, and return the trajectory on it."""
    path = _checked(machine, trajectory.path)
    if machine.to_dict() == trajectory.machine.to_dict():
        return trajectory
    moved = replace(trajectory, path=path)
    return replace(moved, stops=stop_bounds(moved))


def _checked(machine: Machine, path: CarriagePath | TransferPath) -> CarriagePath | TransferPath:
    """Certify a path for a machine: the curve that it is, without touching it."""
    if isinstance(path, TransferPath):
        moved = replace(path, machine=machine)
        return replace(moved, least_clearance=certify(machine, moved))
    report = check_curve(machine, path.curve)
    return map_to_carriages(replace(path.checked, machine=machine, report=report))


def _require_limits(uses: FloatArray, override: float) -> None:
    """Refuse uses of velocity, acceleration and jerk limits above 1, shape (3, 3)."""
    slower = override * np.maximum(uses, 1e-12) ** (-1.0 / np.arange(1.0, 4.0)[:, None])
    order, carriage = np.unravel_index(int(np.argmin(slower)), slower.shape)
    use = float(uses[order, carriage])
    if use > _ALLOWED:
        percent = np.floor(1000.0 * slower[order, carriage]) / 10.0
        raise LimitError(
            f"the motion asks for {100.0 * use:.1f} % of the {_NAMES[order]} limit of carriage"
            f" {carriage + 1} of this machine; --override {percent:g} would do"
        )
