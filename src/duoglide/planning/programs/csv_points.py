"""Reads lines of coordinates, and refuses numbers that another country would read otherwise."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from duoglide.errors import InputError
from duoglide.motion.path.path import Path
from duoglide.motion.path.segments import Line, Point, as_point, as_speed
from duoglide.planning.programs.gcode_words import LINE_END
from duoglide.planning.programs.path_builder import PathBuilder

_COLUMNS = ["x", "y", "z", "speed"]
_SEPARATORS = (";", "\t", ",")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
# 1.200 is 1.2, or in German 1200; from 20 m and 20 m/s on nobody means thousands
_THOUSANDS = re.compile(r"[+-]?(?:[1-9]|1[0-9])\.[0-9]{3}")
_WHOLE = re.compile(r"[+-]?[0-9]+")
_HINT = "numbers are written as -41.5, and columns parted by a comma, a semicolon or a tab"


@dataclass(frozen=True, slots=True)
class _Row:
    """The fields of one line, and its number."""

    line: int
    fields: list[str]


def read_csv(text: str, tolerance: float = 0.0) -> Path:
    """Read a path from lines of coordinates.

    Raises:
        InputError: Names the line and what is wrong with it.
    """
    lines = list(_number_lines(text))
    separator = _find_separator(lines)
    rows = [
        _split_row(number, line, separator)
        for number, line in lines[_names_separator(lines, separator) :]
    ]
    header = [field.lower() for field in rows[0].fields] if rows else []
    has_header = header in (_COLUMNS, _COLUMNS[:3])
    rows = rows[has_header:]
    points = [_read_row(row, len(header) if has_header else len(_COLUMNS)) for row in rows]
    _require_one_reading(rows, separator, has_header)
    if len(points) < 2:
        raise InputError(f"a path needs at least two points, got {len(points)}")
    builder = PathBuilder(place=points[0][1])
    for (before, start, _), (number, end, speed) in pairwise(points):
        try:
            builder.add(Line(start, end, speed), tolerance)
        except InputError as error:
            raise InputError(f"lines {before} and {number}: {error}") from error
    return builder.build()


def _number_lines(text: str) -> Iterator[tuple[int, str]]:
    """Return the lines that hold something, with their numbers."""
    for number, line in enumerate(LINE_END.split(text), start=1):
        parts = line.strip(" \x1a").split(",")  # tabs beside commas are blanks
        kept = ",".join(part.strip(" \t") for part in parts) if len(parts) > 1 else parts[0]
        if kept.strip(",;\t ") and not kept.lstrip().startswith("#"):
            yield number, kept


def _find_separator(lines: list[tuple[int, str]]) -> str:
    """Return what parts the columns of the whole file."""
    said = [s for s in _SEPARATORS if _names_separator(lines, s)]
    found = (s for s in _SEPARATORS if any(s in line for _, line in lines))
    return said[0] if said else next(found, ",")


def _names_separator(lines: list[tuple[int, str]], separator: str) -> bool:
    """Whether the first line is that by which spreadsheet programs say what parts the columns."""
    return bool(lines) and lines[0][1].lower() == f"sep={separator}"


def _split_row(number: int, line: str, separator: str) -> _Row:
    try:
        (fields,) = csv.reader([line], delimiter=separator, strict=True)
    except (csv.Error, ValueError) as error:
        raise InputError(f"line {number}: cannot be split into columns: {error}") from error
    fields = [field.strip() for field in fields]
    while fields and not fields[-1]:
        fields.pop()
    return _Row(number, fields)


def _require_one_reading(rows: list[_Row], separator: str, has_header: bool) -> None:
    """Refuse a file whose numbers mean something else where the decimal sign is a comma."""
    pointed = [(row, field) for row in rows for field in row.fields if "." in field]
    if separator != "," and pointed and all(_THOUSANDS.fullmatch(field) for _, field in pointed):
        row, field = pointed[0]
        raise InputError(
            f"line {row.line}: {field!r:.80} may be {float(field):g} or, as some countries write"
            f" thousands, {field.replace('.', '')}; write {float(field):g} or {field}0, or part the"
            " columns by commas"
        )
    if separator != "," or has_header or pointed:
        return
    for row in rows:
        if len(row.fields) == len(_COLUMNS) and _may_hold_decimal_comma(row.fields):
            raise InputError(
                f"line {row.line}: {','.join(row.fields):.80} may be x, y, z and a speed, or three"
                " numbers of which one has a decimal comma; begin the file with the line"
                " x,y,z,speed"
            )


def _may_hold_decimal_comma(fields: list[str]) -> bool:
    """Whether two whole numbers beside each other may be one number."""
    return any(
        _WHOLE.fullmatch(one) and _WHOLE.fullmatch(other) and other.isdigit()
        for one, other in pairwise(fields)
    )


def _read_row(row: _Row, columns: int) -> tuple[int, Point, float | None]:
    """Read one line of coordinates."""
    values = [_number(row.line, field) for field in row.fields]
    if not 3 <= len(values) <= columns:
        raise InputError(
            f"line {row.line}: expected x, y, z{' and perhaps a speed' * (columns > 3)}, got"
            f" {len(values)} values"
        )
    try:
        point = as_point(values[:3], "point")
        return row.line, point, as_speed(values[3] if len(values) > 3 else None)
    except InputError as error:
        raise InputError(f"line {row.line}: {error}") from error


def _number(line: int, field: str) -> float:
    if _NUMBER.fullmatch(field) is None:
        raise _refuse_number(line, field)
    return float(field)


def _refuse_number(line: int, field: str) -> InputError:
    if field.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return InputError(f"line {line}: {field}: every number must be finite")
    hint = f"; {_HINT}" if re.search(r"[0-9]", field) else ""
    return InputError(f"line {line}: {field!r:.80} is not a number{hint}")
