"""Reads the text and the TOML of files that people write."""

from __future__ import annotations

import codecs
import os
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from duoglide.errors import ConfigError, InputError

T = TypeVar("T")

_MARKS = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
_DEEPEST = 32  # levels of tables and lists
_LARGEST = 2**63  # integers of TOML have 64 bits


def load_file(path: str | os.PathLike[str], what: str, build: Callable[[dict[str, Any]], T]) -> T:
    """Read a TOML file that describes something.

    Args:
        path: Where it is.
        what: What the file is, for errors: "machine file".
        build: Makes the thing of the file's tables.

    Raises:
        ConfigError: Not a path, no such file, not TOML, or what ``build`` refuses; names the file.
    """
    if not isinstance(path, str | os.PathLike):
        raise ConfigError(f"{what} {path!r:.80}: must be the path of a TOML file")
    try:
        text = decoded(Path(path).read_bytes())
    except (OSError, ValueError, InputError) as error:  # ValueError: a zero byte in the name
        raise ConfigError(f"cannot read {what} {path}: {error}") from error
    try:
        tables = read_tables(text, str(path))
    except InputError as error:
        raise ConfigError(str(error)) from error
    try:
        return build(tables)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error


def decoded(data: bytes, *, comments_in_any: bool = False) -> str:
    """Decode a file that is to be UTF-8.

    Args:
        data: What the file holds.
        comments_in_any: Let bytes that are no UTF-8 pass, as surrogates, because the reader refuses
            everything but ASCII outside comments.

    Raises:
        InputError: Another encoding; names the line.
    """
    for mark, name in _MARKS.items():
        if data.startswith(mark):
            raise InputError(f"line 1: the file is in {name}; save it as UTF-8")
    if b"\0" in data:
        raise InputError(f"line {_line(data, data.index(0))}: a zero byte; save the file as UTF-8")
    try:
        return data.decode("utf-8-sig", "surrogateescape" if comments_in_any else "strict")
    except UnicodeDecodeError as error:
        raise InputError(
            f"line {_line(data, error.start)}: byte {data[error.start]:#04x} is no UTF-8; save the"
            " file as UTF-8"
        ) from error


def _line(data: bytes, place: int) -> int:
    return data.count(b"\n", 0, place) + 1


def read_tables(text: str, name: str = "it") -> dict[str, Any]:
    """Read TOML.

    Args:
        text: What the file holds.
        name: What to call the file in an error.

    Raises:
        InputError: Not TOML, nested too deeply, or an integer of more than 64 bits.
    """
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        why = str(error) if isinstance(error, ValueError) else "it nests too deeply"
        raise InputError(f"{name} is not TOML: {why}") from error
    try:
        _require_sane(tables)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error
    return tables


def _require_sane(tables: dict[str, Any]) -> None:
    """Refuse values that cannot even be shown in a message."""
    todo: list[tuple[str, Any, int]] = [("", tables, 0)]
    while todo:
        name, value, depth = todo.pop()
        if depth > _DEEPEST:
            raise InputError(f"{name:.80}: nested more than {_DEEPEST} levels deep")
        if isinstance(value, int) and not -_LARGEST <= value < _LARGEST:
            raise InputError(f"{name:.80}: an integer of {value.bit_length()} bits; TOML has 64")
        if isinstance(value, dict):
            todo += [(name or key, entry, depth + 1) for key, entry in value.items()]
        elif isinstance(value, list):
            todo += [(name, entry, depth + 1) for entry in value]
