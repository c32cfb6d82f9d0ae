"""Motion: a curve of the carriages, and how far along it they are at every instant."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_floats, as_number
from duoglide.errors import InputError
from duoglide.machine import Machine
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.path.segments import show
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import Profile
from duoglide.motion.timing_report import TimingReport

_STILL = 1e-6  # mm/s
_MOST_SAMPLES = 10_000_000  # some gigabytes


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """State of the carriages at one time, or at many.

    Attributes:
        carriages: Positions along the rails [mm], shape (..., 3).
        velocity: [mm/s], shape (..., 3).
        acceleration: [mm/s^2], shape (..., 3).
        jerk: [mm/s^3], shape (..., 3).
    """

    carriages: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    def __repr__(self) -> str:
        if self.carriages.ndim > 1:
            return f"State({' x '.join(map(str, self.carriages.shape[:-1]))} times)"
        units = ("mm", "mm/s", "mm/s²", "mm/s³")
        rows = (self.carriages, self.velocity, self.acceleration, self.jerk)
        return f"State({', '.join(f'{show(row)} {u}' for row, u in zip(rows, units, strict=True))})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Motion:
    """A curve of the carriages with a profile on it; evaluated exactly, by the chain rule.

    This is what timing makes. A ``Trajectory`` is a motion that may be slowed down and stopped.

    Attributes:
        path: The curve of the carriages: along a checked path, or a transfer between poses.
        profile: How far along it the motion is, by time.
        report: How the timing came about.
    """

    path: CarriagePath | TransferPath
    profile: Profile
    report: TimingReport = field(default_factory=TimingReport, kw_only=True)

    @property
    def machine(self) -> Machine:
        """The machine that this was planned for."""
        return self.path.machine

    @property
    def duration(self) -> float:
        """How long the motion takes [s]."""
        return self.profile.duration

    @property
    def starts_at_rest(self) -> bool:
        """Whether velocity and acceleration are zero at the start."""
        return _rests(self.at(0.0))

    @property
    def ends_at_rest(self) -> bool:
        """Whether velocity and acceleration are zero at the end."""
        return _rests(self.at(self.duration))

    @property
    def start(self) -> FloatArray:
        """Carriages at the start [mm], shape (3,)."""
        return self.at(0.0).carriages

    @property
    def end(self) -> FloatArray:
        """Carriages at the end [mm], shape (3,)."""
        return self.at(self.duration).carriages

    def at(self, t: float | ArrayLike) -> State:
        """Return the state at time ``t``, clamped to both ends.

        Args:
            t: Time from the start [s], any shape (...).

        Raises:
            InputError: Not a finite number.
        """
        if isinstance(t, float) and isfinite(t):
            sigma, *rates = self.profile.at_time(t)
            return _differentiate(self.path.derivatives(sigma), *rates)
        along = self.profile.at(as_floats(t, "t"))
        speed, rate, third = (along[..., k, None] for k in range(1, 4))
        return _differentiate(self.path.derivatives(along[..., 0]), speed, rate, third)

    def payload_at(self, t: ArrayLike) -> FloatArray:
        """Return what the platform carries at time ``t`` [kg], shape (...).

        Raises:
            InputError: Not a finite number.
        """
        times = as_floats(t, "t")
        if isinstance(self.path, TransferPath):
            return np.full(times.shape, self.machine.masses.payload)
        return self.path.checked.payload_at(self.profile.at(times)[..., 0])

    def position_at(self, t: ArrayLike) -> FloatArray:
        """Return the platform centre O' in the base frame at time ``t`` [mm], shape (..., 3).

        Raises:
            InputError: Not a finite number.
        """
        sigma = self.profile.at(as_floats(t, "t"))[..., 0]
        return self.path.position(sigma)

    def sample(self, period: float) -> tuple[FloatArray, State]:
        """Return evenly spaced times from 0, with the end as the last one, and the states there.

        Args:
            period: Between two samples [s]; the last step may be shorter.

        Raises:
            InputError: Not a finite number above zero, or so small that there would be more than
                ten million samples.
        """
        step = as_number(period, "period")
        if step <= 0.0:
            raise InputError(f"period = {step:g} s: must be above zero")
        if self.duration > _MOST_SAMPLES * step:
            raise InputError(
                f"period = {step:g} s: makes more than {_MOST_SAMPLES} samples of {self.duration:g}"
                f" s; take at least {self.duration / _MOST_SAMPLES:.3g} s, or parts of it with at()"
            )
        count = int(np.ceil(self.duration / step * (1.0 - 1e-12)))
        times = np.minimum(np.arange(count + 1) * step, self.duration)
        return times, self.at(times)


def _rests(state: State) -> bool:
    """Whether nothing moves but by rounding."""
    return bool(
        np.abs(state.velocity).max() < _STILL and np.abs(state.acceleration).max() < 1e3 * _STILL
    )


def _differentiate(q: FloatArray, speed: Any, rate: Any, third: Any) -> State:
    """Differentiate q(sigma(t)) by time, by the chain rule."""
    q1, q2, q3 = q[..., 1, :], q[..., 2, :], q[..., 3, :]
    square = speed * speed
    return State(
        q[..., 0, :],
        q1 * speed,
        q1 * rate + q2 * square,
        q1 * third + q2 * (3.0 * speed * rate) + q3 * (square * speed),
    )
