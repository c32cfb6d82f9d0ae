"""What stands around the machine."""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.errors import ConfigError
from duoglide.machine import rules


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A box with sides along x, y and z that the platform's centre must stay out of [mm].

    Attributes:
        low: Its corner with the smallest coordinates.
        high: Its corner with the largest.
        name: What to call it in an error.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    name: str = "box"

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", rules.triple("low", self.low))
        object.__setattr__(self, "high", rules.triple("high", self.high))
        if not isinstance(self.name, str):
            raise ConfigError(f"name = {self.name!r:.80}: must be text")
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if low >= high:
                raise ConfigError(f"low = {self.low}: {axis} must be below {high:g} mm")
