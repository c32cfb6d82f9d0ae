"""What simulated drives shall be like, and what shall go wrong with them: a TOML file.

.. code-block:: toml

    carriages = [-200.0, 200.0, 10.0]  # where they stand at first [mm]; default: at home

    [plant]                            # of all three; or [[plant]] three times, one per carriage
    bandwidth = 40.0                   # a key left out takes its default, see PlantParameters
    encoder_step = 0.005

    [[fault]]                          # as many as wanted
    kind = "jam"                       # one of duoglide.drives.simulation.faults, in small letters
    axis = 2
    after = 1.5                        # [s]
    since = "enabled"                  # that drive got power; or "start", the default
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from pathlib import Path
from typing import Any

from duoglide.drives.simulation import faults
from duoglide.drives.simulation.faults import Injection
from duoglide.drives.simulation.plant import PlantParameters
from duoglide.errors import ConfigError
from duoglide.machine import rules
from duoglide.machine.toml_read import load_file

_KINDS: dict[str, type[Injection]] = {
    "clear": faults.Clear,
    "device_fault": faults.DeviceFault,
    "drop_frames": faults.DropFrames,
    "inputs": faults.Inputs,
    "jam": faults.Jam,
    "override": faults.Override,
    "reboot": faults.Reboot,
    "silence": faults.Silence,
    "slow_sdo": faults.SlowSdo,
    "sto": faults.Sto,
}


class Since(Enum):
    """From when on the time of a fault counts."""

    START = "start"  # of the drives
    ENABLED = "enabled"  # of the drive that it is for, for the first time


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedFault:
    """A fault and when it happens.

    Attributes:
        injection: What happens, and to which axis.
        after: Seconds after ``since``.
        since: From when on they count.
    """

    injection: Injection
    after: float = 0.0
    since: Since = Since.START

    @property
    def words(self) -> str:
        """What happens, for a person."""
        kind = next(name for name, kind in _KINDS.items() if type(self.injection) is kind)
        return f"axis {self.injection.axis}: {kind.replace('_', ' ')}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """Three plants and their faults.

    Attributes:
        plants: What hangs on each drive.
        carriages: Where the carriages stand at first [mm]; None: where the machine is at home.
        faults: What goes wrong, and when.
    """

    plants: tuple[PlantParameters, PlantParameters, PlantParameters]
    carriages: tuple[float, float, float] | None = None
    faults: tuple[PlannedFault, ...] = ()

    @classmethod
    def load(cls, path: str | Path) -> Scenario:
        """Read a scenario from a TOML file; a key left out takes its default.

        Raises:
            ConfigError: No such file, not TOML, an unknown key, or a broken rule.
        """
        return load_file(path, "scenario", cls.from_dict)

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any]) -> Scenario:
        """Build a scenario from the tables of its file; ConfigError names what is wrong."""
        file = rules.build(_File, tables, "")
        carriages = file.carriages
        return cls(
            plants=_three_plants(file.plant),
            carriages=None if carriages is None else rules.triple("carriages", carriages),
            faults=tuple(_planned(table, f"fault[{i}]") for i, table in enumerate(file.fault)),
        )


class FaultSchedule:
    """Which faults of a scenario are due.

    Args:
        planned: The faults.
        now: When the drives started [s].
    """

    def __init__(self, planned: Sequence[PlannedFault], now: float) -> None:
        self._waiting = list(planned)
        self._start = now
        self._enabled: dict[int, float] = {}

    @property
    def waiting(self) -> bool:
        """Whether any fault is still to come."""
        return bool(self._waiting)

    def due(self, now: float, enabled: Sequence[bool]) -> list[PlannedFault]:
        """Take the faults whose time has come.

        Args:
            now: [s].
            enabled: Whether each drive has power.
        """
        for axis, powered in enumerate(enabled, start=1):
            if powered:
                self._enabled.setdefault(axis, now)
        due = [fault for fault in self._waiting if self._age(fault, now) >= fault.after]
        self._waiting = [fault for fault in self._waiting if fault not in due]
        return due

    def _age(self, fault: PlannedFault, now: float) -> float:
        """Return the time since a fault's clock started; negative before [s]."""
        if fault.since is Since.START:
            return now - self._start
        begin = self._enabled.get(fault.injection.axis)
        return -1.0 if begin is None else now - begin


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """The top of the file."""

    carriages: object = None
    plant: object = ()
    fault: Any = ()

    def __post_init__(self) -> None:
        if not isinstance(self.fault, list | tuple):
            raise ConfigError(f"fault = {self.fault!r:.80}: must be [[fault]] tables")


def _three_plants(tables: object) -> tuple[PlantParameters, PlantParameters, PlantParameters]:
    if not isinstance(tables, list | tuple):
        tables = [tables]
    if len(tables) not in (0, 1, 3):
        raise ConfigError(f"plant: {len(tables)} tables, must be one for all axes or one for each")
    built = [rules.build(PlantParameters, t, f"plant[{i}]") for i, t in enumerate(tables)]
    first, second, third = built if len(built) == 3 else (built or [PlantParameters()]) * 3
    return first, second, third


def _planned(table: object, prefix: str) -> PlannedFault:
    if not isinstance(table, Mapping):
        raise ConfigError(f"{prefix} = {table!r:.80}: must be a table")
    rest = dict(table)
    kind, after, since = rest.pop("kind", None), rest.pop("after", 0.0), rest.pop("since", "start")
    if kind not in _KINDS:
        raise ConfigError(f"{prefix}.kind = {kind!r:.80}: must be one of {', '.join(_KINDS)}")
    if since not in [member.value for member in Since]:
        raise ConfigError(f"{prefix}.since = {since!r:.80}: must be start or enabled")
    injection = rules.build(_KINDS[kind], rest, prefix)
    for field in fields(injection):
        _check(f"{prefix}.{field.name}", getattr(injection, field.name), str(field.type))
    rules.whole(f"{prefix}.axis", injection.axis, 1, 3)
    after = rules.not_negative(f"{prefix}.after", after, "s")
    return PlannedFault(injection=injection, after=after, since=Since(since))


def _check(key: str, value: object, kind: str) -> None:
    """Hold a field of an injection to its type."""
    if kind == "bool":
        if not isinstance(value, bool):
            raise ConfigError(f"{key} = {value!r:.80}: must be true or false")
    elif kind == "int":
        rules.whole(key, value, 0, 0xFFFFFFFF)
    else:
        rules.not_negative(key, value, "s")
