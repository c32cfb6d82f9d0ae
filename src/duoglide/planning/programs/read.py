"""Program files: TOML, CSV and G-code, told apart by their suffix.

**TOML** (``.toml``)::

    start = [-41, -100, 295]     # [mm]; not needed where the first move says where it starts
    tolerance = 2.0              # corner tolerance of every corner that has none of its own [mm]
    speed = 800                  # cap on the tool's speed [mm/s], left out: none
    acceleration = 20000         # cap on the tool's acceleration [mm/s^2], left out: none
    ignore = ["author"]          # keys to skip, each counted in the report

    [[moves]]
    type = "line"                # to; speed, tolerance (of the corner at its end)
    to = [-41, -100, 310]

    [[moves]]
    type = "arc"                 # via, to; speed, tolerance
    via = [-41, -50, 320]
    to = [-41, 0, 310]

    [[moves]]
    type = "through"             # points after the present one; speed, tolerance
    points = [[-41, 20, 315], [-41, 40, 310]]

    [[moves]]
    type = "polyline"            # points after the present one; speed, tolerance
    points = [[-41, 60, 310], [-41, 60, 295]]

    [[moves]]
    type = "set_output"          # axis, bit, value: where the move before has ended
    axis = 1
    bit = 16
    value = true

    [[moves]]
    type = "wait_input"          # axis, bit, value, timeout [s]
    axis = 1
    bit = 0
    value = true

    [[moves]]
    type = "dwell"               # seconds
    seconds = 0.1

    [[moves]]
    type = "pick_and_place"      # place; pick (the present point), lift, tolerance, depart,
    place = [-41, 100, 295]      # approach, dwell

    [[moves]]
    type = "arch"                # to; lift, straight
    to = [-41, 0, 295]

**CSV** (``.csv``): x, y, z in mm, and optionally a cap on the speed of the way there in mm/s. A
first line with these names, ``sep=;``, blank lines and lines that start with ``#`` are skipped. The
columns are parted by commas, semicolons or tabs, the same in the whole file, and the decimal sign
is a point. What a spreadsheet of another country may mean otherwise is refused: ``1,5;2;300``,
``1.200;0;300`` where no other number says that the point is the decimal sign, and four whole
numbers parted by commas without the first line ``x,y,z,speed``.

**G-code** (``.nc``, ``.ngc``, ``.gcode``, ``.gco``, ``.tap``, ``.cnc``): see
``duoglide.planning.programs.gcode``.

Files are UTF-8; comments of G-code and CSV may be in any encoding that holds ASCII.
"""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from duoglide.arrays import as_number
from duoglide.errors import InputError
from duoglide.machine.toml_read import decoded
from duoglide.motion.path.path import Path
from duoglide.planning.programs.csv_points import read_csv
from duoglide.planning.programs.gcode import read_gcode
from duoglide.planning.programs.notes import ProgramNotes
from duoglide.planning.programs.toml import KEYS, read_toml

GCODE = (".nc", ".ngc", ".gcode", ".gco", ".tap", ".cnc")


@dataclass(frozen=True, slots=True)
class Reading:
    """What a program file says, and how it was read.

    Attributes:
        path: The path.
        ignored: How often each word was skipped that the user has named.
        remarks: What a person should know of the reading.
    """

    path: Path
    ignored: Mapping[str, int] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def read_program(
    file: str | os.PathLike[str], tolerance: float = 0.0, ignore: Iterable[str] = ()
) -> Path:
    """Read a path from a program file.

    Args:
        file: A TOML, CSV or G-code file.
        tolerance: Corner tolerance of the corners for which the file has none [mm].
        ignore: Words to skip, as ``["M104", "E"]``; see ``duoglide.planning.programs.gcode``.

    Raises:
        InputError: No such file, an unknown suffix, or a mistake in it: names the file, the line
            or the move, and the rule.
    """
    return read_with_notes(file, tolerance, ignore).path


def read_with_notes(
    file: str | os.PathLike[str], tolerance: float = 0.0, ignore: Iterable[str] = ()
) -> Reading:
    """Read a path from a program file, and what was skipped; see ``read_program``."""
    if not isinstance(file, str | os.PathLike):
        raise InputError(f"program file {file!r:.80}: must be a path")
    path = pathlib.Path(file)
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise InputError(f"{path}: unknown kind of program; known: {', '.join(_READERS)}")
    if as_number(tolerance, "tolerance [mm]") < 0.0:
        raise InputError(f"tolerance = {tolerance:g} mm: must be 0 or above")
    notes = ProgramNotes.ignoring(ignore, KEYS)
    try:
        text = decoded(path.read_bytes(), comments_in_any=suffix != ".toml")
    except (OSError, ValueError, InputError) as error:  # ValueError: a zero byte in the name
        why = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read program {path}: {why}") from error
    try:
        read = _READERS[suffix](text, tolerance, notes)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return Reading(read, dict(notes.ignored), tuple(notes.remarks))


def _read_csv(text: str, tolerance: float, notes: ProgramNotes) -> Path:
    return read_csv(text, tolerance)


_READERS: dict[str, Callable[[str, float, ProgramNotes], Path]] = {
    ".toml": read_toml,
    ".csv": _read_csv,
    **dict.fromkeys(GCODE, read_gcode),
}
