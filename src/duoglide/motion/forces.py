"""The forces of a motion: what its drives must deliver, and what they spend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray, read_only
from duoglide.kinematics.dynamics.dynamics import carriage_forces
from duoglide.kinematics.model import forward, inverse_derivatives, jacobian
from duoglide.machine import Geometry
from duoglide.motion.motion import Motion
from duoglide.motion.path.transfer import TransferPath

_RATE = 20_000.0  # samples per second, as in the audit
_MOST = 200_000  # samples; a longer motion is sampled more coarsely
_WATT = 1e-3  # per N mm/s


class PlatformState(NamedTuple):
    """The platform at some times, each of shape (..., 3) [mm, mm/s, mm/s^2]."""

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Demand:
    """What a motion demands of its drives.

    Attributes:
        peak_force: Largest amount of each carriage's force [N], shape (3,).
        rms_force: Root of the mean square of each carriage's force over the motion, which heats its
            motor [N], shape (3,).
        peak_speed: Of each carriage [mm/s], shape (3,).
        peak_power: The most that each drive delivers at one time [W], shape (3,).
        total_peak_power: The most that all three deliver together at one time [W].
        energy: What the drives deliver, without what they take back while they brake [J], (3,).
        returned: What they take back [J], (3,).
        duration: Of the motion [s].
    """

    peak_force: FloatArray
    rms_force: FloatArray
    peak_speed: FloatArray
    peak_power: FloatArray
    total_peak_power: float
    energy: FloatArray
    returned: FloatArray
    duration: float

    def __repr__(self) -> str:
        peak, rms = (
            ", ".join(f"{f:.1f}" for f in row) for row in (self.peak_force, self.rms_force)
        )
        return f"Demand(peak {peak} N, rms {rms} N, {self.energy.sum():.3g} J)"


def platform_state(motion: Motion, t: FloatArray) -> PlatformState:
    """Return where the platform is and how it moves, exactly.

    Args:
        motion: Of the carriages.
        t: Times from its start [s], shape (...); clamped to both ends.
    """
    path = motion.path
    if isinstance(path, TransferPath):
        state = motion.at(t)
        rates = state.carriages, state.velocity, state.acceleration
        return forward_rates(motion.machine.geometry, *rates)
    along = motion.profile.at(t)
    r = path.curve.derivatives(along[..., 0])
    speed, rate = along[..., 1, None], along[..., 2, None]
    velocity: FloatArray = r[..., 1, :] * speed
    acceleration: FloatArray = r[..., 1, :] * rate + r[..., 2, :] * speed**2
    return PlatformState(r[..., 0, :], velocity, acceleration)


def forward_rates(
    geometry: Geometry, carriages: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> PlatformState:
    """Carry the carriages' motion to the platform: forward kinematics with two derivatives.

    Args:
        geometry: Dimensions of the robot.
        carriages: [mm], shape (..., 3).
        velocity: Of the carriages [mm/s], the same shape.
        acceleration: Of the carriages [mm/s^2], the same shape.
    """
    position = forward(geometry, carriages)
    slopes = jacobian(geometry, position)
    moved = _solve(slopes, velocity)
    jets = np.stack([position, moved, np.zeros_like(moved)], axis=-2)
    bend = inverse_derivatives(geometry, jets)[..., 2, :]
    gained = _solve(slopes, acceleration - bend)
    return PlatformState(position, moved, gained)


def _solve(slopes: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the platform's rates for those of the carriages, (..., 3)."""
    return np.asarray(np.linalg.solve(slopes, rates[..., None])[..., 0], dtype=np.float64)


def motion_forces(motion: Motion, t: FloatArray) -> FloatArray:
    """Return the forces of the carriages: see ``Trajectory.forces``."""
    return carriage_forces(motion.machine, *platform_state(motion, t))


def measure_demand(motion: Motion) -> Demand:
    """Sample forces and speeds of a motion: see ``Trajectory.demand``."""
    count = int(min(max(np.ceil(motion.duration * _RATE), 1.0), _MOST))
    times = np.linspace(0.0, motion.duration, count + 1)
    forces, speeds = motion_forces(motion, times), motion.at(times).velocity
    power = _WATT * forces * speeds
    step = motion.duration / count
    square = _integrate(forces**2, step) / motion.duration
    return Demand(
        peak_force=read_only(np.abs(forces).max(axis=0)),
        rms_force=read_only(np.sqrt(square)),
        peak_speed=read_only(np.abs(speeds).max(axis=0)),
        peak_power=read_only(power.max(axis=0)),
        total_peak_power=float(power.sum(axis=-1).max()),
        energy=read_only(_integrate(np.maximum(power, 0.0), step)),
        returned=read_only(_integrate(np.maximum(-power, 0.0), step)),
        duration=motion.duration,
    )


def _integrate(values: FloatArray, step: float) -> FloatArray:
    """Integrate along the first axis, by trapezia."""
    total: FloatArray = step * (values.sum(axis=0) - 0.5 * (values[0] + values[-1]))
    return total
