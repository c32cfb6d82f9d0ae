"""How a trajectory's timing came about: what a plan says of itself beside the motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from duoglide.errors import printable


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
    """

    method: TimingMethod = TimingMethod.NEAR_OPTIMAL
    reason: str = ""
    brake_safe: bool = False
    duration_before_braking: float = 0.0
    braking_clearance: float = float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values that ``from_dict`` reads back; NaN becomes None, as JSON has none."""
        values = asdict(self)
        values["method"] = self.method.value
        if self.braking_clearance != self.braking_clearance:
            values["braking_clearance"] = None
        return values

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> TimingReport:
        """Build the report that ``to_dict`` described."""
        values = dict(document)
        values["method"] = TimingMethod(values["method"])
        values["reason"] = printable(values["reason"])  # it is shown to people, as an audit
        if values["braking_clearance"] is None:
            values["braking_clearance"] = float("nan")
        return cls(**values)
