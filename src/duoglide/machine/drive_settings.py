"""How the three drives are wired and scaled."""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.errors import ConfigError
from duoglide.machine import rules

BIT_RATES = (125_000, 250_000, 500_000, 800_000, 1_000_000)  # CiA 301, table 1


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSettings:
    """The three linear-axis drives, in the order of the carriages.

    Attributes:
        node_ids: CANopen node numbers, 1 to 127, all different.
        increments_per_mm: Position increments of the drive per mm, one value or three.
        direction: +1 or -1 per axis: whether the drive counts along +y.
        bit_rate: Bits per second on the bus.
        cycle: SYNC period and setpoint period [s].
        quick_stop_deceleration: 0x6085, what a drive brakes with by itself [mm/s^2].
        following_error_window: 0x6065 [mm].

    Raises:
        ConfigError: Names the key, the value and the rule.
    """

    node_ids: tuple[int, int, int] = (1, 2, 3)
    increments_per_mm: tuple[float, float, float] = (1000.0, 1000.0, 1000.0)
    direction: tuple[int, int, int] = (1, 1, 1)
    bit_rate: int = 1_000_000
    cycle: float = 0.002
    quick_stop_deceleration: tuple[float, float, float] = (60e3, 60e3, 60e3)
    following_error_window: float = 5.0

    def __post_init__(self) -> None:
        store = object.__setattr__
        store(self, "node_ids", _three_whole("node_ids", self.node_ids, 1, 127))
        if len(set(self.node_ids)) != len(self.node_ids):
            raise ConfigError(f"node_ids = {list(self.node_ids)}: must all be different")
        scale = rules.per_carriage("increments_per_mm", self.increments_per_mm, "increments/mm")
        store(self, "increments_per_mm", scale)
        store(self, "direction", _three_whole("direction", self.direction, -1, 1))
        if 0 in self.direction:
            raise ConfigError(f"direction = {list(self.direction)}: each must be +1 or -1")
        if self.bit_rate not in BIT_RATES:
            allowed = ", ".join(map(str, BIT_RATES))
            raise ConfigError(f"bit_rate = {self.bit_rate!r}: must be one of {allowed} bit/s")
        store(self, "cycle", rules.positive("cycle", self.cycle, "s"))
        if not 0.0005 <= self.cycle <= 0.1:
            raise ConfigError(f"cycle = {self.cycle:g}: must be from 0.0005 to 0.1 [s]")
        deceleration = rules.per_carriage(
            "quick_stop_deceleration", self.quick_stop_deceleration, "mm/s^2"
        )
        store(self, "quick_stop_deceleration", deceleration)
        window = rules.positive("following_error_window", self.following_error_window)
        store(self, "following_error_window", window)


def _three_whole(key: str, value: object, low: int, high: int) -> tuple[int, int, int]:
    """Return three whole numbers within [low, high], or raise ConfigError."""
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ConfigError(f"{key} = {value!r}: must be three whole numbers")
    first, second, third = (rules.whole(f"{key}[{i}]", v, low, high) for i, v in enumerate(value))
    return first, second, third
