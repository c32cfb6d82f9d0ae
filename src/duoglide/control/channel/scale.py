"""The three drives' scales side by side; the conversion itself is ``drives.scale.Scale``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import AXES, FloatArray
from duoglide.drives.scale import Scale

if TYPE_CHECKING:
    from duoglide.machine import DriveSettings

IntTriple = tuple[int, int, int]
Triple = tuple[float, float, float]


def as_int_triple(row: NDArray[np.int64]) -> IntTriple:
    """Return one row of increments as the cycle needs it: plain whole numbers."""
    first, second, third = row.tolist()
    return first, second, third


@dataclass(frozen=True, slots=True)
class Scales:
    """Conversion between carriages [mm] and the increments of three drives."""

    axes: tuple[Scale, Scale, Scale]

    @classmethod
    def of(cls, drives: DriveSettings) -> Scales:
        """Return the scales of a machine's drives."""
        first, second, third = (Scale.of(drives, number) for number in range(1, AXES + 1))
        return cls((first, second, third))

    @property
    def resolution(self) -> float:
        """Size of the coarsest increment [mm]."""
        return max(abs(scale.to_mm(1)) for scale in self.axes)

    def increments(self, carriages: FloatArray) -> NDArray[np.int64]:
        """Round carriages [mm] to increments, shape (..., 3).

        Raises:
            LimitError: A position is beyond what a drive can count.
        """
        columns = [s.to_increments_all(carriages[..., i]) for i, s in enumerate(self.axes)]
        return np.stack(columns, axis=-1)

    def triple(self, carriages: FloatArray) -> IntTriple:
        """Round one row of carriages [mm], as the cycle needs it."""
        (a, b, c), (x, y, z) = self.axes, carriages.tolist()
        return a.to_increments(x), b.to_increments(y), c.to_increments(z)

    def mm(self, increments: IntTriple) -> Triple:
        """Return carriages [mm], or signed differences of them, from increments."""
        (a, b, c), (x, y, z) = self.axes, increments
        return a.to_mm(x), b.to_mm(y), c.to_mm(z)
