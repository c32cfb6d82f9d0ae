"""Whether a trajectory may run on a machine: asked again, whoever planned it and whenever."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from duoglide.drives.bus.buses import BusKind, parse_bus
from duoglide.errors import ConfigError, DriveError, DuoglideError, InputError, PathError
from duoglide.kinematics.model import inverse
from duoglide.machine import Machine
from duoglide.motion.path.actions import SetOutput, WaitInput
from duoglide.planning.limit_use import require_limits
from duoglide.planning.stops.certificate import stop_bounds_until
from duoglide.planning.trajectory import Trajectory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from duoglide.arrays import FloatArray
    from duoglide.control.channel.scale import Triple

_SAMPLES = 200
_JOINED = (1e-6, 1e-3, 1.0)  # between two parts [mm], [mm/s], [mm/s^2]
_SAME = 1e-6  # [mm] between the trajectory's carriages and those of this machine


class LimitUse(NamedTuple):
    """Worst use of each carriage's limits; 1.0 is at the limit."""

    velocity: Triple
    acceleration: Triple
    jerk: Triple

    def worst(self, other: LimitUse) -> LimitUse:
        """Return the worse of both, carriage by carriage."""
        return _limit_use(np.maximum(np.array(self), np.array(other)))


def machine_that_moves(given: Machine | None, told: Machine, bus: str) -> Machine:
    """Return the machine that a plan or a run of a file is to move.

    What a file says of its machine is data. Simulated drives of this process's own are made after
    it; on any other bus the machine in front of you counts: the one given, or the default one.

    Args:
        given: Named by whoever starts the run; None: nobody named one.
        told: The machine in the file.
        bus: Name of the bus.

    Raises:
        BusError: No such bus.
        ConfigError: None is given, and the file is for another machine than the default one.
    """
    if given is not None:
        return given
    if parse_bus(bus).kind is BusKind.VIRTUAL:
        return told
    default = Machine.default()
    here, there = default.to_dict(), told.to_dict()
    if here != there:
        other = ", ".join(key for key in there if there[key] != here.get(key))
        raise ConfigError(
            f"the file is for another machine than the default one ({other}), and what it says of"
            f" that is believed on the virtual bus only: on {bus}, give the machine (--machine"
            " FILE)"
        )
    return default


def require_fit(trajectory: Trajectory, machine: Machine) -> tuple[Trajectory, LimitUse]:
    """Certify a trajectory for a machine again, from its curve and its profile alone.

    Args:
        trajectory: What shall run.
        machine: What it shall run on; need not be the one that it was planned for.

    Returns:
        The trajectory of this machine, with stop bounds that were derived here, and the worst use
        of each carriage's velocity, acceleration and jerk limit; 1.0 is at the limit.

    Raises:
        InputError: It is no trajectory.
        ConfigError: The machine's carriages would be elsewhere: another geometry.
        PathError: It leaves reach, travel, clearance or free space; says where. Or it jumps, or
            begins or ends in motion, as the parts of a program do.
        LimitError: It asks for more than a limit of this machine.
        DriveError: It sets outputs of a drive that has none, or waits for inputs of one.
    """
    given: object = trajectory
    if not isinstance(given, Trajectory):
        kind = type(given).__name__
        raise InputError(f"a run needs a Trajectory (of dg.plan or dg.Trajectory.load), got {kind}")
    require_lines(trajectory, machine)
    if trajectory.pace is None:
        _require_rests(trajectory)
    _require_geometry(machine, trajectory)
    fit, uses = trajectory.certified_for(machine)
    return fit, _limit_use(uses)


def require_chain(parts: Sequence[Trajectory], machine: Machine) -> list[Trajectory]:
    """Certify the parts of a program for a machine again, from their curves and profiles alone.

    Raises:
        PathError: What ``require_fit`` raises of a part; or one does not go on from where, and as
            fast as, the one before ends.
        LimitError: It asks for more than a limit of this machine.
        ConfigError: It is for another geometry.
    """
    fit: list[Trajectory] = []
    for number, part in enumerate(parts, start=1):
        whole = part.whole or part
        _require_geometry(machine, whole)
        certified, _ = whole.certified_for(machine)
        _require_joined(number, fit[-1] if fit else None, certified)
        if part.whole is not None:
            knot = len(part.profile.knots) - 1
            certified = certified.until(knot, stop_bounds_until(certified, part.duration))
        fit.append(certified)
    if not fit[-1].ends_at_rest:
        _require_rests(fit[-1])
    return fit


