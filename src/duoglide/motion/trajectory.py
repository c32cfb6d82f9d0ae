"""The motion of the three carriages in time: what is streamed, logged and replayed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_floats, as_number
from duoglide.errors import DuoglideError, InputError
from duoglide.machine import Machine
from duoglide.motion.actions import Action, action_from_dict
from duoglide.motion.carriage_path import CarriagePath, map_to_carriages
from duoglide.motion.checked import CheckedPath
from duoglide.motion.path_segments import show
from duoglide.motion.profile import Profile
from duoglide.motion.stopping import StopBounds
from duoglide.motion.timing_report import TimingReport
from duoglide.motion.transfer_path import TransferPath

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from duoglide.motion.audit import Audit

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
class Trajectory:
    """A certified curve with a profile on it; evaluated exactly, by the chain rule.

    Attributes:
        path: The curve of the carriages: along a checked path, or a transfer between poses.
        profile: How far along it the motion is, by time.
        stops: How fast the rate of the motion may be changed while it runs.
        actions: What to do on the way: (time [s], action), in order.
        report: How the timing came about.
        whole: Where this ends in motion, because another trajectory takes over: the trajectory to
            rest that it is the first part of. Run that if no other one comes.
    """

    path: CarriagePath | TransferPath
    profile: Profile
    stops: StopBounds
    actions: tuple[tuple[float, Action], ...] = ()
    report: TimingReport = field(default_factory=TimingReport)
    whole: Trajectory | None = None

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
            return _chain(self.path.derivatives(sigma), *rates)
        motion = self.profile.at(as_floats(t, "t"))
        speed, rate, third = (motion[..., k, None] for k in range(1, 4))
        return _chain(self.path.derivatives(motion[..., 0]), speed, rate, third)

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

    def until(self, knot: int, stops: StopBounds) -> Trajectory:
        """Return the part up to a knot of the profile, where another trajectory takes over.

        Args:
            knot: Index of the knot; not the first one.
            stops: Bounds of changes that begin in this part; they may end after it, on the whole.
        """
        profile = self.profile.until(knot)
        passed = tuple(entry for entry in self.actions if entry[0] < profile.duration)
        return replace(self, profile=profile, stops=stops, actions=passed, whole=self)

    def audit(self) -> Audit:
        """Measure the worst use of each limit on finite differences of the positions, at 20 kHz.

        The step is longer where the limits are so low that rounding would look like jerk.
        """
        from duoglide.motion.audit import audit

        return audit(self)

    def lower_bound(self) -> float:
        """Return a duration that no motion along this curve can beat [s]: toppra, without jerk.

        Raises:
            LimitError: toppra finds no bound.
        """
        from duoglide.motion.lower_bound import lower_bound

        return lower_bound(self)

    def to_document(self) -> dict[str, Any]:
        """Return plain numbers, text and lists that ``from_document`` reads back exactly."""
        if self.whole is not None:
            knot = len(self.profile.knots) - 1
            return {
                "whole": self.whole.to_document(),
                "knot": knot,
                "stops": self.stops.to_dict(),
            }
        return {
            **_describe(self.path),
            "profile": self.profile.knots.tolist(),
            "stops": self.stops.to_dict(),
            "actions": [[t, action.to_dict()] for t, action in self.actions],
            "report": self.report.to_dict(),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Trajectory:
        """Rebuild the trajectory that ``to_document`` described, to the last bit.

        Raises:
            InputError: Not such a document.
            ConfigError: Its machine breaks a rule.
        """
        try:
            if "whole" in document:
                whole = cls.from_document(document["whole"])
                return whole.until(int(document["knot"]), StopBounds.from_dict(document["stops"]))
            return cls(
                path=_path_of(document),
                profile=Profile(document["profile"]),
                stops=StopBounds.from_dict(document["stops"]),
                actions=tuple((float(t), action_from_dict(a)) for t, a in document["actions"]),
                report=TimingReport.from_dict(document["report"]),
            )
        except DuoglideError:
            raise
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a trajectory: {error!r}") from error

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the plan to an MCAP file, with samples of the motion for pictures.

        Raises:
            LogError: The file cannot be written.
        """
        from duoglide.motion.plan_file import save

        save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read the plan from an MCAP file: a plan, or a run, which holds its plan.

        Raises:
            LogError: The file cannot be read, or holds no plan.
        """
        from duoglide.motion.plan_file import load

        return load(path)

    def plot(self) -> Figure:
        """Draw the carriages, velocities, accelerations and jerks against their limits.

        Returns:
            A matplotlib figure; a notebook shows it, ``savefig`` writes it.
        """
        from duoglide.motion.trajectory_picture import plot

        return plot(self)

    def _repr_html_(self) -> str:
        from duoglide.motion.trajectory_picture import trajectory_html

        return trajectory_html(self)

    def __repr__(self) -> str:
        note = f", {self.report.method.value}: {self.report.reason}" if self.report.reason else ""
        return f"Trajectory({self.duration:.4f} s, {self.path.length:.4g} mm{note})"


def _rests(state: State) -> bool:
    """Whether nothing moves but by rounding."""
    return bool(
        np.abs(state.velocity).max() < _STILL and np.abs(state.acceleration).max() < 1e3 * _STILL
    )


def _describe(path: CarriagePath | TransferPath) -> dict[str, Any]:
    """Describe the curve under a key that says which kind it is."""
    if isinstance(path, TransferPath):
        return {"transfer": path.to_dict()}
    return {"checked": path.checked.to_dict()}


def _path_of(document: Mapping[str, Any]) -> CarriagePath | TransferPath:
    """Rebuild what ``_describe`` described."""
    if "transfer" in document:
        return TransferPath.from_dict(document["transfer"])
    return map_to_carriages(CheckedPath.from_dict(document["checked"]))


def _chain(q: FloatArray, speed: Any, rate: Any, third: Any) -> State:
    """Differentiate q(sigma(t)) by time, by the chain rule."""
    q1, q2, q3 = q[..., 1, :], q[..., 2, :], q[..., 3, :]
    square = speed * speed
    return State(
        q[..., 0, :],
        q1 * speed,
        q1 * rate + q2 * square,
        q1 * third + q2 * (3.0 * speed * rate) + q3 * (square * speed),
    )
