"""Derive all that a plan promises again, from its curve and its profile alone.

What is read from a file is data: the report of its check, its stop bounds and its word for being
safe to brake count for nothing. The certificates that made a plan are asked once more, for the
machine that it says it was made for, or for the one that is to follow it.
"""

from __future__ import annotations

from dataclasses import replace

from duoglide.machine import Machine
from duoglide.motion.motion import Motion
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.path.transfer import TransferPath
from duoglide.planning.braking.certificate import brake_report
from duoglide.planning.check.check import check_curve
from duoglide.planning.force_limits import require_forces
from duoglide.planning.limit_use import Uses, require_limits
from duoglide.planning.transfer.certificate import certify as certify_transfer


def certify(machine: Machine, motion: Motion) -> tuple[Motion, Uses]:
    """Certify a motion for a machine; its report is left as it is.

    Returns:
        The same motion on a path of this machine, and how much of the limits it uses.

    Raises:
        PathError: The machine cannot follow the path, or the motion jumps.
        LimitError: It asks for more than a limit of the machine.
    """
    bound = Motion(bind(machine, motion.path), motion.profile, report=motion.report)
    uses = require_limits(bound, machine.limits)
    require_forces(bound)
    return bound, uses


def bind(machine: Machine, path: CarriagePath | TransferPath) -> CarriagePath | TransferPath:
    """Certify a path for a machine: the curve that it is, without touching it.

    Raises:
        PathError: The machine cannot follow it; says where, what and by how much.
    """
    if isinstance(path, TransferPath):
        moved = replace(path, machine=machine)
        return replace(moved, least_clearance=certify_transfer(machine, moved))
    report = check_curve(machine, path.curve)
    return map_to_carriages(replace(path.checked, machine=machine, report=report))


def renew_report(motion: Motion) -> Motion:
    """Return a motion whose report claims to be brake-safe only if that is certain once more."""
    claim = motion.report
    if not claim.brake_safe:
        report = claim.without_braking()
    elif (found := brake_report(motion)).safe:
        clearance, margin = found.clearance, found.carriage_margin
        report = replace(claim, braking_clearance=clearance, braking_carriage_margin=margin)
    else:
        report = claim.without_braking()
    return Motion(motion.path, motion.profile, report=report)
