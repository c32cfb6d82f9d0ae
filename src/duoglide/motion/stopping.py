"""The stop bounds that a plan carries: how fast its path time may change pace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from duoglide.arrays import FloatArray, as_floats, as_number, read_only
from duoglide.errors import InputError


class RateBounds(NamedTuple):
    """What one change of the path rate r = du/dtau may use.

    Attributes:
        slope: R1, bound of abs(dr/dtau) [1/s].
        bend: R2, bound of abs(d2r/dtau2) [1/s^2].
        until: Path time up to which both are certified [s].
    """

    slope: float
    bend: float
    until: float


@dataclass(frozen=True, slots=True, eq=False)
class StopBounds:
    """Certified bounds of any change of the path rate, by the path time at which it begins.

    A change of the rate r in [0, 1] (feed hold, resume, override, stop) that begins in cell k,
    keeps abs(dr/dtau) <= slope[k] and abs(d2r/dtau2) <= bend[k], and ends at or before path time
    until[k], keeps every carriage within ``machine.stop_limits``.

    Attributes:
        duration: Of the trajectory [s]; the cells divide it evenly.
        slope: R1 of each cell [1/s], shape (n,).
        bend: R2 of each cell [1/s^2], shape (n,).
        until: How far each cell's bounds reach in path time [s], shape (n,).

    Raises:
        InputError: Shapes differ, a bound is not finite and above zero, or a stop from full rate
            out of a cell would end after the cell's ``until``.
    """

    duration: float
    slope: FloatArray
    bend: FloatArray
    until: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "duration", as_number(self.duration, "duration"))
        if self.duration < 0.0:
            raise InputError(f"duration = {self.duration:g} s: must not be negative")
        for name in ("slope", "bend", "until"):
            array = read_only(as_floats(getattr(self, name), name))
            object.__setattr__(self, name, array)
        if self.slope.ndim != 1 or not self.slope.size:
            raise InputError(f"slope must have shape (n,) with n >= 1, got {self.slope.shape}")
        if not self.slope.shape == self.bend.shape == self.until.shape:
            raise InputError("slope, bend and until must have the same shape")
        if np.any(self.slope <= 0.0) or np.any(self.bend <= 0.0):
            raise InputError("every slope and bend must be above zero")
        ends = self.duration * np.arange(1, self.slope.size + 1) / self.slope.size
        need = np.minimum(ends + 0.5 * self.stop_times(), self.duration)
        if np.any(self.until < need):
            k = int(np.argmax(need - self.until))
            raise InputError(f"until[{k}] = {self.until[k]:g} s: a stop needs {need[k]:g} s")

    @classmethod
    def constant(cls, duration: float, slope: float, bend: float) -> StopBounds:
        """Return one pair of bounds for the whole trajectory."""
        end = [float(duration)]
        return cls(duration, *_columns(([float(slope)], [float(bend)], end)))

    def at(self, u: float) -> RateBounds:
        """Return the bounds of a change that begins at path time ``u`` [s]; clamped to the ends."""
        cells = self.slope.size
        cell = int(u / self.duration * cells) if self.duration > 0.0 else 0
        cell = min(max(cell, 0), cells - 1)
        return RateBounds(float(self.slope[cell]), float(self.bend[cell]), float(self.until[cell]))

    def stop_times(self) -> FloatArray:
        """Return how long a stop from full rate takes, by the cell where it begins [s], (n,)."""
        return change_time(self.slope, self.bend)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StopBounds) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash((self.duration, self.slope.tobytes(), self.bend.tobytes()))

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and lists that ``from_dict`` reads back exactly."""
        return {
            "duration": self.duration,
            "slope": self.slope.tolist(),
            "bend": self.bend.tolist(),
            "until": self.until.tolist(),
        }

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> StopBounds:
        """Build the bounds that ``to_dict`` described.

        Raises:
            InputError: A key is missing or a bound is impossible.
        """
        try:
            lists = (document["slope"], document["bend"], document["until"])
            return cls(document["duration"], *_columns(lists))
        except KeyError as error:
            raise InputError(f"stop bounds lack the key {error}") from error


def change_time(slope: FloatArray, bend: FloatArray) -> FloatArray:
    """Return the least time in which the rate goes from 1 to 0 or back under R1 and R2 [s]."""
    slow = 1.0 / slope + slope / bend
    quick = 2.0 / np.sqrt(bend)
    result: FloatArray = np.where(slope * slope < bend, slow, quick)
    return result


def _columns(lists: Sequence[Any]) -> tuple[FloatArray, FloatArray, FloatArray]:
    slope, bend, until = (np.asarray(values, dtype=np.float64) for values in lists)
    return slope, bend, until
