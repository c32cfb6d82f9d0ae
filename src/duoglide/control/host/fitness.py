"""Whether a trajectory may run on a machine: asked again, whoever planned it and whenever."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import (
    ConfigError,
    DriveError,
    DuoglideError,
    InputError,
    LimitError,
    PathError,
)
from duoglide.kinematics.headroom.room import room_at
from duoglide.kinematics.model import inverse
from duoglide.motion.path.actions import Dwell, SetOutput
from duoglide.motion.timing_report import TimingMethod
from duoglide.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from duoglide.control.channel.scale import Triple
    from duoglide.machine import Machine
    from duoglide.motion.motion import State

_PERIOD = 0.0005  # [s] between two places that are looked at
_FEWEST = 200
_SAME = 1e-6  # [mm] between the trajectory's carriages and those of this machine
_LIMIT_RESERVE = 1.001  # what an audit allows
_TOUCHING = -1e-6  # [mm] of room; planning keeps 1e-7 and more, on the exact path
_ROOM_IN_WORDS = {
    "clearance": "the reach or the clearance",
    "travel": "the travel",
    "order": "the carriage_width",
    "keep_out": "the free space beside keep_out",
}


class LimitUse(NamedTuple):
    """Worst use of each carriage's limits; 1.0 is at the limit."""

    velocity: Triple
    acceleration: Triple
    jerk: Triple


def require_fit(trajectory: Trajectory, machine: Machine) -> LimitUse:
    """Check a trajectory against a machine, and return how much of its limits it uses.

    Args:
        trajectory: What shall run.
        machine: What it shall run on; need not be the one that it was planned for.

    Returns:
        Worst use of each carriage's velocity, acceleration and jerk limit; 1.0 is at the limit.

    Raises:
        InputError: It is no trajectory.
        ConfigError: The machine's carriages would be elsewhere: another geometry.
        PathError: It leaves reach, travel, clearance or free space; says where. Or it begins or
            ends in motion, as the parts of a program do.
        LimitError: It asks for more than a limit of this machine.
        DriveError: It sets outputs of a drive that has none, or waits for inputs of one.
    """
    given: object = trajectory
    if not isinstance(given, Trajectory):
        kind = type(given).__name__
        raise InputError(f"a run needs a Trajectory (of dg.plan or dg.Trajectory.load), got {kind}")
    _require_lines(trajectory, machine)
    if trajectory.report.method is not TimingMethod.RECORDED:
        _require_rests(trajectory)
    times = _times(trajectory)
    state, positions = trajectory.at(times), trajectory.position_at(times)
    _require_geometry(machine, positions, state.carriages)
    _require_room(machine, positions, times)
    if trajectory.report.method is TimingMethod.RECORDED:
        return _require_stop_limits(machine, trajectory)
    return _require_limits(machine, state, times)


def _require_lines(trajectory: Trajectory, machine: Machine) -> None:
    """Refuse actions on inputs or outputs that a drive does not have."""
    for time, action in trajectory.actions:
        if isinstance(action, Dwell):
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
    if trajectory.whole is not None:
        speed = np.abs(trajectory.at(trajectory.duration).velocity).max()
        raise PathError(
            f"the trajectory ends in motion, at {speed:.4g} mm/s of a carriage, where another one"
            " takes over: run its whole, which goes on to rest",
            quantity="rest",
            amount=float(speed),
        )
    if not trajectory.starts_at_rest:
        speed = np.abs(trajectory.at(0.0).velocity).max()
        raise PathError(
            f"the trajectory begins in motion, at {speed:.4g} mm/s of a carriage: it goes on from"
            " another one, and cannot be run by itself",
            quantity="rest",
            amount=float(speed),
        )


def measure_limit_use(trajectory: Trajectory, machine: Machine) -> LimitUse:
    """Return how much of a machine's limits a trajectory uses.

    Raises:
        LimitError: More than there is of one.
    """
    times = _times(trajectory)
    return _require_limits(machine, trajectory.at(times), times)


def _times(trajectory: Trajectory) -> FloatArray:
    count = max(_FEWEST, int(trajectory.duration / _PERIOD))
    return np.linspace(0.0, trajectory.duration, count)


def _require_geometry(machine: Machine, positions: FloatArray, carriages: FloatArray) -> None:
    try:
        error = np.abs(inverse(machine.geometry, positions) - carriages).max()
    except DuoglideError as failure:
        raise ConfigError(f"the trajectory is for another machine: {failure}") from failure
    if error > _SAME:
        raise ConfigError(
            "the trajectory is for another machine: with this one's geometry a carriage would"
            f" have to be {error:.4g} mm away from where the trajectory puts it; plan it again"
        )


def _require_room(machine: Machine, positions: FloatArray, times: FloatArray) -> None:
    worst, quantity, left = room_at(machine, positions).worst()
    if left < _TOUCHING:
        where = ", ".join(f"{value:.3f}" for value in positions[worst])
        raise PathError(
            f"at {times[worst]:.4f} s, ({where}) mm, the trajectory leaves"
            f" {_ROOM_IN_WORDS[quantity]} of this machine by {-left:.4g} mm; plan it again",
            position=tuple(positions[worst].tolist()),
            quantity=quantity,
            amount=-left,
        )


def _require_limits(machine: Machine, state: State, times: FloatArray) -> LimitUse:
    uses = []
    for name, unit in (("velocity", "mm/s"), ("acceleration", "mm/s^2"), ("jerk", "mm/s^3")):
        limit = getattr(machine.limits, name)
        use = np.abs(getattr(state, name)) / limit
        row, carriage = np.unravel_index(int(np.argmax(use)), use.shape)
        if use[row, carriage] > _LIMIT_RESERVE:
            raise LimitError(
                f"carriage {carriage + 1} would need {use[row, carriage] * limit[carriage]:.6g}"
                f" {unit} at {times[row]:.4f} s; limits.{name} of this machine is"
                f" {limit[carriage]:.6g} {unit}: plan it again, or lower the override"
            )
        first, second, third = use.max(axis=0).tolist()
        uses.append((first, second, third))
    return LimitUse(*uses)


def _require_stop_limits(machine: Machine, trajectory: Trajectory) -> LimitUse:
    """Check a recorded motion, which may use the stop limits, and is known at its cycles only."""
    use = measure_cycles(trajectory, machine)
    if use.max() > _LIMIT_RESERVE:
        order, carriage = np.unravel_index(int(np.argmax(use)), use.shape)
        name = ("velocity", "acceleration", "jerk")[order]
        raise LimitError(
            f"the recorded motion uses {100.0 * use.max():.1f} % of stop_limits.{name} of carriage"
            f" {carriage + 1} of this machine: replay its plan instead"
        )
    return LimitUse(*map(tuple, use.tolist()))


def measure_cycles(trajectory: Trajectory, machine: Machine) -> FloatArray:
    """Return the use of ``machine.stop_limits`` by the positions that the cycles will send.

    Measured by their differences; from and to rest. Shape (3, 3): velocity, acceleration and jerk
    of each carriage.
    """
    cycle, limits = machine.drives.cycle, machine.stop_limits
    steps = trajectory.at(np.arange(-3, np.ceil(trajectory.duration / cycle) + 4) * cycle).carriages
    uses = []
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        steps = np.diff(steps, axis=0) / cycle
        uses.append(np.abs(steps).max(axis=0) / limit)
    return np.array(uses)
