"""Whole increments of the drives from mm of the carriages, and back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray

if TYPE_CHECKING:
    from duoglide.machine import DriveSettings


@dataclass(frozen=True, slots=True)
class Scale:
    """Signed increments per mm of each axis."""

    factors: tuple[float, float, float]

    @classmethod
    def of(cls, drives: DriveSettings) -> Scale:
        """Return the scale of a machine's drives: increments per mm times direction."""
        a, b, c = (k * s for k, s in zip(drives.increments_per_mm, drives.direction, strict=True))
        return cls((a, b, c))

    @property
    def resolution(self) -> float:
        """Size of the coarsest increment [mm]."""
        return 1.0 / min(map(abs, self.factors))

    def increments(self, carriages: FloatArray) -> NDArray[np.int64]:
        """Round carriages [mm] to increments, shape (..., 3)."""
        rounded: NDArray[np.int64] = np.rint(carriages * np.array(self.factors)).astype(np.int64)
        return rounded

    def millimetres(self, increments: NDArray[np.int64]) -> FloatArray:
        """Return carriages [mm] from increments, shape (..., 3)."""
        result: FloatArray = np.asarray(increments) / np.array(self.factors)
        return result

    def triple(self, carriages: FloatArray) -> tuple[int, int, int]:
        """Round one row of carriages [mm] to increments, as the cycle needs them."""
        (a, b, c), (x, y, z) = self.factors, carriages.tolist()
        return round(x * a), round(y * b), round(z * c)

    def millimetres_of(self, axis: int, increments: int) -> float:
        """Return the position of one axis, counted from 0 [mm]."""
        return increments / self.factors[axis]
