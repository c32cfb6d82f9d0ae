"""What stands around the machine."""

from __future__ import annotations

from dataclasses import dataclass, field

from duoglide.errors import ConfigError
from duoglide.machine import rules
from duoglide.machine.meaning import documented, setting, told


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A box with sides along x, y and z that the platform's centre must stay out of [mm]."""

    low: tuple[float, float, float] = field(
        metadata=told("its corner with the smallest coordinates", "mm")
    )
    high: tuple[float, float, float] = field(metadata=told("its corner with the largest", "mm"))
    name: str = setting("box", "what to call it in an error")

    def __post_init__(self) -> None:
        object.__setattr__(self, "low", rules.triple("low", self.low))
        object.__setattr__(self, "high", rules.triple("high", self.high))
        if not isinstance(self.name, str):
            raise ConfigError(f"name = {self.name!r:.80}: must be text")
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if low >= high:
                raise ConfigError(f"low = {self.low}: {axis} must be below {high:g} mm")
