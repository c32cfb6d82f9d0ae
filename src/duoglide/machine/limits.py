"""What the carriages may do."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import FloatArray, read_only
from duoglide.machine import rules
from duoglide.machine.meaning import documented, told, unit_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_NAMES = ("velocity", "acceleration", "jerk", "force", "rms_force")
_MAY_BE_NONE = ("jerk", "force", "rms_force")


@documented
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CarriageLimits:
    """Limits of the three carriages, each a scalar or one value per carriage.

    Raises:
        ConfigError: A value is not above zero, or not finite; a jerk or a force may be infinite.
    """

    velocity: FloatArray = field(
        default_factory=lambda: np.full(3, 4000.0),
        metadata=told("the largest velocity, one for all carriages or one for each", "mm/s"),
    )
    acceleration: FloatArray = field(
        default_factory=lambda: np.full(3, 60e3),
        metadata=told("the largest acceleration, likewise", "mm/s^2"),
    )
    jerk: FloatArray = field(
        default_factory=lambda: np.full(3, 3e6),
        metadata=told("the largest jerk; inf: no limit", "mm/s^3"),
    )
    force: FloatArray = field(
        default_factory=lambda: np.full(3, np.inf),
        metadata=told("the largest force, with machine.masses; inf: no limit", "N"),
    )
    rms_force: FloatArray = field(
        default_factory=lambda: np.full(3, np.inf),
        metadata=told(
            "the largest root mean square of the force over a motion, which is what heats a motor; "
            "inf: no limit",
            "N",
        ),
    )

    if TYPE_CHECKING:  # a scalar or a list is as welcome as an array

        def __init__(
            self,
            *,
            velocity: ArrayLike = ...,
            acceleration: ArrayLike = ...,
            jerk: ArrayLike = ...,
            force: ArrayLike = ...,
            rms_force: ArrayLike = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        for name in _NAMES:
            unit = unit_of(CarriageLimits, name)
            given = getattr(self, name)
            values = rules.per_carriage(name, given, unit, or_none=name in _MAY_BE_NONE)
            object.__setattr__(self, name, read_only(np.array(values)))

    def _key(self) -> bytes:
        return np.concatenate([getattr(self, name) for name in _NAMES]).tobytes()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CarriageLimits) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def within(self, seconds: float) -> CarriageLimits:
        """Return these limits with a jerk for each carriage that has no limit of it.

        Args:
            seconds: In which its acceleration may then go from none to its limit.
        """
        reached = self.acceleration / seconds
        jerk = np.where(np.isinf(self.jerk), reached, self.jerk)
        return replace(self, jerk=jerk)

    def scaled(self, factor: float) -> CarriageLimits:
        """Return these limits times ``factor``, in every derivative; forces stay."""
        return replace(
            self,
            velocity=self.velocity * factor,
            acceleration=self.acceleration * factor,
            jerk=self.jerk * factor,
        )


STOP_RESERVE = 1.5  # in acceleration, jerk and force


class DerivedLimits(CarriageLimits):
    """Stop limits that follow the machine's limits, because nobody has set them.

    A type of its own, so that ``dataclasses.replace(machine, limits=...)`` takes them along.
    """

    __slots__ = ()

    @classmethod
    def of(cls, limits: CarriageLimits) -> DerivedLimits:
        """Return ``limits`` with a reserve of acceleration, jerk and force to stop with."""
        return cls(
            velocity=limits.velocity,
            acceleration=limits.acceleration * STOP_RESERVE,
            jerk=limits.jerk * STOP_RESERVE,
            force=limits.force * STOP_RESERVE,
        )
