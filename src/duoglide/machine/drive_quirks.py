"""How drives find their reference, and what single drives do in their own way."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from duoglide.errors import ConfigError
from duoglide.machine import rules
from duoglide.machine.drive_contract import OPTIONAL_OBJECTS
from duoglide.machine.meaning import documented, setting, told, unit_of

_METHODS = range(-128, 38)  # 0x6098 is an i8; CiA 402 names 1 to 37, negative ones are vendors'


class Interlock(StrEnum):
    """What bit 3 of the digital inputs, 0x60FD, is while safe torque off is active."""

    SET = "set"
    CLEAR = "clear"
    NONE = "none"  # the bit means something else, or nothing

    @property
    def other(self) -> Interlock:
        """The opposite polarity."""
        return Interlock.CLEAR if self is Interlock.SET else Interlock.SET


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Homing:
    """How the position reference is found (CiA 402 homing mode)."""

    method: tuple[int, int, int] = setting(
        (37, 37, 37),
        "0x6098 per axis; 37 takes the place where the machine stands as known, 17 and "
        "18 search a limit switch, 33 and 34 an index pulse; 1 to 14 and negative ones "
        "are passed on",
    )
    switch_position: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0),
        "where the carriage is when its switch or index pulse is met; not used by "
        "method 37, which is told the place",
        "mm",
    )
    search_speed: float = setting(20.0, "0x6099:1, towards the switch", "mm/s")
    creep_speed: float = setting(5.0, "0x6099:2, at the switch or index pulse", "mm/s")
    acceleration: float = setting(500.0, "0x609A", "mm/s^2")
    timeout: float = setting(60.0, "how long it may take", "s")

    def __post_init__(self) -> None:
        store = object.__setattr__
        low, high = _METHODS[0], _METHODS[-1]
        store(self, "method", rules.three_whole("method", self.method, low, high))
        if 0 in self.method:
            raise ConfigError(f"method = {list(self.method)}: 0 finds no reference")
        store(self, "switch_position", rules.triple("switch_position", self.switch_position))
        for key in ("search_speed", "creep_speed", "acceleration", "timeout"):
            store(self, key, rules.positive(key, getattr(self, key), unit_of(Homing, key)))


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Quirks:
    """What one drive does in its own way; the defaults are the drive of firmware_interface/."""

    vendor_id: int = setting(0, "0x1018:1 that the drive must have; 0 accepts any")
    product_code: int = setting(0, "0x1018:2 that the drive must have; 0 accepts any")
    trust_csp: bool = setting(
        False, "whether the drive knows cyclic synchronous position although 0x6502 lacks its bit"
    )
    follows_bit: bool = setting(
        True,
        "whether bit 12 of the statusword is set while the drive follows its setpoints; without "
        "it, a drive that ignores them shows in the following error alone",
    )
    quick_stop_option: int = setting(
        6, "0x605A: 6 brakes at 0x6085 and holds, 2 brakes and then powers off"
    )
    interlock: Interlock = field(
        default=Interlock.SET,
        metadata=told(
            'what bit 3 of 0x60FD is while safe torque off is active: "set", "clear", or "none" '
            "where the drive does not say it there"
        ),
    )
    home_object: tuple[int, int] = setting(
        (0x607C, 0), "[index, subindex] of the position at the place of reference, 32 bits"
    )
    home_offset_sign: int = setting(1, "-1 for a drive that subtracts 0x607C where others add it")
    homed_object: int = setting(
        0,
        "index of an object that reads 1 while the drive remembers its reference, 0x2010 in the "
        "drive of firmware_interface/; 0: it has none, and the host remembers the reference",
    )
    velocity_unit: float | None = setting(
        None,
        "what one unit of the drive's velocities (0x607F, 0x6099) means; left out, what 0x60A9 "
        "says, or one increment/s",
        "mm/s",
    )
    acceleration_unit: float | None = setting(
        None,
        "what one unit of the drive's accelerations (0x6085, 0x609A) means; left out, what 0x60AA "
        "says, or one increment/s^2",
        "mm/s^2",
    )
    setpoint_timer: bool = setting(
        True, "whether the drive has 0x1400:5, the time-out of setpoints"
    )
    absent: tuple[int, ...] = setting(
        (), "indices of optional objects that the drive does not have; they are not written"
    )
    writes: tuple[tuple[int, int, int, int], ...] = setting(
        (), "extra objects to write before power: [index, subindex, value, bytes]"
    )

    def __post_init__(self) -> None:
        for key in ("vendor_id", "product_code"):
            rules.whole(key, getattr(self, key), 0, 0xFFFFFFFF)
        rules.whole("homed_object", self.homed_object, 0, 0xFFFF)
        rules.whole("quick_stop_option", self.quick_stop_option, -32768, 32767)
        for key in ("velocity_unit", "acceleration_unit"):
            if (value := getattr(self, key)) is not None:
                unit = rules.positive(key, value, unit_of(Quirks, key))
                object.__setattr__(self, key, unit)
        if self.home_offset_sign not in (-1, 1):
            raise ConfigError(f"home_offset_sign = {self.home_offset_sign!r:.80}: must be +1 or -1")
        for key in ("trust_csp", "follows_bit", "setpoint_timer"):
            rules.true_or_false(key, getattr(self, key))
        object.__setattr__(self, "interlock", rules.one_of(Interlock, "interlock", self.interlock))
        home = rules.several_whole("home_object", self.home_object, 0, 0xFFFF, 2)
        object.__setattr__(
            self, "home_object", (home[0], rules.whole("home_object", home[1], 0, 255))
        )
        self._check_absent()
        self._check_writes()

    def has(self, index: int) -> bool:
        """Whether the drive has an optional object."""
        return index not in self.absent

    def _check_absent(self) -> None:
        if not isinstance(self.absent, list | tuple):
            raise ConfigError(f"absent = {self.absent!r:.80}: must be a list of object indices")
        for index in self.absent:
            if not isinstance(index, int) or index not in OPTIONAL_OBJECTS:
                known = ", ".join(f"0x{i:04X}" for i in sorted(OPTIONAL_OBJECTS))
                name = f"0x{index:04X}" if isinstance(index, int) else repr(index)
                raise ConfigError(f"absent: {name} is not optional; these are: {known}")
        object.__setattr__(self, "absent", tuple(self.absent))

    def _check_writes(self) -> None:
        if not isinstance(self.writes, list | tuple):
            raise ConfigError(f"writes = {self.writes!r:.80}: must be a list")
        for write in self.writes:
            if not isinstance(write, list | tuple) or len(write) != 4:
                raise ConfigError(f"writes: {write!r:.80}: must be [index, subindex, value, bytes]")
            index, subindex, value, size = write
            rules.whole("writes: index", index, 0x1000, 0xFFFF)
            rules.whole("writes: subindex", subindex, 0, 255)
            size = rules.whole("writes: bytes", size, 1, 4)
            rules.whole("writes: value", value, -(1 << (8 * size - 1)), (1 << (8 * size)) - 1)
        object.__setattr__(self, "writes", tuple(tuple(write) for write in self.writes))
