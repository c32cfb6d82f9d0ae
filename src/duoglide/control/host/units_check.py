"""A slow test move that shows whether a drive brakes as hard as it is told to.

Where a drive does not say in which unit it has its accelerations, the machine file does, and a
mistake there is one of 60 or 1000 times, in the very number that brake-safe plans rely on. So one
carriage creeps, its drive is told to brake gently, and the feedback shows how far it goes.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from duoglide.control.channel.orders import Command, Power
from duoglide.errors import DriveError, DuoglideError, InputError, PathError

if TYPE_CHECKING:
    from duoglide.control.host.connection import Connection
    from duoglide.control.host.robot import Robot
    from duoglide.drives.axis.axis import Axis
    from duoglide.planning.trajectory import Trajectory

_SPEED = 40.0  # [mm/s] of the carriage
_GENTLE = 400.0  # [mm/s^2], so that it needs 2 mm and a tenth of a second
_WAY = 15.0  # [mm] that must be free
_AGREES = 0.5  # share by which the deceleration may differ: a wrong unit differs by far more
_TOO_FAR = 2.5  # times what it should need, from where on its power is taken off
_STANDS = 0.05  # [s] without moving
_PATIENCE = 2.0  # [s]
_LOOK = 0.001  # [s]
_QUICK_STOP_DECELERATION = 0x6085


@dataclass(frozen=True, slots=True)
class UnitsCheck:
    """How a drive has braked in a slow test move.

    Attributes:
        axis: Which carriage, 1 to 3.
        told: What 0x6085 was told [mm/s^2].
        speed: From which it braked [mm/s].
        distance: That it needed [mm].
    """

    axis: int
    told: float
    speed: float
    distance: float

    @property
    def braked(self) -> float:
        """How hard it braked, by its feedback [mm/s^2]."""
        return self.speed**2 / (2.0 * max(self.distance, 1e-6))

    def __str__(self) -> str:
        return (
            f"carriage {self.axis}: told to brake at {self.told:.0f} mm/s^2 from"
            f" {self.speed:.1f} mm/s, it braked at {self.braked:.0f} mm/s^2, in"
            f" {self.distance:.3f} mm"
        )


def check_units(robot: Robot, axis: int) -> UnitsCheck:
    """Let one carriage creep, and see how hard its drive brakes; the power is off afterwards.

    Args:
        robot: Homed and under power.
        axis: Which carriage, 1 to 3; ``_WAY`` of its rail must be free, towards either end.

    Raises:
        InputError: No such axis.
        PathError: There is no room for it here.
        DriveError: It brakes otherwise than it was told: names the key of its unit.
    """
    connection = robot._connection
    if axis not in (1, 2, 3):
        raise InputError(f"axis = {axis!r}: must be 1, 2 or 3")
    motion, start = _plan(robot, axis), float(robot.carriages[axis - 1])
    peak = float(np.abs(motion.at(np.linspace(0.0, motion.duration, 201)).velocity).max())
    override = min(1.0, _SPEED / peak)
    with connection.axes() as axes:
        drive = axes[axis - 1]
        if not drive.has(_QUICK_STOP_DECELERATION):
            raise drive.error("has no 0x6085 to check: its drives.quirks says that it is absent")
        before = drive.read(_QUICK_STOP_DECELERATION)
        ramp = drive.units.ramp(_GENTLE, "the test's deceleration")
        drive.write_checked(_QUICK_STOP_DECELERATION, 0, ramp)
        try:
            run = robot.start(motion, override=override)
            while not run.done and abs(robot.carriages[axis - 1] - start) < _WAY / 2.0:
                time.sleep(_LOOK)
            run.quick_stop()
            check = _watch(connection, drive, override * peak)
            with suppress(DuoglideError):  # it was stopped on purpose
                run.wait(_PATIENCE)
        finally:
            connection.process.order(Command.POWER, Power.OFF)
            drive.write(_QUICK_STOP_DECELERATION, 0, before)
    robot.reset_fault()
    if abs(check.braked - _GENTLE) > _AGREES * _GENTLE:
        raise DriveError(
            f"{check}. drives.quirks acceleration_unit (or velocity_unit, which it follows from)"
            f" is not what one unit of the drive means: by this move it is"
            f" {drive.units.acceleration * check.braked / _GENTLE:.3g} mm/s^2, and not"
            f" {drive.units.acceleration:.3g}",
            axis=axis,
        )
    return check


def _plan(robot: Robot, axis: int) -> Trajectory:
    """Plan the way of one carriage, to whichever side there is room."""
    from duoglide.planning.transfer.transfer import transfer_carriages

    here = np.array(robot.held)
    step = np.eye(3)[axis - 1] * _WAY
    try:
        return transfer_carriages(robot.machine, here, here + step)
    except PathError:
        return transfer_carriages(robot.machine, here, here - step)


def _watch(connection: Connection, drive: Axis, speed: float) -> UnitsCheck:
    """Measure how far a carriage goes; a drive that does not brake loses its power."""
    expected = speed**2 / (2.0 * _GENTLE)
    monitor, index = connection.monitor, drive.number - 1
    monitor.wait_for(lambda entry: entry.power == Power.QUICK_STOP, _PATIENCE)
    places: list[float] = []
    moved = time.monotonic()
    while time.monotonic() - moved < _STANDS:
        entry = monitor.latest
        if entry is None:
            continue
        place = drive.scale.to_mm(entry.actual[index])
        if not places or place != places[-1]:
            places.append(place)
            moved = time.monotonic()
        if abs(place - places[0]) > _TOO_FAR * expected:
            connection.process.order(Command.POWER, Power.OFF)
            break
        time.sleep(_LOOK)
    return UnitsCheck(drive.number, _GENTLE, speed, abs(places[-1] - places[0]))
