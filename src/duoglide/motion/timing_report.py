"""How a trajectory's timing came about: what a plan says of itself beside the motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any

from duoglide.errors import printable

_BRAKING = ("braking_clearance", "braking_carriage_margin")  # NaN where not looked at


class TimingMethod(StrEnum):
    """Which stage made the profile."""

    NEAR_OPTIMAL = "near-optimal"
    TOPPRA = "toppra"
    RUCKIG = "ruckig"
    IN_PART = "near-optimal in part"
    CERTIFIED_SLOW = "certified, slower"
    TRANSFER = "transfer"
    RECORDED = "recorded"  # the pace of a run, whose changes may have used the stop limits


@dataclass(frozen=True, slots=True, kw_only=True)
class TimingReport:
    """How a trajectory was timed.

    Attributes:
        method: Which stage made the profile.
        reason: Why it is not the near-optimal one, all of it; empty where it is.
        brake_safe: Whether the plan was slowed so that drives may brake by themselves anywhere.
        duration_before_braking: Duration without that slow-down [s]; 0 where there was none.
        braking_clearance: Least clearance while every drive brakes by itself [mm], a lower bound
            that is certain between samples too; NaN where that was not looked at.
        braking_carriage_margin: Likewise, the least carriage margin [mm].
    """

    method: TimingMethod = TimingMethod.NEAR_OPTIMAL
    reason: str = ""
    brake_safe: bool = False
    duration_before_braking: float = 0.0
    braking_clearance: float = float("nan")
    braking_carriage_margin: float = float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values that ``from_dict`` reads back; NaN becomes None, as JSON has none."""
        values = asdict(self)
        values["method"] = self.method.value
        return values | {name: None for name in _BRAKING if values[name] != values[name]}

    def without_braking(self) -> TimingReport:
        """Return the report of a motion whose drives' own stops have not been looked at."""
        nan = float("nan")
        return replace(self, brake_safe=False, braking_clearance=nan, braking_carriage_margin=nan)

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> TimingReport:
        """Build the report that ``to_dict`` described.

        Raises:
            TypeError: The reason is no text, or a name is unknown.
            KeyError, ValueError: The method is missing, or unknown.
        """
        values = dict(document)
        if not isinstance(values["reason"], str):
            raise TypeError("reason: it is no text")
        values["method"] = TimingMethod(values["method"])
        values["reason"] = printable(values["reason"])  # it is shown to people, as an audit
        nothing = [name for name in _BRAKING if values.get(name) is None]
        values |= dict.fromkeys(nothing, float("nan"))
        return cls(**values)