def _require_joined(number: int, before: Trajectory | None, after: Trajectory) -> None:
    """Refuse a part that does not begin in the state in which the one before ends."""
    begins = after.at(0.0)
    if before is None:
        apart = [np.zeros(1), begins.velocity, begins.acceleration]
    else:
        ends = before.at(before.duration)
        apart = [
            ends.carriages - begins.carriages,
            ends.velocity - begins.velocity,
            ends.acceleration - begins.acceleration,
        ]
    for unit, gap, allowed in zip(("mm", "mm/s", "mm/s^2"), apart, _JOINED, strict=True):
        if (amount := float(np.abs(gap).max())) > allowed:
            raise PathError(
                f"part {number} of the program does not go on as the one before ends: a carriage is"
                f" {amount:.4g} {unit} off",
                quantity="start",
                amount=amount,
            )


def sample_limit_use(part: Trajectory) -> LimitUse:
    """Return how much of its machine's limits a part of a program uses, at the drives' cycles."""
    limits = part.machine.limits
    _, state = part.sample(part.machine.drives.cycle)
    uses = [
        np.abs(getattr(state, name)).max(axis=0) / getattr(limits, name)
        for name in ("velocity", "acceleration", "jerk")
    ]
    return _limit_use(np.array(uses))


def measure_limit_use(trajectory: Trajectory, machine: Machine) -> LimitUse:
    """Return how much of a machine's limits a trajectory uses.

    Raises:
        LimitError: More than there is of one.
    """
    return _limit_use(require_limits(trajectory, machine.limits).seen)


def _limit_use(uses: FloatArray) -> LimitUse:
    velocity, acceleration, jerk = (tuple(row) for row in uses.tolist())
    return LimitUse(velocity, acceleration, jerk)


def require_lines(trajectory: Trajectory, machine: Machine) -> None:
    """Refuse actions on inputs or outputs that a drive does not have."""
    for time, action in trajectory.actions:
        if not isinstance(action, SetOutput | WaitInput):
            continue
        sets = isinstance(action, SetOutput)
        index, name = (0x60FE, "outputs") if sets else (0x60FD, "inputs")
        if not machine.drives.quirks[action.axis - 1].has(index):
            raise DriveError(
                f"the trajectory {'sets' if sets else 'waits for'} bit {action.bit} of axis"
                f" {action.axis} at {time:.4f} s, and that drive has no digital {name}:"
                f" 0x{index:04X} is in its drives.quirks absent; use an axis that has them",
                axis=action.axis,
            )


def _require_rests(trajectory: Trajectory) -> None:
    """Refuse a part of a program: the machine stands before a run, and after it."""
    ends = np.array([0.0, trajectory.duration])
    first, last = np.abs(trajectory.at(ends).velocity).max(axis=-1).tolist()
    speed = last
    if trajectory.whole is not None:
        why = (
            f"the trajectory ends in motion, at {last:.4g} mm/s of a carriage, where another one"
            " takes over: run its whole, which goes on to rest"
        )
    elif not trajectory.starts_at_rest:
        speed = first
        why = (
            f"the trajectory begins in motion, at {first:.4g} mm/s of a carriage: it goes on from"
            " another one, and cannot be run by itself"
        )
    elif not trajectory.ends_at_rest:
        why = (
            f"the trajectory does not come to rest: at its end a carriage has {last:.4g} mm/s, and"
            " nothing takes over"
        )
    else:
        return
    raise PathError(why, quantity="rest", amount=speed)


def _require_geometry(machine: Machine, trajectory: Trajectory) -> None:
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    positions, carriages = trajectory.position_at(times), trajectory.at(times).carriages
    try:
        error = np.abs(inverse(machine.geometry, positions) - carriages).max()
    except DuoglideError as failure:
        raise ConfigError(f"the trajectory is for another machine: {failure}") from failure
    if error > _SAME:
        raise ConfigError(
            "the trajectory is for another machine: with this one's geometry a carriage would"
            f" have to be {error:.4g} mm away from where the trajectory puts it; plan it again"
        )
