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
