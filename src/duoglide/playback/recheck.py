"""Whether a machine can follow a trajectory that was made for another, or for itself long ago."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from duoglide.errors import LimitError
from duoglide.machine import CarriageLimits, Machine
from duoglide.motion.carriage_path import CarriagePath, map_to_carriages
from duoglide.motion.trajectory import Trajectory
from duoglide.motion.transfer_path import TransferPath
from duoglide.planning._certify import certify
from duoglide.planning.check_least import least_margins
from duoglide.planning.check_refusal import assembly_error, refusal
from duoglide.planning.check_rules import Rules
from duoglide.planning.check_search import search
from duoglide.planning.stopping import stop_bounds

AUDITED = 1.001  # use of a limit, as audits allow it
REPACED = 1.05  # the same where the pace is known at the cycles only
_NAMES = ("velocity", "acceleration", "jerk")


def recheck(
    machine: Machine,
    trajectory: Trajectory,
    limits: CarriageLimits,
    *,
    override: float = 1.0,
    allowed: float = AUDITED,
) -> Trajectory:
    """Check a trajectory again, and make it one of this machine.

    Args:
        machine: Who shall follow it.
        trajectory: What.
        limits: What it may ask of the carriages.
        override: At which share of its speed, 0 to 1.
        allowed: Use of a limit from which on it counts as broken.

    Returns:
        The same motion, bound to ``machine``.

    Raises:
        PathError: The machine cannot follow the path; says where, what and by how much.
        LimitError: It asks more of a carriage than ``limits``; names which, how much, and the
            override that would do.
    """
    path = _checked(machine, trajectory.path)
    if machine.to_dict() == trajectory.machine.to_dict():
        bound = trajectory
    else:
        moved = replace(trajectory, path=path)
        bound = replace(moved, stops=stop_bounds(moved))
    _require_limits(bound, limits, override, allowed)
    return bound


def _checked(machine: Machine, path: CarriagePath | TransferPath) -> CarriagePath | TransferPath:
    """Certify a path for a machine: the curve that it is, without touching it."""
    if isinstance(path, TransferPath):
        moved = replace(path, machine=machine)
        return replace(moved, least_clearance=certify(machine, moved))
    rules = Rules.of(machine, path.curve)
    found = search(rules)
    if found.failed_at < np.inf:
        raise refusal(rules, found.failed_at)
    if error := assembly_error(machine, path.curve):
        raise error
    report = least_margins(rules, found)
    return map_to_carriages(replace(path.checked, machine=machine, report=report))


def _require_limits(
    trajectory: Trajectory, limits: CarriageLimits, override: float, allowed: float
) -> None:
    audit, own = trajectory.audit(), trajectory.machine.limits
    fit = 1.0
    worst = ""
    for order, name in enumerate(_NAMES, 1):
        use = getattr(audit, name) * getattr(own, name) / getattr(limits, name)
        carriage = int(np.argmax(use))
        share = float(use[carriage]) * override**order
        if share > allowed:
            slower = override * share ** (-1.0 / order)
            if slower < fit:
                fit = slower
                worst = f"{100.0 * share:.1f} % of the {name} limit of carriage {carriage + 1}"
    if worst:
        percent = np.floor(1000.0 * fit) / 10.0
        raise LimitError(
            f"the motion asks for {worst} of this machine; --override {percent:g} would do"
        )
