"""A program in TOML as a JSON schema, for editors that complete and check it."""

from __future__ import annotations

from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from duoglide.machine import Timing
from duoglide.machine.schema import DRAFT
from duoglide.motion.path.actions import Dwell, SetOutput, SetPayload, WaitInput
from duoglide.planning.programs.toml import KEYS, MOVES

SCHEMA = Path(__file__).with_name("program.schema.json")
_POINT: dict[str, Any] = {
    "type": "array",
    "items": {"type": "number"},
    "minItems": 3,
    "maxItems": 3,
}
_NUMBER, _INTEGER = {"type": "number"}, {"type": "integer"}


def _told(kind: dict[str, Any], words: str) -> dict[str, Any]:
    return {**kind, "description": words}


_KEYS = {
    "start": _told(_POINT, "Where the path begins; not needed where the first move says it [mm]."),
    "tolerance": _told(_NUMBER, "How far a rounded corner may be from the programmed one [mm]."),
    "speed": _told(_NUMBER, "Cap on the tool's speed [mm/s]."),
    "acceleration": _told(_NUMBER, "Cap on the tool's acceleration [mm/s^2]."),
    "timing": _told(
        {"enum": [timing.value for timing in Timing]}, "How the motion along the path is timed."
    ),
    "ignore": _told(
        {"type": "array", "items": {"type": "string"}}, "Keys to skip, each counted in the report."
    ),
    "to": _told(_POINT, "Where the move ends [mm]."),
    "via": _told(_POINT, "A point of the arc between its ends [mm]."),
    "points": _told({"type": "array", "items": _POINT}, "Points after the present one [mm]."),
    "pick": _told(_POINT, "Where to pick; left out, the present point [mm]."),
    "place": _told(_POINT, "Where to place [mm]."),
    "lift": _told(_NUMBER, "How far the way across is above the higher end [mm]."),
    "straight": _told(
        _NUMBER, "How far it rises straight up first, and comes straight down last [mm]."
    ),
    "depart": _told(_NUMBER, "Height above pick below which it stays vertical [mm]."),
    "approach": _told(_NUMBER, "Height above place below which it stays vertical [mm]."),
    "dwell": _told(_NUMBER, "How long to stand still at both ends [s]."),
    "axis": _told({**_INTEGER, "minimum": 1, "maximum": 3}, "Which drive."),
    "bit": _told({**_INTEGER, "minimum": 0, "maximum": 31}, "Which bit of its inputs or outputs."),
    "value": _told({"type": "boolean"}, "What to set, or to wait for."),
    "timeout": _told(_NUMBER, "How long to wait before the run fails [s]."),
    "seconds": _told(_NUMBER, "How long to stand still [s]."),
    "mass": _told({**_NUMBER, "minimum": 0}, "What the platform carries from here on [kg]."),
}
_ACTIONS = {
    "set_output": SetOutput,
    "wait_input": WaitInput,
    "dwell": Dwell,
    "set_payload": SetPayload,
}
_HEADER = ("start", "tolerance", "speed", "acceleration", "timing", "ignore")


def program_schema() -> dict[str, Any]:
    """Return the schema of a program in TOML (JSON schema, draft 7).

    Keys that mean nothing are refused, as the reader does, unless the program has ``ignore``.
    """
    moves = {name: (needed, optional) for name, (needed, optional, _) in MOVES.items()}
    for name, kind in _ACTIONS.items():
        free = tuple(item.name for item in fields(kind) if item.default is not MISSING)
        moves[name] = (tuple(i.name for i in fields(kind) if i.name not in free), free)
    names = {"propertyNames": {"enum": sorted(KEYS)}}
    return {
        "$schema": DRAFT,
        "title": "Duoglide program",
        "type": "object",
        "required": ["moves"],
        "properties": {
            **{key: _KEYS[key] for key in _HEADER},
            "moves": {"type": "array", "items": _move(moves)},
        },
        "if": {"not": {"required": ["ignore"]}},
        "then": {
            "propertyNames": {"enum": [*_HEADER, "moves"]},
            "properties": {"moves": {"items": names}},
        },
    }


def _move(moves: dict[str, tuple[tuple[str, ...], tuple[str, ...]]]) -> dict[str, Any]:
    """Return the schema of one move: its type, and the keys that go with it."""
    forms = [
        {
            "if": {"properties": {"type": {"const": name}}},
            "then": {
                "required": list(needed),
                "properties": {
                    **{key: _KEYS[key] for key in (*needed, *optional)},
                    **dict.fromkeys(_others(needed, optional), False),
                },
            },
        }
        for name, (needed, optional) in moves.items()
    ]
    kind = {"type": "string", "enum": list(moves), "description": "What kind of move."}
    return {"type": "object", "required": ["type"], "properties": {"type": kind}, "allOf": forms}


def _others(needed: tuple[str, ...], optional: tuple[str, ...]) -> list[str]:
    """Return the keys that mean something in other moves only."""
    return sorted(KEYS - {"type", *needed, *optional})
