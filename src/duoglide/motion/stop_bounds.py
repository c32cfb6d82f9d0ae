"""The stop bounds that a plan carries: how fast its path time may change pace."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from duoglide.arrays import FloatArray, as_floats, as_number, read_only
from duoglide.errors import InputError

_ROUNDING = 1e-12


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
class RateTable:
    """Bounds of a change of the path rate in one direction, by the cell where it begins.

    Attributes:
        slope: R1 of each cell [1/s], shape (n,).
        bend: R2 of each cell [1/s^2], shape (n,).
        until: How far each cell's bounds reach in path time [s], shape (n,).

    Raises:
        InputError: Shapes differ, or a bound is not finite and above zero.
    """

    slope: FloatArray
    bend: FloatArray
    until: FloatArray

    def __post_init__(self) -> None:
        for name in ("slope", "bend", "until"):
            array = read_only(as_floats(getattr(self, name), name))
            object.__setattr__(self, name, array)
        if self.slope.ndim != 1 or not self.slope.size:
            raise InputError(f"slope must have shape (n,) with n >= 1, got {self.slope.shape}")
        if not self.slope.shape == self.bend.shape == self.until.shape:
            raise InputError("slope, bend and until must have the same shape")
        if np.any(self.slope <= 0.0) or np.any(self.bend <= 0.0):
            raise InputError("every slope and bend must be above zero")

    def change_times(self) -> FloatArray:
        """Return how long a change between rest and full rate takes, by cell [s], shape (n,)."""
        return change_time(self.slope, self.bend)

    def to_dict(self) -> dict[str, list[float]]:
        """Return plain lists that ``from_dict`` reads back exactly."""
        return {name: getattr(self, name).tolist() for name in ("slope", "bend", "until")}

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> RateTable:
        """Build the table that ``to_dict`` described.

        Raises:
            InputError: A key is missing or a bound is impossible.
        """
        try:
            return cls(document["slope"], document["bend"], document["until"])
        except KeyError as error:
            raise InputError(f"stop bounds lack the key {error}") from error


@dataclass(frozen=True, slots=True, eq=False)
class StopBounds:
    """Certified bounds of any change of the path rate, by the path time at which it begins.

    A change of the rate r in [0, 1] (feed hold, resume, override, stop) that falls or rises
    throughout, begins in cell k, keeps abs(dr/dtau) <= slope[k] and abs(d2r/dtau2) <= bend[k] of
    the table of its direction, and ends at or before path time until[k], keeps every carriage
    within ``machine.stop_limits``.

    Attributes:
        duration: Of the trajectory [s]; the cells divide it evenly.
        falling: Bounds of a rate that falls: hold and stop.
        rising: Bounds of a rate that rises: resume.

    Raises:
        InputError: The tables differ in size, or a stop from full rate out of a cell would end
            after the cell's ``until``.
    """

    duration: float
    falling: RateTable
    rising: RateTable

    def __post_init__(self) -> None:
        object.__setattr__(self, "duration", as_number(self.duration, "duration"))
        if self.duration < 0.0:
            raise InputError(f"duration = {self.duration:g} s: must not be negative")
        if self.falling.slope.shape != self.rising.slope.shape:
            raise InputError("falling and rising must have as many cells")
        cells = self.falling.slope.size
        ends = self.duration * np.arange(1, cells + 1) / cells
        for name in ("falling", "rising"):
            table: RateTable = getattr(self, name)
            need = np.minimum(ends + 0.5 * table.change_times(), self.duration)
            short = need - table.until
            if np.any(short > _ROUNDING * self.duration):
                k = int(np.argmax(short))
                raise InputError(
                    f"{name}.until[{k}] = {table.until[k]:g} s: a change needs {need[k]:g} s"
                )

    def __repr__(self) -> str:
        return f"StopBounds({self.duration:.4f} s, {self.falling.slope.size} cells)"

    @classmethod
    def constant(cls, duration: float, slope: float, bend: float) -> StopBounds:
        """Return one pair of bounds for the whole trajectory, both ways."""
        one = [np.full(1, float(value)) for value in (slope, bend, duration)]
        table = RateTable(*one)
        return cls(duration, table, table)

    def falling_at(self, u: float) -> RateBounds:
        """Return the bounds of a fall that begins at path time ``u`` [s]; clamped to the ends."""
        return self._at(self.falling, u)

    def rising_at(self, u: float) -> RateBounds:
        """Return the bounds of a rise that begins at path time ``u`` [s]; clamped to the ends."""
        return self._at(self.rising, u)

    def _at(self, table: RateTable, u: float) -> RateBounds:
        cells = table.slope.size
        cell = int(u / self.duration * cells) if self.duration > 0.0 else 0
        cell = min(max(cell, 0), cells - 1)
        return RateBounds(
            float(table.slope[cell]), float(table.bend[cell]), float(table.until[cell])
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StopBounds) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        return hash((self.duration, self.falling.slope.tobytes(), self.rising.slope.tobytes()))

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and lists that ``from_dict`` reads back exactly."""
        return {
            "duration": self.duration,
            "falling": self.falling.to_dict(),
            "rising": self.rising.to_dict(),
        }

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> StopBounds:
        """Build the bounds that ``to_dict`` described.

        Raises:
            InputError: A key is missing or a bound is impossible.
        """
        try:
            falling, rising = (RateTable.from_dict(document[way]) for way in ("falling", "rising"))
            return cls(document["duration"], falling, rising)
        except KeyError as error:
            raise InputError(f"stop bounds lack the key {error}") from error


def change_time(slope: FloatArray, bend: FloatArray) -> FloatArray:
    """Return the least time in which the rate goes from 1 to 0 or back under R1 and R2 [s]."""
    slow = 1.0 / slope + slope / bend
    quick = 2.0 / np.sqrt(bend)
    result: FloatArray = np.where(slope * slope < bend, slow, quick)
    return result
