"""The first hours of a machine: look before anything moves, then one millimetre at creep speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from duoglide.control.host.connection import open_axes
from duoglide.errors import DriveError, InputError

if TYPE_CHECKING:
    from duoglide.control.channel.scale import Triple
    from duoglide.control.host.robot import Robot
    from duoglide.drives.axis import AxisReport
    from duoglide.machine import Machine

CREEP = 0.02  # share of the planned speed
_AGREES = 0.2  # share of the distance by which the feedback may be off


@dataclass(frozen=True, slots=True)
class CreepCheck:
    """What a drive reported of a small move.

    Attributes:
        axis: Which carriage was moved, 1 to 3.
        asked: How far [mm], towards +y.
        moved: What the drives say that each carriage has moved [mm].
    """

    axis: int
    asked: float
    moved: Triple

    def __str__(self) -> str:
        return (
            f"carriage {self.axis}: asked {self.asked:+.3f} mm, its drive says"
            f" {self.moved[self.axis - 1]:+.3f} mm. Did it really move that far, towards +y?"
            " If it went the other way, drives.direction is wrong; if the distance is wrong,"
            " drives.increments_per_mm is"
        )


def describe_drives(machine: Machine, bus: str) -> tuple[AxisReport, ...]:
    """Ask three drives who they are and how they are; nothing is written to them.

    Args:
        machine: Whose node numbers and scale to use.
        bus: Name of a bus that drives are on; not ``virtual``.

    Raises:
        BusError: The bus cannot be opened.
        DriveError: A drive does not answer, or is not what the machine file says.
    """
    with open_axes(machine, bus) as axes:
        for axis in axes:
            axis.wait_for_boot()
        return tuple(axis.describe() for axis in axes)


def creep(robot: Robot, axis: int, distance: float = 1.0) -> CreepCheck:
    """Move one carriage by a millimetre at creep speed and back: for a person who watches.

    What the drive reports agrees with what it was told, whatever the sign and scale of its
    encoder; only the person can see whether the carriage went where the report says.

    Args:
        robot: Homed and under power.
        axis: Which carriage, 1 to 3.
        distance: How far, towards +y [mm].

    Raises:
        InputError: No such axis.
        PathError: There is no room for it here.
        DriveError: The feedback does not show the move.
    """
    from duoglide.planning.transfer.transfer import transfer_carriages

    if axis not in (1, 2, 3):
        raise InputError(f"axis = {axis!r}: must be 1, 2 or 3")
    here = np.array(robot.held)
    there = here.copy()
    there[axis - 1] += distance
    before = robot.carriages
    robot.run(transfer_carriages(robot.machine, here, there), override=CREEP)
    first, second, third = (robot.carriages - before).tolist()
    robot.run(transfer_carriages(robot.machine, there, here), override=CREEP)
    check = CreepCheck(axis, distance, (first, second, third))
    if abs(check.moved[axis - 1] - distance) > _AGREES * abs(distance):
        raise DriveError(f"the feedback does not show the move: {check}", axis=axis)
    return check
