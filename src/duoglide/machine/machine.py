"""The whole machine, and its TOML file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from duoglide.errors import ConfigError
from duoglide.machine import rules
from duoglide.machine.cell import Box
from duoglide.machine.drive_quirks import Homing, Quirks
from duoglide.machine.drive_settings import DriveSettings
from duoglide.machine.geometry import Geometry
from duoglide.machine.limits import CarriageLimits, DerivedLimits
from duoglide.machine.masses import Masses
from duoglide.machine.meaning import documented, setting, told
from duoglide.machine.timing import Timing
from duoglide.machine.toml_read import load_file

_LARGEST = 2**31 - 1  # that a drive counts to
_LONGEST_BRAKING = 10.0  # [s]
_TABLES = {
    "geometry": Geometry,
    "limits": CarriageLimits,
    "stop_limits": CarriageLimits,
    "drives": DriveSettings,
    "masses": Masses,
}
_INNER_TABLES = {"keep_out": Box, "drives.homing": Homing, "drives.quirks": Quirks}


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """A machine: its mechanism, what its carriages may do, its drives and its surroundings.

    Raises:
        ConfigError: Names the key, the value and the rule.
    """

    geometry: Geometry = field(
        default_factory=Geometry,
        metadata=told("dimensions of the mechanism; by default those of Table 1 of [Shen2021]"),
    )
    limits: CarriageLimits = field(
        default_factory=CarriageLimits, metadata=told("what a plan may ask of the carriages")
    )
    stop_limits: CarriageLimits = field(
        default_factory=DerivedLimits,
        metadata=told(
            "what a stop on the path may ask, at least limits everywhere; left out, it "
            "follows limits: 1.5 times the acceleration, jerk and force"
        ),
    )
    drives: DriveSettings = field(
        default_factory=DriveSettings,
        metadata=told("the three drives, in the order of the carriages"),
    )
    masses: Masses = field(
        default_factory=Masses,
        metadata=told("masses, friction and gravity, of which forces are computed"),
    )
    clearance: float = setting(
        2.0, "distance to keep from every singular surface and edge of reach", "mm"
    )
    reaction_cycles: int = setting(
        3,
        "cycles from the moment at which a drive begins to stop by itself until the others react; "
        "three with this streamer: a SYNC takes the news, the next one sends the setpoint or "
        "controlword, and that acts at the one after",
        "cycles",
    )
    carriage_margin: float = setting(
        1.0,
        "how far every carriage may be off at once with the links still closed, on the same side "
        "of every singular surface",
        "mm",
    )
    carriage_width: float = setting(
        60.0, "distance that carriages 1 and 2 keep from each other", "mm"
    )
    home_position: tuple[float, float, float] | None = setting(
        None,
        "platform position at which homing by method 37 is done; left out, the deepest "
        "point of the workspace",
        "mm",
    )
    tool_offset: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "from the platform's centre to the tool's tip", "mm"
    )
    work_frame: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "origin of the program's coordinates in the base frame", "mm"
    )
    timing: Timing | None = field(
        default=None,
        metadata=told(
            "how paths are timed where neither the call nor the program says it: near-optimal, "
            "toppra or ruckig; left out, toppra if no carriage has a jerk limit, else near-optimal"
        ),
    )
    keep_out: tuple[Box, ...] = setting((), "boxes that the platform's centre stays out of")

    def __post_init__(self) -> None:
        store = object.__setattr__
        for key, kind in _TABLES.items():
            value = getattr(self, key)
            if not isinstance(value, kind):
                raise ConfigError(f"{key} = {value!r:.80}: must be a {kind.__name__}")
        store(self, "clearance", rules.not_negative("clearance", self.clearance))
        cycles = rules.whole("reaction_cycles", self.reaction_cycles, 0, 100)
        store(self, "reaction_cycles", cycles)
        store(self, "carriage_margin", rules.not_negative("carriage_margin", self.carriage_margin))
        store(self, "carriage_width", rules.not_negative("carriage_width", self.carriage_width))
        for key in ("tool_offset", "work_frame"):
            store(self, key, rules.triple(key, getattr(self, key)))
        if self.home_position is not None:
            store(self, "home_position", rules.triple("home_position", self.home_position))
        if self.timing is not None:
            store(self, "timing", rules.one_of(Timing, "timing", self.timing))
        store(self, "keep_out", _boxes(self.keep_out))
        if isinstance(self.stop_limits, DerivedLimits):
            store(self, "stop_limits", DerivedLimits.of(self.limits))
        self._require_stop_reserve()
        self._require_room_to_count()
        self._require_brakes()

    def _require_brakes(self) -> None:
        """Refuse drives that would brake for longer than it makes sense to certify."""
        slowest = self.limits.velocity / np.array(self.drives.quick_stop_deceleration)
        if slowest.max() > _LONGEST_BRAKING:
            raise ConfigError(
                f"drives.quick_stop_deceleration = {self.drives.quick_stop_deceleration}: a stop"
                f" from limits.velocity would take {slowest.max():.4g} s; at most"
                f" {_LONGEST_BRAKING:g} s are allowed"
            )

    def _require_room_to_count(self) -> None:
        """Refuse increments so fine that the drives' 32 bits do not reach the ends of the rails."""
        end, finest = self.geometry.rail_half_length, max(self.drives.increments_per_mm)
        if end * finest > _LARGEST:
            raise ConfigError(
                f"drives.increments_per_mm = {finest:g}: a drive counts up to {_LARGEST}, which is"
                f" {_LARGEST / finest:.4g} mm, and geometry.rail_half_length is {end:g} mm; up to"
                f" {_LARGEST / end:.4g} increments per mm reach that far"
            )

    def _require_stop_reserve(self) -> None:
        for key in ("velocity", "acceleration", "jerk", "force"):
            least, value = getattr(self.limits, key), getattr(self.stop_limits, key)
            if np.any(value < least):
                raise ConfigError(
                    f"stop_limits.{key} = {value.tolist()}: must be at least limits.{key}"
                    f" = {least.tolist()}"
                )

    @classmethod
    def default(cls) -> Machine:
        """Return the machine of Table 1 with the default limits and drives."""
        return cls()

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Machine:
        """Read a machine from a TOML file; a key left out takes its default.

        Raises:
            ConfigError: Not a path, no such file, not TOML, an unknown key, or a broken rule.
        """
        return load_file(path, "machine file", cls.from_dict)

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any]) -> Machine:
        """Build a machine from the tables of its TOML file.

        Raises:
            ConfigError: An unknown key or a broken rule.
        """
        if not isinstance(tables, Mapping):
            raise ConfigError(f"a machine must be a table of tables, got {tables!r:.80}")
        values = dict(tables)
        for key, kind in _TABLES.items():
            if key in values:
                values[key] = rules.build(kind, values[key], key)
        if "keep_out" in values:
            boxes = values["keep_out"]
            if not isinstance(boxes, list):
                raise ConfigError(f"keep_out = {boxes!r:.80}: must be a list of tables")
            values["keep_out"] = [
                rules.build(Box, box, f"keep_out[{i}]") for i, box in enumerate(boxes)
            ]
        return rules.build(cls, values, "")

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the TOML file: plain numbers, text, lists and dictionaries.

        A limit that is none is the text "inf", as JSON has no such number; ``from_dict`` reads it.
        """
        tables: dict[str, Any] = _in_json(plain(self))
        return tables

    def save(self, path: str | Path, *, schema: str = "") -> None:
        """Write the machine to a TOML file that ``load`` reads back exactly, and people easily.

        Args:
            path: Of the file.
            schema: Address of the JSON schema to name in it, for editors; empty for none.

        Raises:
            ConfigError: The file cannot be written.
        """
        from duoglide.machine.toml_text import commented

        named = f"#:schema {schema}\n" if schema else ""
        text = named + commented(plain(self), {"": Machine, **_TABLES, **_INNER_TABLES})
        goal = Path(os.path.realpath(path))
        try:
            if goal.exists() and not goal.is_file():  # a terminal, or a directory: an error
                goal.write_text(text, encoding="utf-8")
            else:
                _replace(goal, text)
        except OSError as error:
            raise ConfigError(f"cannot write machine file {path}: {error.strerror}") from error


def _boxes(value: object) -> tuple[Box, ...]:
    """Return the boxes of a list, or raise ConfigError."""
    boxes = tuple(value) if isinstance(value, list | tuple) else (value,)
    for i, box in enumerate(boxes):
        if not isinstance(box, Box):
            raise ConfigError(f"keep_out[{i}] = {box!r:.80}: must be a Box(low=, high=, name=)")
    return boxes


def _replace(goal: Path, text: str) -> None:
    """Write a file whole, or leave it as it was."""
    temporary = goal.with_name(f".{goal.name}.{os.getpid()}.part")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(goal)
    finally:
        temporary.unlink(missing_ok=True)


def plain(value: Any) -> Any:
    """Turn a dataclass into what TOML and JSON hold."""
    if is_dataclass(value):
        items = ((f.name, getattr(value, f.name)) for f in fields(value))
        return {name: plain(item) for name, item in items if not _left_out(item)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    return value


def _in_json(value: Any) -> Any:
    """Replace infinite numbers by text."""
    if isinstance(value, dict):
        return {name: _in_json(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_in_json(item) for item in value]
    return rules.NONE if isinstance(value, float) and value == inf else value


def _left_out(value: object) -> bool:
    """Whether a field says nothing that reading the file would not find by itself."""
    return value is None or isinstance(value, DerivedLimits)
