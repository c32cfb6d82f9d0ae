"""Program files: TOML, CSV and G-code, told apart by their suffix.

**TOML** (``.toml``)::

    start = [-41, -100, 295]     # [mm]; not needed where the first move says where it starts
    tolerance = 2.0              # corner tolerance of every corner that has none of its own [mm]
    speed = 800                  # cap on the tool's speed [mm/s], left out: none
    acceleration = 20000         # cap on the tool's acceleration [mm/s^2], left out: none

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
header line with these names, blank lines and lines that start with ``#`` are skipped. The separator
is a comma or a semicolon.

**G-code** (``.nc``, ``.ngc``, ``.gcode``, ``.gco``, ``.tap``, ``.cnc``): see
``duoglide.planning.gcode``.
"""

from __future__ import annotations

import os
import pathlib
from itertools import pairwise

from duoglide.arrays import as_number
from duoglide.errors import InputError
from duoglide.motion.path import Path
from duoglide.motion.path_segments import Line, Point, as_point, as_speed
from duoglide.planning.gcode import read_gcode
from duoglide.planning.path_builder import PathBuilder
from duoglide.planning.program_toml import read_toml

GCODE = (".nc", ".ngc", ".gcode", ".gco", ".tap", ".cnc")
_COLUMNS = ["x", "y", "z", "speed"]


def read_program(file: str | os.PathLike[str], tolerance: float = 0.0) -> Path:
    """Read a path from a program file.

    Args:
        file: A TOML, CSV or G-code file.
        tolerance: Corner tolerance of the corners for which the file has none [mm].

    Raises:
        InputError: No such file, an unknown suffix, or a mistake in it: names the file, the line
            or the move, and the rule.
    """
    if not isinstance(file, str | os.PathLike):
        raise InputError(f"program file {file!r:.80}: must be a path")
    path = pathlib.Path(file)
    suffix = path.suffix.lower()
    readers = {".toml": read_toml, ".csv": read_csv, **dict.fromkeys(GCODE, read_gcode)}
    if suffix not in readers:
        raise InputError(f"{path}: unknown kind of program; known: {', '.join(readers)}")
    if as_number(tolerance, "tolerance [mm]") < 0.0:
        raise InputError(f"tolerance = {tolerance:g} mm: must be 0 or above")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read program {path}: {error}") from error
    try:
        return readers[suffix](text, tolerance)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def read_csv(text: str, tolerance: float = 0.0) -> Path:
    """Read a path from lines of coordinates.

    Raises:
        InputError: Names the line and what is wrong with it.
    """
    rows: list[tuple[int, Point, float | None]] = []
    headers = [_COLUMNS, _COLUMNS[:3]]
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        fields = [field.strip() for field in line.replace(";", ",").split(",")]
        if [field.lower() for field in fields] in headers:
            headers.clear()  # there is but one
            continue
        try:
            rows.append((number, *_row(fields)))
        except InputError as error:
            raise InputError(f"line {number}: {error}") from error
    if len(rows) < 2:
        raise InputError(f"a path needs at least two points, got {len(rows)}")
    builder = PathBuilder(place=rows[0][1])
    for (before, start, _), (number, end, speed) in pairwise(rows):
        try:
            builder.add(Line(start, end, speed), tolerance)
        except InputError as error:
            raise InputError(f"lines {before} and {number}: {error}") from error
    return builder.build()


def _row(fields: list[str]) -> tuple[Point, float | None]:
    """Read one line of coordinates."""
    values = [_number(field) for field in fields]
    if len(values) not in (3, 4):
        raise InputError(f"expected x, y, z and perhaps a speed, got {len(values)} values")
    return as_point(values[:3], "point"), as_speed(values[3] if len(values) > 3 else None)


def _number(field: str) -> float:
    try:
        return float(field)
    except ValueError as error:
        raise InputError(f"{field!r} is not a number") from error
