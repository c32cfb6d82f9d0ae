"""What is remembered of a machine's position reference from one connection to the next.

One file per bus and per drives on it, in the XDG state folder. It is data like any other that comes
from outside: judged when it is read, and replaced whole.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from duoglide.arrays import AXES
from duoglide.errors import InputError

if TYPE_CHECKING:
    from duoglide.machine import DriveSettings

_VERSION = 1
_LONGEST = 16_384  # [bytes] of a file that can be one
_RANGES = {
    "vendor": (0, 2**32 - 1),
    "product": (0, 2**32 - 1),
    "serial": (0, 2**32 - 1),
    "mark": (0, 2**16 - 1),
    "position": (-(2**31), 2**31 - 1),
}


@dataclass(frozen=True, slots=True)
class DriveMemory:
    """What one drive was like.

    Attributes:
        vendor: 0x1018:1; 0 where it has none, as with the next two.
        product: 0x1018:2.
        serial: 0x1018:4.
        mark: 0x1017 as the host has written it; a drive that is switched on anew has another one.
        position: 0x6064 [increments].
    """

    vendor: int
    product: int
    serial: int
    mark: int
    position: int


@dataclass(frozen=True, slots=True)
class Memory:
    """What was known when it was written.

    Attributes:
        homed: Whether the position reference was known.
        why: Why it was not, in words; empty where it was.
        standing: Whether the drives had no power, so that the positions are where they were left.
        drives: In the order of the carriages.
    """

    homed: bool
    why: str
    standing: bool
    drives: tuple[DriveMemory, ...]


def state_path(settings: DriveSettings, bus: str) -> Path:
    """Return where the reference of the drives on a bus is kept.

    Another scale or direction is another reference, and so another file.

    Args:
        settings: The machine's drives.
        bus: Name of their bus.
    """
    folder = Path(os.environ.get("XDG_STATE_HOME", ""))
    if not folder.is_absolute():
        folder = Path.home() / ".local" / "state"
    identity = (settings.node_ids, settings.increments_per_mm, settings.direction)
    digest = hashlib.sha256(repr((bus, identity)).encode()).hexdigest()[:12]
    name = re.sub(r"[^A-Za-z0-9.]+", "-", bus)[:60]
    return folder / "duoglide" / f"reference-{name}-{digest}.json"


def write_memory(path: Path, memory: Memory) -> None:
    """Write the file whole, or leave it as it was.

    Raises:
        InputError: It cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(json.dumps({"version": _VERSION, **asdict(memory)}, indent=1))
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}") from error


def read_memory(path: Path) -> Memory | None:
    """Read the file; None where there is none.

    Raises:
        InputError: It cannot be read, or is not what ``write_memory`` writes.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_LONGEST + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    if len(data) > _LONGEST:
        raise InputError(f"{path}: longer than {_LONGEST} bytes, so it is no memory of a reference")
    try:
        table = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not JSON: {error}") from error
    return _judged(table, path)


def _judged(table: object, path: Path) -> Memory:
    """Return the memory that a table holds; InputError says what is wrong with it."""
    if not isinstance(table, dict) or table.get("version") != _VERSION:
        raise InputError(f"{path}: not version {_VERSION} of what is kept there")
    homed, why, standing = (table.get(key) for key in ("homed", "why", "standing"))
    drives = table.get("drives")
    if not (isinstance(homed, bool) and isinstance(standing, bool) and isinstance(why, str)):
        raise InputError(f"{path}: homed and standing must be true or false, why must be text")
    if not isinstance(drives, list) or len(drives) != AXES:
        raise InputError(f"{path}: drives must be {AXES} tables")
    return Memory(homed, why, standing, tuple(_judged_drive(drive, path) for drive in drives))


def _judged_drive(table: object, path: Path) -> DriveMemory:
    if not isinstance(table, dict) or table.keys() != _RANGES.keys():
        raise InputError(f"{path}: a drive must have the keys {', '.join(_RANGES)}")
    for key, (low, high) in _RANGES.items():
        value = table[key]
        if type(value) is not int or not low <= value <= high:
            raise InputError(f"{path}: {key} = {value!r:.80}: must be from {low} to {high}")
    return DriveMemory(**table)
