"""Conversion between mm along +y and a drive's increments: here and nowhere else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.machine import DriveSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

_LARGEST = (1 << 31) - 1
_LARGEST_UNSIGNED = (1 << 32) - 1
_ROUNDING = 0.01  # share that rounding to a drive's unit may change an acceleration by


@dataclass(frozen=True, slots=True)
class Scale:
    """Conversion between mm along +y and a drive's increments.

    Attributes:
        increments_per_mm: Negative where the drive counts against +y.
    """

    increments_per_mm: float

    @classmethod
    def of(cls, settings: DriveSettings, number: int) -> Scale:
        """Return the scale of axis 1, 2 or 3."""
        i = number - 1
        return cls(settings.direction[i] * settings.increments_per_mm[i])

    def to_increments(self, mm: float) -> int:
        """Round a position to the nearest increment.

        Raises:
            LimitError: It does not fit the 32 bits of 0x607A.
        """
        increments = round(mm * self.increments_per_mm)
        if abs(increments) > _LARGEST:
            most = _LARGEST / abs(self.increments_per_mm)
            raise LimitError(f"position {mm:g} mm is beyond what a drive can count, {most:g} mm")
        return increments

    def to_increments_all(self, mm: FloatArray) -> NDArray[np.int64]:
        """Round many positions at once, as ``to_increments`` does one."""
        increments = np.rint(mm * self.increments_per_mm)
        if np.any(np.abs(increments) > _LARGEST):
            most = _LARGEST / abs(self.increments_per_mm)
            raise LimitError(f"a position is beyond what a drive can count, {most:g} mm")
        return increments.astype(np.int64)

    def to_mm(self, increments: float) -> float:
        """Return the position that an increment count means [mm]."""
        return increments / self.increments_per_mm

    def magnitude(self, mm: float) -> int:
        """Round a distance, speed or acceleration, which have no direction; at least 1.

        Raises:
            LimitError: It does not fit 32 bits: the drive could not be told.
        """
        increments = max(1, round(abs(mm * self.increments_per_mm)))
        if increments > _LARGEST_UNSIGNED:
            most = _LARGEST_UNSIGNED / abs(self.increments_per_mm)
            raise LimitError(
                f"{mm:g} (in mm) is beyond what a drive can be told, {most:g}, at"
                f" {abs(self.increments_per_mm):g} increments per mm"
            )
        return increments


@dataclass(frozen=True, slots=True)
class RateUnits:
    """What one unit of a drive's velocities and accelerations means, which have no direction here.

    Attributes:
        velocity: Of 0x606C, 0x607F and 0x6099 [mm/s].
        acceleration: Of 0x6085 and 0x609A [mm/s^2].
    """

    velocity: float
    acceleration: float

    @property
    def most_speed(self) -> float:
        """Greatest velocity that 32 bits with a sign hold [mm/s]."""
        return _LARGEST * self.velocity

    def speed(self, mm_per_s: float, key: str) -> int:
        """Return a velocity as the drive has it; at least 1.

        Args:
            mm_per_s: The velocity [mm/s].
            key: Of the machine file that says it, for errors.

        Raises:
            LimitError: It does not fit 32 bits.
        """
        return _whole(mm_per_s, self.velocity, f"{key} [mm/s]", "velocity_unit")

    def ramp(self, mm_per_s2: float, key: str) -> int:
        """Return an acceleration as the drive has it; at least 1.

        Args:
            mm_per_s2: The acceleration [mm/s^2].
            key: Of the machine file that says it, for errors.

        Raises:
            LimitError: It does not fit 32 bits, or the drive's unit is so coarse that it would be
                another one by more than a hundredth.
        """
        count = _whole(mm_per_s2, self.acceleration, f"{key} [mm/s^2]", "acceleration_unit")
        if abs(count * self.acceleration - mm_per_s2) > _ROUNDING * mm_per_s2:
            raise LimitError(
                f"{key} = {mm_per_s2:g} mm/s^2 would become {count * self.acceleration:g}: the"
                f" drive knows multiples of {self.acceleration:g} mm/s^2 only, choose one of them;"
                " or drives.quirks acceleration_unit is not what one unit of it means"
            )
        return count


def _whole(value: float, unit: float, name: str, key: str) -> int:
    count = max(1, round(value / unit))
    if count > _LARGEST_UNSIGNED:
        raise LimitError(
            f"{name} = {value:g} is beyond what a drive can be told, {_LARGEST_UNSIGNED * unit:g},"
            f" in units of {unit:g}: lower it, or drives.quirks {key} is not what one unit means"
        )
    return count
