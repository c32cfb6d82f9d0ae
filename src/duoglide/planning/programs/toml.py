"""Reads the TOML programs that ``duoglide.planning.programs.read`` describes."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from duoglide.arrays import as_number, as_triples
from duoglide.errors import InputError
from duoglide.machine.toml_read import read_tables
from duoglide.motion.path.actions import read_action
from duoglide.motion.path.path import Path, as_timing
from duoglide.motion.path.segments import (
    Arc,
    Line,
    Point,
    Spline,
    as_point,
    as_speed,
)
from duoglide.planning.programs.notes import ProgramNotes
from duoglide.planning.programs.path_builder import PathBuilder
from duoglide.planning.programs.pick_and_place import pick_and_place

_HEADER = {"start", "tolerance", "speed", "acceleration", "timing", "ignore", "moves"}
_ACTIONS = ("set_output", "wait_input", "dwell", "set_payload")


def read_toml(text: str, tolerance: float = 0.0, notes: ProgramNotes | None = None) -> Path:
    """Read a path from a TOML program.

    Args:
        text: The program.
        tolerance: Corner tolerance of the corners for which it has none [mm].
        notes: Which unknown keys to skip, besides those that its key ``ignore`` names.

    Raises:
        InputError: Names the move and the key, and what is wrong with it.
    """
    notes = ProgramNotes() if notes is None else notes
    table = read_tables(text)
    notes.skip_also(table.get("ignore", ()), KEYS)
    _refuse_unknown(table, _HEADER, notes)
    moves = table.get("moves")
    if not isinstance(moves, list) or not all(isinstance(move, dict) for move in moves):
        raise InputError("it needs a list of tables [[moves]]")
    corner = as_number(table.get("tolerance", tolerance), "tolerance [mm]")
    builder = PathBuilder()
    if "start" in table:
        builder.place = as_point(table["start"], "start")
    for index, move in enumerate(moves, start=1):
        try:
            _add(builder, move, corner, notes)
        except InputError as error:
            raise InputError(f"move {index}: {error}") from error
    path = builder.build(table.get("speed"), table.get("acceleration"))
    return replace(path, timing=as_timing(table["timing"])) if "timing" in table else path


def _add(
    builder: PathBuilder, move: Mapping[str, Any], tolerance: float, notes: ProgramNotes
) -> None:
    """Append one move."""
    kind = move.get("type")
    move = {key: value for key, value in move.items() if key in KEYS or not notes.skip(key)}
    if isinstance(kind, str) and kind in _ACTIONS:
        builder.act(read_action(move))
        return
    if not isinstance(kind, str) or kind not in MOVES:
        known = ", ".join((*MOVES, *_ACTIONS))
        if "type" not in move:
            raise InputError(f"it lacks a type; there are {known}")
        raise InputError(f"type = {kind!r:.80}: must be one of {known}")
    needed, optional, add = MOVES[kind]
    _refuse_unknown(move, {"type", *needed, *optional}, notes)
    for key in needed:
        if key not in move:
            raise InputError(f"{kind} needs {key}")
    add(builder, {"tolerance": tolerance, **move})


def _add_line(builder: PathBuilder, move: Mapping[str, Any]) -> None:
    to = as_point(move["to"], "to")
    builder.add(Line(_place(builder), to, as_speed(move.get("speed"))), move["tolerance"])


def _add_arc(builder: PathBuilder, move: Mapping[str, Any]) -> None:
    via, to = as_point(move["via"], "via"), as_point(move["to"], "to")
    builder.add(Arc(_place(builder), via, to, as_speed(move.get("speed"))), move["tolerance"])


def _add_through(builder: PathBuilder, move: Mapping[str, Any]) -> None:
    points = as_triples([_place(builder), *_read_points(move)], "points")
    builder.add(Spline(points, as_speed(move.get("speed"))), move["tolerance"])


def _add_polyline(builder: PathBuilder, move: Mapping[str, Any]) -> None:
    for point in _read_points(move):
        _add_line(builder, {**move, "to": point})


def _pick_and_place(builder: PathBuilder, move: Mapping[str, Any]) -> None:
    values = {key: value for key, value in move.items() if key != "type"}
    values.setdefault("pick", builder.place)
    if values["pick"] is None:
        raise InputError("pick_and_place needs pick, or a start of the program")
    builder.extend(pick_and_place(**values))


def _add_arch(builder: PathBuilder, move: Mapping[str, Any]) -> None:
    sizes = {key: move[key] for key in ("lift", "straight") if key in move}
    builder.extend(Path.arch(_place(builder), move["to"], **sizes))


_Add = Callable[[PathBuilder, Mapping[str, Any]], None]
MOVES: dict[str, tuple[tuple[str, ...], tuple[str, ...], _Add]] = {
    "line": (("to",), ("speed", "tolerance"), _add_line),
    "arc": (("via", "to"), ("speed", "tolerance"), _add_arc),
    "through": (("points",), ("speed", "tolerance"), _add_through),
    "polyline": (("points",), ("speed", "tolerance"), _add_polyline),
    "pick_and_place": (
        ("place",),
        ("pick", "lift", "tolerance", "depart", "approach", "dwell"),
        _pick_and_place,
    ),
    "arch": (("to",), ("lift", "straight"), _add_arch),
}


KEYS = _HEADER | {key for needed, free, _ in MOVES.values() for key in (*needed, *free)}
KEYS |= {"type", "axis", "bit", "value", "timeout", "seconds", "mass"}
"""All keys that mean something in a TOML program."""


def _place(builder: PathBuilder) -> Point:
    """Return where the path has got to, or refuse a program that has not said where it starts."""
    if builder.place is None:
        raise InputError("the program does not say where it starts: start = [x, y, z]")
    return builder.place


def _read_points(move: Mapping[str, Any]) -> list[Point]:
    array = as_triples(move["points"], "points")
    if array.ndim != 2:
        raise InputError("points must be a list of points [x, y, z]")
    return [as_point(point, "point") for point in array]


def _refuse_unknown(table: Mapping[str, Any], known: set[str], notes: ProgramNotes) -> None:
    for key in table:
        if key not in known and not (key not in KEYS and notes.skip(key)):
            near = difflib.get_close_matches(key, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(sorted(known))}"
            raise InputError(f"{key:.80}: no such key; {hint}")
