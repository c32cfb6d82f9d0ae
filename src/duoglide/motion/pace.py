"""The pace of a run: which path time of its plan was streamed at each instant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray, as_floats, read_only
from duoglide.errors import InputError
from duoglide.motion.profile import ACCELERATION, TIME, Profile

_PARTS = 4  # knots a cycle
_APART = 2e-5  # [s] at least between two knots
_ROUNDING = 1e-9  # [s], and as a share of the rate, that may be lost in a sum of cycles
_COLUMNS = ("times", "path_times", "rates")


@dataclass(frozen=True, slots=True, eq=False)
class Pace:
    """How a run went along its plan, never faster than planned.

    Attributes:
        times: From 0 on, increasing [s], shape (n,), n above 1.
        path_times: The path time that was reached then [s], shape (n,); it does not fall, and does
            not rise faster than the time.
        rates: Path time per time then, 0 to 1, shape (n,).

    Raises:
        InputError: Not such arrays.
    """

    times: FloatArray
    path_times: FloatArray
    rates: FloatArray

    def __post_init__(self) -> None:
        for name in _COLUMNS:
            array = read_only(as_floats(getattr(self, name), f"pace {name}"))
            object.__setattr__(self, name, array)
        shape = self.times.shape
        if len(shape) != 1 or shape[0] < 2 or {self.path_times.shape, self.rates.shape} != {shape}:
            raise InputError("the times, path_times and rates of a pace must have one shape (n,)")
        steps, ways = np.diff(self.times), np.diff(self.path_times)
        if self.times[0] != 0.0 or (steps <= 0.0).any():
            raise InputError("the times of a pace must begin at 0 and increase")
        wrong = (ways < 0.0) | (ways > steps + _ROUNDING)
        if wrong.any():
            k = int(np.argmax(wrong))
            raise InputError(
                f"the pace goes {ways[k]:g} s along its plan within {steps[k]:g} s, at"
                f" {self.times[k]:g} s: it must not go back, nor faster than planned"
            )
        if (self.rates < -_ROUNDING).any() or (self.rates > 1.0 + _ROUNDING).any():
            raise InputError("the rates of a pace must be 0 to 1")

    def profile_of(self, plan: Profile) -> Profile:
        """Return the profile that has the plan's sigma at these path times, exactly.

        In between, the path time is a smooth function of time, and the plan is followed at that
        path time: where the rate is 1 throughout, the profile is the plan's own.
        """
        u, rate = self.path_times, self.rates
        clock = np.column_stack([self.times, u, rate, np.zeros_like(u)])
        if len(clock) > 2:
            clock[1:-1, ACCELERATION] = _solve_accelerations(clock)
        pace = Profile(clock)
        fine = _refine_times(plan, pace)
        at, speed, slope, _ = np.moveaxis(pace.at(fine), -1, 0)
        given = np.searchsorted(fine, self.times)
        at[given], speed[given] = u, rate
        sigma, way, bend, _ = np.moveaxis(plan.at(at), -1, 0)
        return Profile(
            np.column_stack(
                [fine, np.maximum.accumulate(sigma), way * speed, bend * speed**2 + way * slope]
            )
        )

    def time_of(self, u: float) -> float:
        """Return when path time ``u`` [s] was reached or passed [s]; inf: never."""
        index = int(np.searchsorted(self.path_times, u))
        return float(self.times[index]) if index < self.times.size else float("inf")

    def slowed(self, override: float) -> Pace:
        """Return the same pace at a share of its speed, above 0 to 1."""
        return Pace(self.times / override, self.path_times, self.rates * override)

    def to_dict(self) -> dict[str, list[float]]:
        """Return plain lists that ``from_dict`` reads back exactly."""
        return {name: getattr(self, name).tolist() for name in _COLUMNS}

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> Pace:
        """Build the pace that ``to_dict`` described.

        Raises:
            InputError: A key is missing or a value is impossible.
        """
        try:
            return cls(*(document[name] for name in _COLUMNS))
        except KeyError as error:
            raise InputError(f"a pace lacks the key {error}") from error


def _refine_times(plan: Profile, pace: Profile) -> FloatArray:
    """Return the cycles' times, some in between, and where the plan begins another piece."""
    times = pace.knots[:, TIME]
    between = times[:-1, None] + np.diff(times)[:, None] * np.arange(1, _PARTS) / _PARTS
    inner = [pace.time_at(knot) for knot in plan.knots[1:-1, TIME].tolist()]
    wished = np.unique(np.concatenate([between.ravel(), inner]))
    near = np.searchsorted(times, wished).clip(1, len(times) - 1)
    apart = np.minimum(wished - times[near - 1], times[near] - wished) > _APART
    kept = wished[apart]
    kept = kept[np.concatenate([[True], np.diff(kept) > _APART])] if len(kept) else kept
    fine: FloatArray = np.sort(np.concatenate([times, kept]))
    return fine


def _solve_accelerations(knots: FloatArray) -> FloatArray:
    """Solve for inner accelerations that make the third derivative continuous, shape (n - 2,)."""
    from scipy.linalg import solve_banded

    times, sigma, v, a = knots.T
    h, way = np.diff(times), np.diff(sigma)
    at_start = 60.0 * way / h**3 - (36.0 * v[:-1] + 24.0 * v[1:]) / h**2
    at_end = 60.0 * way / h**3 - (24.0 * v[:-1] + 36.0 * v[1:]) / h**2
    right = at_start[1:] - at_end[:-1]
    right[0] += 3.0 / h[0] * a[0]
    right[-1] += 3.0 / h[-1] * a[-1]
    band = np.zeros((3, len(right)))
    band[0, 1:] = -3.0 / h[1:-1]
    band[1] = 9.0 / h[:-1] + 9.0 / h[1:]
    band[2, :-1] = -3.0 / h[1:-1]
    inner: FloatArray = solve_banded((1, 1), band, right)
    return inner
