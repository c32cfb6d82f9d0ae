"""How the three drives are wired, scaled and watched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from duoglide.errors import ConfigError
from duoglide.machine import rules
from duoglide.machine.drive_profiles import PROFILES, profile_quirks, three_profiles
from duoglide.machine.drive_quirks import Homing, Quirks
from duoglide.machine.meaning import documented, setting, told, unit_of

BIT_RATES = (125_000, 250_000, 500_000, 800_000, 1_000_000)  # CiA 301, table 1
_HERE = 37  # the homing method without a profile
_MOST_INCREMENTS = 2**32 - 1  # per s^2 in 0x6085
_MOST_MILLISECONDS = 65.535  # 0x1017, 0x1400:5 and 0x6066 are 16-bit milliseconds [s]


def _no_table() -> Any:
    """Return a table that says nothing: the profile and the defaults complete it."""
    return {}


def _no_tables() -> Any:
    return ({}, {}, {})


class Reference(StrEnum):
    """What the encoders know when they are switched on."""

    INCREMENTAL = "incremental"
    ABSOLUTE = "absolute"


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class DriveSettings:
    """The three linear-axis drives, in the order of the carriages.

    Raises:
        ConfigError: Names the key, the value and the rule.
    """

    node_ids: tuple[int, int, int] = setting(
        (1, 2, 3), "CANopen node numbers, 1 to 127, all different"
    )
    increments_per_mm: tuple[float, float, float] = setting(
        (1000.0, 1000.0, 1000.0),
        "position increments of the drive per mm, one value or three",
        "increments/mm",
    )
    direction: tuple[int, int, int] = setting(
        (1, 1, 1), "+1 or -1, one or per axis: whether the drive counts along +y"
    )
    bit_rate: int = setting(1_000_000, "of the bus", "bit/s")
    cycle: float = setting(0.002, "SYNC period and setpoint period", "s")
    quick_stop_deceleration: tuple[float, float, float] = setting(
        (60e3, 60e3, 60e3),
        "0x6085, what a drive brakes with by itself; no more than its 32 bits hold, "
        "which is less than 60 m/s^2 above 71 582 increments per mm",
        "mm/s^2",
    )
    quick_stop_tolerance: float = setting(
        0.05,
        "by which share of 0x6085 a drive may brake harder or more gently than that, 0 to 0.9; "
        "what brake-safe promises holds for any of them",
    )
    following_error_window: float = setting(
        15.0,
        "0x6065, and what a carriage may be off at full speed from where its setpoints and its "
        "known lag put it",
        "mm",
    )
    following_error_at_rest: float = setting(
        1.0,
        "what a carriage may be off at rest; between rest and full speed it grows with the speed",
        "mm",
    )
    lasting_error: float = setting(
        0.7, "what a carriage may stay off, on the average of a tenth of a second", "mm"
    )
    goal_tolerance: float = setting(
        0.3, "how near the last setpoint all carriages must come for a run to be completed", "mm"
    )
    settling_time: float = setting(
        0.5, "how long after the last setpoint they may take for that", "s"
    )
    lag: tuple[float, float, float] = setting(
        (7e-5, 7e-5, 7e-5),
        "by how much a carriage trails its setpoint at constant speed, one value or three; the "
        "report of a run says what it was. The defaults are those of the simulated drives",
        "s",
    )
    acceleration_lag: tuple[float, float, float] = setting(
        (4e-6, 4e-6, 4e-6),
        "by how many mm it trails for each mm/s^2 of acceleration: 1 / (2 pi f)^2 for a position "
        "loop of f Hz; likewise",
        "s^2",
    )
    following_error_time: float = setting(0.01, "0x6066, how long the window may be left", "s")
    host_id: int = setting(127, "the host's own node number, in its heartbeat; not one of node_ids")
    heartbeat_period: float = setting(
        0.05, "how often the host and the drives (0x1017) send a heartbeat", "s"
    )
    heartbeat_timeout: float = setting(
        0.25, "0x1016 and the host's own watch: silence that means a loss", "s"
    )
    setpoint_timeout: float = setting(
        0.02,
        "0x1400:5, how long a drive waits for a setpoint before it gives up, and three "
        "cycles in any case; it goes on for one cycle and then brakes long before "
        "that, see firmware_interface/README.md",
        "s",
    )
    missing_frames: int = setting(
        3, "feedback frames in a row that may be lost; one more is a fault"
    )
    late_cycles: int = setting(5, "cycles in a row that the host may miss; one more is a fault")
    boot_timeout: float = setting(10.0, "how long a drive may take to say anything at all", "s")
    sdo_timeout: float = setting(0.5, "how long a drive may take to answer one request", "s")
    sdo_retries: int = setting(2, "how often a request without an answer is sent again")
    profile: tuple[str, str, str] = setting(
        ("", "", ""),
        "make of the drives, one name or one per axis: it fills in what quirks and "
        "homing do not say; see the docs, Drives of other makers",
    )
    reference: Reference = field(
        default=Reference.INCREMENTAL,
        metadata=told(
            "incremental: the encoders count from where they are switched on; absolute: what the "
            "drives say then is right, and the machine is not homed again"
        ),
    )
    homing: Homing = field(
        default_factory=_no_table,
        metadata=told("how the position reference is found (CiA 402 homing mode)"),
    )
    quirks: tuple[Quirks, Quirks, Quirks] = field(
        default_factory=_no_tables,
        metadata=told(
            "what each drive does in its own way, one table per axis, or one for all; the "
            "defaults are the drive of firmware_interface/"
        ),
    )

    def __post_init__(self) -> None:
        self._check_wiring()
        self._check_scale()
        self._check_times()
        self._check_reference()
        self._check_tables()

    @property
    def setpoint_patience(self) -> float:
        """How long a drive waits for a setpoint, with three cycles granted in any case [s]."""
        return max(self.setpoint_timeout, 3.0 * self.cycle)

    def _store(self, **values: Any) -> None:
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def _check_wiring(self) -> None:
        self._store(node_ids=rules.three_whole("node_ids", self.node_ids, 1, 127))
        if len(set(self.node_ids)) != len(self.node_ids):
            raise ConfigError(f"node_ids = {list(self.node_ids)}: must all be different")
        self._store(host_id=rules.whole("host_id", self.host_id, 1, 127))
        if self.host_id in self.node_ids:
            raise ConfigError(f"host_id = {self.host_id}: is the node number of a drive")
        if self.bit_rate not in BIT_RATES:
            allowed = ", ".join(map(str, BIT_RATES))
            raise ConfigError(f"bit_rate = {self.bit_rate!r:.80}: must be one of {allowed} bit/s")

    def _check_scale(self) -> None:
        for key in ("increments_per_mm", "quick_stop_deceleration"):
            unit = unit_of(DriveSettings, key)
            self._store(**{key: rules.per_carriage(key, getattr(self, key), unit)})
        first, second, third = (
            min(wish, _MOST_INCREMENTS / fineness)
            for wish, fineness in zip(
                self.quick_stop_deceleration, self.increments_per_mm, strict=True
            )
        )
        self._store(quick_stop_deceleration=(first, second, third))
        tolerance = rules.number("quick_stop_tolerance", self.quick_stop_tolerance)
        if not 0.0 <= tolerance <= 0.9:
            raise ConfigError(f"quick_stop_tolerance = {tolerance:g}: must be from 0 to 0.9")
        self._store(quick_stop_tolerance=tolerance)
        direction: object = self.direction
        if type(direction) is int:  # one for all three, as the other settings allow
            direction = (direction,) * 3
        self._store(direction=rules.three_whole("direction", direction, -1, 1))
        if 0 in self.direction:
            raise ConfigError(f"direction = {list(self.direction)}: each must be +1 or -1")
        self._check_following()

    def _check_following(self) -> None:
        for key in (
            *("following_error_window", "following_error_at_rest"),
            *("lasting_error", "goal_tolerance", "settling_time"),
        ):
            unit = unit_of(DriveSettings, key)
            self._store(**{key: rules.positive(key, getattr(self, key), unit)})
        for key in ("lag", "acceleration_lag"):
            unit = unit_of(DriveSettings, key)
            self._store(**{key: rules.any_per_carriage(key, getattr(self, key), unit)})

    def _check_reference(self) -> None:
        try:
            self._store(reference=Reference(self.reference))
        except ValueError as error:
            known = " or ".join(Reference)
            raise ConfigError(f"reference = {self.reference!r:.80}: must be {known}") from error

    def _check_times(self) -> None:
        for key, low, high in (
            ("cycle", 0.0005, 0.1),
            ("following_error_time", 0.0, _MOST_MILLISECONDS),
            ("heartbeat_period", 0.001, _MOST_MILLISECONDS),
            ("heartbeat_timeout", 0.001, _MOST_MILLISECONDS),
            ("setpoint_timeout", 0.001, _MOST_MILLISECONDS),
            ("boot_timeout", 0.0, 3600.0),
            ("sdo_timeout", 0.001, 3600.0),
        ):
            value = rules.number(key, getattr(self, key), "s")
            if not low <= value <= high:
                raise ConfigError(f"{key} = {value:g}: must be from {low:g} to {high:g} [s]")
            self._store(**{key: value})
        if self.heartbeat_timeout < 2.0 * self.heartbeat_period:
            raise ConfigError(
                f"heartbeat_timeout = {self.heartbeat_timeout:g}: must be at least twice"
                f" heartbeat_period = {self.heartbeat_period:g} s, or one lost frame is a fault"
            )
        for key in ("missing_frames", "late_cycles", "sdo_retries"):
            self._store(**{key: rules.whole(key, getattr(self, key), 0, 1000)})

    def _check_tables(self) -> None:
        self._store(profile=three_profiles(self.profile))
        homing: object = self.homing
        if not isinstance(homing, Homing):
            methods = [PROFILES[name].homing_method if name else _HERE for name in self.profile]
            if isinstance(homing, Mapping):
                homing = {"method": methods, **homing}
            self._store(homing=rules.build(Homing, homing, "homing"))
        quirks: object = self.quirks
        if isinstance(quirks, list | tuple) and len(quirks) == 1:
            quirks = [quirks[0]] * 3
        if not isinstance(quirks, list | tuple) or len(quirks) != 3:
            raise ConfigError(
                f"quirks = {quirks!r:.80}: must be three tables, one per axis, or one for all"
            )
        built = (
            item if isinstance(item, Quirks) else _complete(item, name, f"quirks[{i}]")
            for i, (item, name) in enumerate(zip(quirks, self.profile, strict=True))
        )
        self._store(quirks=tuple(built))


def _complete(table: object, profile: str, prefix: str) -> Quirks:
    """Build quirks from a table, and from a profile where the table says nothing."""
    if isinstance(table, Mapping):
        table = {**profile_quirks(profile), **table}
    return rules.build(Quirks, table, prefix)
