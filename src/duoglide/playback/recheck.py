"""Whether a machine can follow a trajectory that was made for another, or for itself long ago."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from duoglide.errors import LimitError
from duoglide.machine import Machine
from duoglide.planning.certify import bind, renew_report
from duoglide.planning.limit_use import ALLOWED, NAMES, measure_uses
from duoglide.planning.stops.certificate import certify_stops
from duoglide.planning.trajectory import Trajectory


def recheck(machine: Machine, trajectory: Trajectory, override: float = 1.0) -> Trajectory:
    """Certify a planned trajectory for this machine.

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
    bound = replace(trajectory, path=bind(machine, trajectory.path))
    uses = measure_uses(bound, machine.limits).sure
    slower = override * np.maximum(uses, 1e-12) ** (-1.0 / np.arange(1.0, 4.0)[:, None])
    order, carriage = np.unravel_index(int(np.argmin(slower)), slower.shape)
    use = float(uses[order, carriage])
    if use > ALLOWED:
        percent = np.floor(1000.0 * slower[order, carriage]) / 10.0
        raise LimitError(
            f"the motion asks for {100.0 * use:.1f} % of the {NAMES[order]} limit of carriage"
            f" {carriage + 1} of this machine; --override {percent:g} would do"
        )
    report = renew_report(bound).report
    return replace(bound, stops=certify_stops(bound), report=report)
