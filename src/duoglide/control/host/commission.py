"""The first hours of a machine: look before anything moves, then one millimetre at creep speed."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import AXES
from duoglide.control.host.connection import open_axes
from duoglide.drives.axis.configure import await_answer, no_answer
from duoglide.drives.axis.in_parallel import in_parallel
from duoglide.drives.bus.buses import BusKind, parse_bus
from duoglide.drives.bus.listen import require_alone
from duoglide.drives.onboarding.dictionary_drive import DictionaryDrive
from duoglide.drives.onboarding.probe import Probed, probe, settings_for_node
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.errors import DriveError, InputError
from duoglide.kinematics.home import home_carriages

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from duoglide.control.channel.scale import Triple
    from duoglide.control.host.robot import Robot
    from duoglide.control.host.run.conduct import DriveConduct
    from duoglide.drives.axis.axis import AxisReport
    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory

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


def plan_lag_motion(machine: Machine, distance: float = 100.0) -> Trajectory:
    """Plan what the lags of drives are learned from: along the rails, there and back, twice.

    All three carriages move alike, with all the speed and acceleration that the distance allows.

    Args:
        machine: It begins and ends in its home pose.
        distance: How far it goes, towards +y; below 0 towards -y [mm].

    Raises:
        PathError: There is no room for it.
    """
    from duoglide.kinematics.home import home_position
    from duoglide.motion.path.path import Path
    from duoglide.planning.plan import plan

    home = home_position(machine)
    there = home + np.array((0.0, distance, 0.0))
    return plan(machine, Path.polyline([home, there, home, there, home]))


def lag_tables(drives: Sequence[DriveConduct]) -> str:
    """Write what was learned of three drives as lines of a machine file (TOML).

    Args:
        drives: Of the report of a run of ``plan_lag_motion``.
    """
    lags = ", ".join(f"{drive.lag:.3g}" for drive in drives)
    bends = ", ".join(f"{drive.acceleration_lag:.3g}" for drive in drives)
    rest = ", ".join(f"{abs(drive.offset) + drive.noise:.3f}" for drive in drives)
    return (
        "[drives]\n"
        f"lag = [{lags}]  # s\n"
        f"acceleration_lag = [{bends}]  # s^2\n"
        f"# offset and noise that this leaves: {rest} mm\n"
    )


def probe_drives(machine: Machine, bus: str, node: int | None = None) -> tuple[Probed, ...]:
    """Find out what the drives of a bus have of all that the host asks for; they keep theirs.

    Args:
        machine: Whose node numbers, scale, travel and speed to use.
        bus: Name of the bus; ``virtual`` probes three simulated drives.
        node: Only this one, whatever the machine's are; None for all three.

    Raises:
        BusError: The bus cannot be opened, or another host is on it.
        DriveError: A drive is under power.
        DriveTimeout: A drive does not answer.
    """
    settings = machine.drives if node is None else settings_for_node(machine.drives, node)
    probed = replace(machine, drives=settings)
    with ExitStack() as resources:
        if parse_bus(bus).kind is BusKind.VIRTUAL:
            start = home_carriages(machine).tolist()
            bus = resources.enter_context(SimulatedDrives(settings, start)).address
        else:
            require_alone(bus, settings)
        axes = resources.enter_context(open_axes(probed, bus))[: 1 if node is not None else AXES]
        for axis, answers in zip(axes, in_parallel(axes, await_answer), strict=True):
            if not answers:
                raise no_answer(axis)
        return tuple(in_parallel(axes, lambda axis: probe(axis, *_asked_of(machine, axis.number))))


def probe_dictionary(machine: Machine, file: Path, node: int | None = None) -> Probed:
    """Find out the same from a maker's dictionary alone.

    Raises:
        ConfigError: No such file, or no dictionary.
    """
    settings = machine.drives if node is None else settings_for_node(machine.drives, node)
    return probe(DictionaryDrive(file, settings, 1), *_asked_of(machine, 1))


def _asked_of(machine: Machine, number: int) -> tuple[tuple[float, float], float]:
    """Return the travel and the greatest speed that bring-up writes into a drive [mm, mm/s]."""
    travel = machine.geometry.rail_half_length
    return (-travel, travel), float(machine.stop_limits.velocity[number - 1])
