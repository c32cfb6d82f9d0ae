"""The dimensions of the mechanism."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import hypot
from typing import Any

from duoglide.errors import ConfigError
from duoglide.machine import rules
from duoglide.machine.meaning import documented, setting

_ANY_SIGN = ("riser_height", "arm_drop", "strut_drop", "carriage_height", "platform_half_width")


class Remembering:
    """Room for what is computed once from a value that never changes.

    No field: what is remembered is neither compared, printed, pickled nor taken along by
    ``dataclasses.replace``. Each slot is filled by whoever needs it, and missing until then.
    """

    __slots__ = ("carriage_constants", "pose_constants")
    carriage_constants: dict[int, Any]
    pose_constants: dict[int, Any]


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Geometry(Remembering):
    """Dimensions of the robot [mm]; Table 1 of [Shen2021]_ by default.

    Raises:
        ConfigError: A length is not a finite number, breaks its sign, or the links cannot close.
    """

    rail_half_length: float = setting(
        360.0, "a, half the length of a rail; the carriages' travel is +-a", "mm"
    )
    rail_half_spacing: float = setting(
        90.0, "b, half the distance between the rails (rail I at x = +b)", "mm"
    )
    platform_half_width: float = setting(45.0, "d, half the width ST of the platform", "mm")
    carriage_height: float = setting(70.0, "l1, height of the joints B over the rail", "mm")
    leg_length: float = setting(160.0, "l2, the legs B1C1 and B2C2", "mm")
    coupler_length: float = setting(120.0, "l3, the coupler C1C2", "mm")
    riser_height: float = setting(0.0, "l4, the riser D1D2", "mm")
    arm_length: float = setting(180.0, "l6, the arm D2E2, long side of parallelogram 1", "mm")
    arm_drop: float = setting(0.0, "l7, height of the platform over E2", "mm")
    strut_drop: float = setting(0.0, "l8, height of the platform over C3", "mm")
    strut_length: float = setting(300.0, "l9, the strut B3C3, long side of parallelogram 2", "mm")

    def __post_init__(self) -> None:
        for field in fields(self):
            rule = rules.number if field.name in _ANY_SIGN else rules.positive
            object.__setattr__(self, field.name, rule(field.name, getattr(self, field.name)))
        self._require_closure()

    def _require_closure(self) -> None:
        """Refuse dimensions for which no pose exists.

        In the xz plane C3 lies on a circle of radius l6 about a point that the legs lift through
        2 l2, and within l9 of B3.
        """
        across = 2.0 * (self.rail_half_spacing - self.platform_half_width)
        lift = self.riser_height + self.arm_drop - self.strut_drop
        nearest = hypot(across, max(abs(lift) - self.leg_length, 0.0))
        farthest = hypot(across, abs(lift) + self.leg_length)
        gap = max(nearest - self.arm_length, self.arm_length - farthest) - self.strut_length
        if gap > 0.0:
            raise ConfigError(
                f"strut_length = {self.strut_length:g}: must be above"
                f" {self.strut_length + gap:.6g} mm with the other dimensions;"
                " no pose of the platform closes the links"
            )
