"""Where a drive that brakes by itself may lead the other two along the path."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from duoglide.arrays import AXES

PROMISED = 1.0  # [mm] that the platform may leave its path by where staying on it is promised
LEAST_STEP = 0.02  # [mm] in a cycle of the plan by which a carriage still tells the path time


@dataclass(frozen=True, slots=True, kw_only=True)
class LedStops:
    """Where a drive that brakes by itself may lead the others along the path.

    Attributes:
        decelerations: What each drive brakes with [mm/s^2].
        limits: What each may be asked for while it follows another [mm/s^2].
        step: Between two entries, in path time [s].
        allowed: Bit i of entry k: drive i + 1 may lead if it begins to brake about path time
            ``k * step``.
        promised: Likewise, where the platform stays within ``PROMISED`` of its path.
    """

    decelerations: tuple[float, float, float]
    limits: tuple[float, float, float]
    step: float
    allowed: bytes
    promised: bytes

    def allow(self, index: int, u: float) -> bool:
        """Tell whether a drive (index) may lead that begins to brake at path time ``u`` [s]."""
        k = min(max(round(u / self.step), 0), len(self.allowed) - 1)
        return bool(self.allowed[k] >> index & 1)

    def promises(self, index: int, u: float) -> bool:
        """Tell whether the platform then stays within ``PROMISED`` of its path, at full rate."""
        k = min(max(round(u / self.step), 0), len(self.promised) - 1)
        return bool(self.promised[k] >> index & 1)

    @property
    def shares(self) -> tuple[float, float, float]:
        """Share of the duration in which that is promised, of each drive, 0 to 1."""
        count = len(self.promised)
        first, second, third = (
            sum(mask >> index & 1 for mask in self.promised) / count for index in range(AXES)
        )
        return first, second, third


def catch_up(gap: float, before: float, pace: float, most: float) -> float:
    """Return by how much path time goes on in the next cycle, behind a drive that brakes [s].

    The gap is closed as fast as may be, so that it can be closed without passing over; path time
    never goes back. Plain arithmetic, which is compiled too.

    Args:
        gap: From the newest setpoint to the drive's place at the end of the cycle [s].
        before: How far path time went on in the last cycle [s].
        pace: How far it goes on in a cycle at the drive's speed [s].
        most: By how much that may change from cycle to cycle [s].
    """
    away = abs(gap - pace)
    extra = min(0.5 * most * (sqrt(1.0 + 8.0 * away / most) - 1.0), away)
    wished = pace + extra if gap > pace else pace - extra
    return min(max(wished, before - most, 0.0), before + most)
