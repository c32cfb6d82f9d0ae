"""What limits the workspace."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

from duoglide.errors import InputError
from duoglide.machine import Machine


@dataclass(frozen=True, slots=True)
class Range:
    """A closed interval; unlimited by default.

    Raises:
        InputError: The ends are not numbers in rising order.
    """

    low: float = -inf
    high: float = inf

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise InputError(f"range from {self.low} to {self.high}: the ends must rise")


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraints:
    """Limits beyond the lengths of the links; without arguments, none.

    Attributes:
        travel: The carriages stay within +-travel on their rails [mm].
        carriage_width: Distance that carriages 1 and 2 keep [mm].
        clearance: Distance to keep from singular surfaces and edges of reach [mm].
        link_radius: Links that share no joint are capsules of this radius that keep off each other
            [mm]; 0: not looked at. A parallelogram counts as its centre line.
        leg_angle: Range of the legs' angle over the rail, asin(h / l2) [rad].
        arm_angle: Range of beta [rad].
        strut_swing: Range of the revolute R32, atan2(X, Z) [rad].
        strut_tilt: Range of parallelogram 2, asin((yA3 - y) / l9) [rad].
        beyond_case_2: Whether to keep what lies beyond the arm in line with the strut, where the
            forward solution is n = -1; a machine cannot get there.
    """

    travel: float = inf
    carriage_width: float = 0.0
    clearance: float = 0.0
    link_radius: float = 0.0
    leg_angle: Range = field(default_factory=Range)
    arm_angle: Range = field(default_factory=Range)
    strut_swing: Range = field(default_factory=Range)
    strut_tilt: Range = field(default_factory=Range)
    beyond_case_2: bool = False

    def __post_init__(self) -> None:
        for name in ("travel", "carriage_width", "clearance", "link_radius"):
            if not getattr(self, name) >= 0.0:
                raise InputError(f"{name} = {getattr(self, name)}: must be 0 or above [mm]")

    @classmethod
    def of(cls, machine: Machine) -> Constraints:
        """Return what the machine file says: travel, carriage width and clearance."""
        return cls(
            travel=machine.geometry.rail_half_length,
            carriage_width=machine.carriage_width,
            clearance=machine.clearance,
        )
