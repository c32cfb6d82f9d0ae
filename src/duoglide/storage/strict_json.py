"""JSON as the standard has it: Python's reader takes NaN, and of two equal keys the last one."""

from __future__ import annotations

import json
from typing import Any


def loads(text: bytes) -> Any:
    """Read JSON.

    Raises:
        ValueError: It is none, or says two things under one key.
        RecursionError: It is nested too deeply.
    """
    return _DECODER.decode(text.decode())


def _constant(name: str) -> float:
    raise ValueError(f"{name} is no number")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) != len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {twice[:40]!r} is there twice")
    return table


_DECODER = json.JSONDecoder(parse_constant=_constant, object_pairs_hook=_object)
