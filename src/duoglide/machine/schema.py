"""The machine file as a JSON schema, for editors that complete and check TOML.

Made from the settings themselves: types, defaults and meaning of their fields. Whether one number
stands for three is found out by asking the setting. What the rules say beyond types, bounds for
instance, only reading the file tells.
"""

from __future__ import annotations

import difflib
import types
import typing
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import ConfigError
from duoglide.machine.drive_profiles import PROFILES
from duoglide.machine.machine import Machine, plain
from duoglide.machine.meaning import phrases, sentence

DRAFT = "http://json-schema.org/draft-07/schema#"  # what editors of TOML read
SCHEMA = Path(__file__).with_name("machine.schema.json")
_SIMPLE = {float: "number", int: "integer", bool: "boolean", str: "string"}


def machine_schema() -> dict[str, Any]:
    """Return the schema of a machine file (JSON schema, draft 7)."""
    schema = {"$schema": DRAFT, "title": "Duoglide machine", **_table(Machine)}
    for form in schema["properties"]["drives"]["properties"]["profile"]["anyOf"]:
        form.get("items", form)["enum"] = ["", *PROFILES]  # words that are data
    return schema


def explain(key: str) -> dict[str, Any]:
    """Return what is known of one key of a machine file, by its path, ``drives.cycle``.

    Returns:
        Its schema; ``description`` has its meaning and unit.

    Raises:
        ConfigError: There is no such key; names the nearest.
    """
    known = _flat(machine_schema(), "")
    if key not in known:
        ends = [name for name in known if name.rpartition(".")[2] == key]
        near = ends or difflib.get_close_matches(key, known, 3)
        hint = f"did you mean {', '.join(near)}?" if near else "duoglide machine --out writes all"
        raise ConfigError(f"{key:.80}: no such key of a machine file; {hint}")
    return known[key]


def known_keys() -> list[str]:
    """Return every key of a machine file by its path, ``drives.cycle``."""
    return list(_flat(machine_schema(), ""))


def _flat(table: dict[str, Any], prefix: str) -> dict[str, dict[str, Any]]:
    """Return every key of a schema by its path; those of tables in a list likewise."""
    found: dict[str, dict[str, Any]] = {}
    for name, entry in table.get("properties", {}).items():
        found[prefix + name] = entry
        inner = entry.get("items", entry)
        found |= _flat(inner, f"{prefix}{name}.")
    return found


def _table(kind: type[Any]) -> dict[str, Any]:
    """Return the schema of one dataclass as a table."""
    hints, words = typing.get_type_hints(kind, localns={"FloatArray": FloatArray}), phrases(kind)
    properties: dict[str, Any] = {}
    for item in fields(kind):
        entry = _entry(kind, item, hints[item.name])
        if item.name in words:
            entry["description"] = sentence(words[item.name])
        properties[item.name] = entry
    required = [item.name for item in fields(kind) if _default(item) is MISSING]
    schema = {"type": "object", "additionalProperties": False, "properties": properties}
    return {**schema, "required": required} if required else schema


def _entry(kind: type[Any], item: Field[Any], hint: Any) -> dict[str, Any]:
    if isinstance(hint, types.UnionType):  # a value, or None for what is left out
        (hint,) = (part for part in typing.get_args(hint) if part is not type(None))
    if is_dataclass(hint):
        return _table(typing.cast("type[Any]", hint))
    entry, default = _type(hint), _default(item)
    if default is MISSING or default is None:
        return entry
    value = plain(default)
    if isinstance(value, list) and len(value) == 3 and _takes(kind, item.name, value[0]):
        entry = {"anyOf": [entry["items"], entry]}
    if not _is_table(value) and np.inf not in np.ravel(value):  # a profile may complete a table
        entry["default"] = value
    return entry


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) or (
        isinstance(value, list) and any(isinstance(item, dict) for item in value)
    )


def _type(hint: Any) -> dict[str, Any]:
    """Return the schema of a type."""
    if hint in _SIMPLE:
        return {"type": _SIMPLE[hint]}
    if isinstance(hint, type) and issubclass(hint, StrEnum):
        return {"type": "string", "enum": [member.value for member in hint]}
    if hint == FloatArray or typing.get_origin(hint) is np.ndarray:
        return {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
    inner = typing.get_args(hint)
    several = inner[-1] is not Ellipsis
    one = inner[0]
    if is_dataclass(one):
        tables = {"type": "array", "items": _table(typing.cast("type[Any]", one))}
        return {**tables, "minItems": 1, "maxItems": 3} if several else tables
    items = _type(one)
    if not several:
        return {"type": "array", "items": items}
    return {"type": "array", "items": items, "minItems": len(inner), "maxItems": len(inner)}


def _takes(kind: type[Any], name: str, value: Any) -> bool:
    """Whether a setting takes this value in the place of three."""
    try:
        kind(**{name: value})
    except ConfigError:
        return False
    return True


def _default(item: Field[Any]) -> Any:
    if item.default is not MISSING:
        return item.default
    return MISSING if item.default_factory is MISSING else item.default_factory()
