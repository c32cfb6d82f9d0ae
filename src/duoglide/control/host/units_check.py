"""A slow test move that shows whether a drive brakes as hard as it is told to.

Where a drive does not say in which unit it has its accelerations, the machine file does, and a
mistake there is one of 60 or 1000 times, in the very number that brake-safe plans rely on. So one
carriage creeps, its drive is told to brake gently, and the feedback shows how far it goes.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from duoglide.control.channel.orders import Command, Power
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.errors import DuoglideError, InputError, PathError

if TYPE_CHECKING:
    from duoglide.control.host.connection import Connection
    from duoglide.control.host.monitor import Monitor
    from duoglide.control.host.robot import Robot
    from duoglide.drives.axis.axis import Axis
    from duoglide.planning.trajectory import Trajectory

_SPEED = 40.0  # [mm/s] of the carriage
_GENTLE = 400.0  # [mm/s^2], so that it needs 2 mm and a tenth of a second
_WAY = 15.0  # [mm] that must be free
_AGREES = 0.5  # share by which the deceleration may differ: a wrong unit differs by far more
_TOO_FAR = 2.5  # times what it should need, from where on its power is taken off
_STANDS = 0.05  # [s] without moving
_STILL = 0.02  # [mm], more than an encoder flickers by
_SPEED_CYCLES = 5  # over which the speed is measured
_SLOWEST = 0.5  # share of the planned speed: less shows too little of a deceleration
_PATIENCE = 2.0  # [s]
_LOOK = 0.001  # [s]
_QUICK_STOP_DECELERATION = 0x6085


@dataclass(frozen=True, slots=True)
class UnitsCheck:
    """How a drive has braked in a slow test move.

    Attributes:
        axis: Which carriage, 1 to 3.
        told: What 0x6085 was told [mm/s^2].
        speed: From which it braked, by its feedback [mm/s].
        distance: That it needed [mm].
        unit: What one unit of its accelerations is taken for [mm/s^2].
    """

    axis: int
    told: float
    speed: float
    distance: float
    unit: float

    @property
    def braked(self) -> float:
        """How hard it braked, by its feedback [mm/s^2]."""
        return self.speed**2 / (2.0 * max(self.distance, 1e-6))

    @property
    def refusal(self) -> str:
        """Why the unit is wrong, and the key that mends it; empty where it braked as told."""
        if abs(self.braked - self.told) <= _AGREES * self.told:
            return ""
        return (
            f"{self}. drives.quirks acceleration_unit (or velocity_unit, which it follows from)"
            f" is not what one unit of the drive means: by this move it is"
            f" {self.unit * self.braked / self.told:.3g} mm/s^2, and not {self.unit:.3g}"
        )

    def __str__(self) -> str:
        return (
            f"carriage {self.axis}: told to brake at {self.told:.0f} mm/s^2 from"
            f" {self.speed:.1f} mm/s, it braked at {self.braked:.0f} mm/s^2, in"
            f" {self.distance:.3f} mm"
        )


def check_units(robot: Robot, axis: int) -> UnitsCheck:
    """Let one carriage creep, and see how hard its drive brakes; the power is off afterwards.

    A drive that brakes otherwise than it was told is no error: the check says so.

    Args:
        robot: Homed and under power.
        axis: Which carriage, 1 to 3; ``_WAY`` of its rail must be free, towards either end.

    Raises:
        InputError: No such axis.
        PathError: There is no room for it here.
        DriveError: The drive has no 0x6085, or does not come through the move.
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
        witness = _Witness(drive, robot.machine.drives.cycle)
        try:
            with _watched(connection.monitor, witness):
                run = robot.start(motion, override=override)
                while not run.done and abs(robot.carriages[axis - 1] - start) < _WAY / 2.0:
                    time.sleep(_LOOK)
                run.quick_stop()
                _await_rest(connection, witness, override * peak)
            with suppress(DuoglideError):  # it was stopped on purpose
                run.wait(_PATIENCE)
        finally:
            connection.process.order(Command.POWER, Power.OFF)
            drive.write(_QUICK_STOP_DECELERATION, 0, before)
    robot.reset_fault()
    return witness.judge(override * peak)


def _plan(robot: Robot, axis: int) -> Trajectory:
    """Plan the way of one carriage, to whichever side there is room."""
    from duoglide.planning.transfer.transfer import transfer_carriages

    here = np.array(robot.held)
    step = np.eye(3)[axis - 1] * _WAY
    try:
        return transfer_carriages(robot.machine, here, here + step)
    except PathError:
        return transfer_carriages(robot.machine, here, here - step)


class _Witness:
    """Keeps where one carriage was: a little before its drive brakes by itself, and all after."""

    def __init__(self, drive: Axis, cycle: float) -> None:
        self._drive, self._index = drive, drive.number - 1
        self._cycle = cycle
        self._before: deque[float] = deque(maxlen=_SPEED_CYCLES)
        self._after: list[float] = []

    def add_cycle(self, entry: CycleEntry) -> None:
        """Take a cycle."""
        if entry.missing >> self._index & 1:
            return
        place = self._drive.scale.to_mm(entry.actual[self._index])
        if self._after or entry.power == Power.QUICK_STOP:
            self._after.append(place)
        else:
            self._before.append(place)

    def add_event(self, event: EventEntry) -> None:
        """Take an event."""

    @property
    def distance(self) -> float:
        """How far it has gone since its drive brakes [mm]."""
        return abs(self._after[-1] - self._after[0]) if self._after else 0.0

    @property
    def stands(self) -> bool:
        """Whether it stands after that."""
        last = self._after[-math.ceil(_STANDS / self._cycle) :]
        return len(last) * self._cycle >= _STANDS and max(last) - min(last) < _STILL

    def judge(self, planned: float) -> UnitsCheck:
        """Return what was seen.

        Raises:
            DriveError: It was not as fast as planned when it began to brake.
        """
        speed = 0.0
        if self._after and self._before:
            speed = abs(self._after[0] - self._before[0]) / (len(self._before) * self._cycle)
        if speed < _SLOWEST * planned:
            raise self._drive.error(
                f"was told to brake at {speed:.1f} mm/s and not at {planned:.1f}, so its unit was"
                " not seen: this computer was too late; try again"
            )
        unit = self._drive.units.acceleration
        return UnitsCheck(self._drive.number, _GENTLE, speed, self.distance, unit)


def _await_rest(connection: Connection, witness: _Witness, speed: float) -> None:
    """Wait until a carriage stands; a drive that does not brake loses its power."""
    limit = _TOO_FAR * speed**2 / (2.0 * _GENTLE)
    connection.monitor.wait_until(lambda: witness.stands or witness.distance > limit, _PATIENCE)
    if not witness.stands:
        connection.process.order(Command.POWER, Power.OFF)
        connection.monitor.wait_until(lambda: witness.stands, _PATIENCE)


@contextmanager
def _watched(monitor: Monitor, witness: _Witness) -> Iterator[None]:
    """Hand a witness every cycle, beside those that get them anyway."""
    before = monitor.witnesses
    monitor.witnesses = (*before, witness)
    try:
        yield
    finally:
        monitor.witnesses = before
