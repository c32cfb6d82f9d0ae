"""Limits of force: what holding takes, what a motion may take, and what drives that brake need.

A force is a part that keeps the machine where it is (weight and dry friction), a part that viscous
friction takes, and one that accelerates. Where a motion takes longer by a factor, the second falls
with the factor and the third with its square; the first does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError, PathError
from duoglide.kinematics.dynamics.dynamics import carriage_forces
from duoglide.machine import Machine
from duoglide.motion.forces import forward_rates, motion_forces
from duoglide.motion.motion import Motion, State
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.path.segments import show
from duoglide.motion.path.transfer import TransferPath

LEFT = 0.02  # of a force limit, must be left to move with
_ALLOWED = 1.001  # use of a limit, as audits allow it
_RATE = 20_000.0  # samples a second, as in the audit
_MOST = 200_000  # samples
_APART = 0.5  # [mm], between poses at which holding is looked at
_POSES = 20_001  # of them, at most
_ROUNDING = 1e-6
_TURNS = 8  # of the search for the share of the accelerations that an rms force allows
_GOAL = 0.992  # of the square of the limit, is aimed at
_NEAR = 0.98  # of the square, is enough


def limits_force(machine: Machine) -> bool:
    """Whether the force of any carriage is limited."""
    return bool(np.isfinite(machine.limits.force).any())


def square_of_stretch(inertia: FloatArray, viscous: FloatArray) -> FloatArray:
    """Return the square of the factor of all times with which forces just keep their limit.

    Args:
        inertia: Its share of the force that holding leaves, which falls with the factor's square.
        viscous: That of viscous friction, which falls with the factor.
    """
    root = np.sqrt(np.maximum(viscous**2 + 4.0 * inertia, 0.0))
    square = 0.25 * np.maximum(viscous + root, 0.0) ** 2
    return np.where(inertia > 0.0, square, np.maximum(inertia + viscous, 0.0))


def require_hold(path: CarriagePath | TransferPath) -> None:
    """Refuse a path with a pose at which weight and dry friction take the whole force.

    Raises:
        PathError: Names the carriage, the place, the force and its limit.
    """
    machine = path.machine
    if not limits_force(machine):
        return
    end = path.duration if isinstance(path, TransferPath) else path.length
    count = int(min(max(path.length / _APART, 16.0), _POSES))
    sigma = np.linspace(0.0, end, count + 1)
    position = path.position(sigma)
    held = np.abs(_weights(machine, position)) + np.array(machine.masses.coulomb_friction)
    use = held / machine.limits.force
    if use.max() <= 1.0 - LEFT:
        return
    row, carriage = np.unravel_index(int(np.argmax(use)), use.shape)
    needs, limit = held[row, carriage], machine.limits.force[carriage]
    raise PathError(
        f"at {show(position[row].round(3))} mm, {sigma[row] / end * path.length:.4g} mm along the"
        f" path, carriage {carriage + 1} needs {needs:.4g} N to hold the platform against its"
        f" weight and its rail's friction; limits.force is {limit:.4g} N, of which"
        f" {100.0 * LEFT:g} % must be left to move with: {needs / (1.0 - LEFT):.4g} N would do",
        arc_length=float(sigma[row] / end * path.length),
        position=position[row].tolist(),
        quantity="force",
        amount=float(needs - limit),
    )


def slow_to_force(motion: Motion) -> Motion:
    """Return a motion, slowed as a whole so that it keeps the force limits.

    Raises:
        PathError: There is a pose that cannot be held within them.
    """
    if not limits_force(motion.machine):
        return motion
    require_hold(motion.path)
    parts = _split(motion.machine, motion.at(_times(motion)))
    worst = 0.0
    for sign in (1.0, -1.0):
        room = motion.machine.limits.force - sign * parts.held - parts.dry
        square = square_of_stretch(sign * parts.moved / room, sign * parts.viscous / room)
        worst = max(worst, float(square.max()))
    if worst <= 1.0:
        return motion
    return replace(motion, profile=motion.profile.stretch(worst**0.5 * (1.0 + _ROUNDING)))


def share_forces(machine: Machine, states: State) -> FloatArray:
    """Return what a change of the pace asks of ``stop_limits.force``, in both directions.

    A pace that falls or rises by 1 within a second accelerates the platform by its velocity; a pace
    below 1 takes no more than the plan of all else.

    Args:
        machine: Whose stop limits hold.
        states: Of a motion that may be slowed down while it runs, (n,) times.

    Returns:
        Along +y, then along -y: force for a change of the pace by 1 within a second, and that of
        the motion's own inertia; each as a share of what weight and friction leave, (2, 2, n, 3).
    """
    parts = _split(machine, states)
    limit, taken = machine.stop_limits.force, parts.dry + np.abs(parts.viscous)
    both = np.stack([parts.by_pace, parts.moved])
    room = (np.maximum(limit - sign * parts.held - taken, LEFT * limit) for sign in (1.0, -1.0))
    return np.stack([sign * both / left for sign, left in zip((1.0, -1.0), room, strict=True)])


def keep_rms(motion: Motion, retime: Callable[[float], Motion]) -> Motion:
    """Return a motion that keeps ``limits.rms_force``, an integral over all of it.

    No limit at an instant says what an integral will be. So the motion is timed again with every
    acceleration at one share, which is sought until the integral is just kept; by what is left it
    is slowed as a whole.

    Args:
        motion: Timed within the other limits.
        retime: Times it again with a share of the accelerations.

    Raises:
        PathError: Holding the platform alone takes more.
    """
    limit = motion.machine.limits.rms_force
    if np.isinf(limit).all():
        return motion
    held = float((_mean_squares(motion, still=True) / limit**2).max())
    if held >= (1.0 - LEFT) ** 2:
        raise PathError(
            f"holding the platform along the path takes {100.0 * held**0.5:.4g} % of"
            f" limits.rms_force ({show(limit)} N), however slowly it moves",
            quantity="force",
        )
    share, found = 1.0, motion
    for _ in range(_TURNS):
        use = float((_mean_squares(found) / limit**2).max())
        if use <= 1.0 and (share == 1.0 or use > _NEAR):
            return found
        share = min(1.0, share * float(((_GOAL - held) / max(use - held, LEFT)) ** 0.5))
        found = retime(share)
    for _ in range(_TURNS * _TURNS):
        use = float((_mean_squares(found) / limit**2).max())
        if use <= 1.0:
            break
        found = replace(found, profile=found.profile.stretch(use**0.5 * (1.0 + _ROUNDING)))
    return found


def require_forces(motion: Motion) -> None:
    """Require that a motion keeps the force limits, at 20 kHz.

    Raises:
        LimitError: Which carriage would need more, when, and how much there is.
    """
    limit = motion.machine.limits.force
    if not limits_force(motion.machine):
        return
    times = _times(motion)
    use = np.abs(motion_forces(motion, times)) / limit
    if use.max() <= _ALLOWED:
        return
    row, carriage = np.unravel_index(int(np.argmax(use)), use.shape)
    raise LimitError(
        f"carriage {carriage + 1} would need {use[row, carriage] * limit[carriage]:.6g} N at"
        f" {times[row]:.6f} s; limits.force of this machine is {limit[carriage]:.6g} N: plan it"
        " again, or lower the override"
    )


def require_brakes(motion: Motion) -> None:
    """Require that drives have the force to brake by themselves as quickly as they are told to.

    Looked at where all three begin to brake, at 20 kHz of the motion, against
    ``stop_limits.force``. A carriage that comes to rest within a cycle brakes by no more than that.

    Raises:
        LimitError: Which carriage lacks how much, when, and which deceleration there is force for.
    """
    machine = motion.machine
    limit = machine.stop_limits.force
    if not np.isfinite(limit).any():
        return
    times = _times(motion)
    state = motion.at(times)
    within_a_cycle = np.abs(state.velocity) / machine.drives.cycle
    rates = np.minimum(machine.drives.quick_stop_deceleration, within_a_cycle)
    braking = -np.sign(state.velocity) * rates
    platform = forward_rates(machine.geometry, state.carriages, state.velocity, braking)
    forces = np.abs(carriage_forces(machine, *platform))
    use = forces / limit
    if use.max() <= _ALLOWED:
        return
    row, carriage = np.unravel_index(int(np.argmax(use)), use.shape)
    told = machine.drives.quick_stop_deceleration[carriage]
    raise LimitError(
        f"carriage {carriage + 1} would need {forces[row, carriage]:.4g} N to brake by itself at"
        f" {times[row]:.6f} s with all drives at drives.quick_stop_deceleration ({told:g} mm/s^2 of"
        f" it); stop_limits.force is {limit[carriage]:.4g} N: about"
        f" {told / use[row, carriage]:.3g} mm/s^2 would do, or plan without brake_safe"
    )


def _times(motion: Motion) -> FloatArray:
    count = int(min(max(np.ceil(motion.duration * _RATE), 1.0), _MOST))
    return np.linspace(0.0, motion.duration, count + 1)


class _Parts(NamedTuple):
    """Parts of the forces of a motion, (n, 3) each [N].

    Attributes:
        held: What holds the platform.
        moved: What accelerates it.
        viscous: Of viscous friction.
        dry: Of dry friction, either way, (3,).
        by_pace: What would accelerate it by its velocity within a second.
    """

    held: FloatArray
    moved: FloatArray
    viscous: FloatArray
    dry: FloatArray
    by_pace: FloatArray


def _split(machine: Machine, states: State) -> _Parts:
    """Split the forces of a motion, (n,) times."""
    masses, none = machine.masses, (0.0, 0.0, 0.0)
    bare = replace(machine, masses=replace(masses, coulomb_friction=none, viscous_friction=none))
    rates = states.carriages, states.velocity, states.acceleration
    position, velocity, acceleration = forward_rates(machine.geometry, *rates)
    held = _weights(machine, position)
    return _Parts(
        held=held,
        moved=carriage_forces(bare, position, velocity, acceleration) - held,
        viscous=np.array(masses.viscous_friction) * states.velocity,
        dry=np.array(masses.coulomb_friction),
        by_pace=carriage_forces(bare, position, none, velocity) - held,
    )


def _mean_squares(motion: Motion, *, still: bool = False) -> FloatArray:
    """Return the mean squares of a motion's forces, or of what holds it there, (3,) [N^2]."""
    times = _times(motion)
    if still:
        forces = _weights(motion.machine, motion.position_at(times))
    else:
        forces = motion_forces(motion, times)
    square = forces**2
    mean: FloatArray = (square.sum(axis=0) - 0.5 * (square[0] + square[-1])) / (times.size - 1)
    return mean


def _weights(machine: Machine, position: FloatArray) -> FloatArray:
    """Return the forces that hold the platform, friction aside [N]."""
    none = np.zeros(3)
    return carriage_forces(machine, position, none, none)
