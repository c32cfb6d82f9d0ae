"""How a machine gets to where a run begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from duoglide.errors import PathError
from duoglide.kinematics.model import forward

if TYPE_CHECKING:
    from duoglide.arrays import FloatArray
    from duoglide.machine import Machine
    from duoglide.motion.trajectory import Trajectory

START_TOLERANCE = 0.05  # [mm] that a carriage may be away from the start of a run


def way_to_start(
    machine: Machine, held: FloatArray, trajectory: Trajectory, allowed: bool
) -> Trajectory | None:
    """Plan the approach to a trajectory's start; None where the machine is there.

    Args:
        machine: Which stands still.
        held: Where its setpoints hold the carriages [mm], shape (3,).
        trajectory: That shall run.
        allowed: Whether an approach was asked for.

    Raises:
        PathError: The machine is elsewhere and no approach was asked for, or there is no safe way.
    """
    away = np.abs(held - trajectory.at(0.0).carriages)
    if away.max() <= START_TOLERANCE:
        return None
    start = trajectory.position_at(0.0)
    here = forward(machine.geometry, held)
    if not allowed:
        axis = int(np.argmax(away)) + 1
        where, there = (", ".join(f"{v:.3f}" for v in place) for place in (here, start))
        raise PathError(
            f"the machine is not at the start: carriage {axis} is {away.max():.3f} mm away;"
            f" the platform is at ({where}), the start at ({there}) mm;"
            " ask for an approach (approach=True, --approach)",
            position=tuple(here.tolist()),
            quantity="start",
            amount=float(away.max()),
        )
    from duoglide.planning.transfer import transfer

    return transfer(machine, here, start)
