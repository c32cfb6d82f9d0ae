"""Rules for the fields of a machine description, and the errors that name key, value and rule."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from enum import StrEnum
from math import inf
from typing import Any, TypeVar

import numpy as np

from duoglide.arrays import as_floats, as_number
from duoglide.errors import ConfigError, InputError
from duoglide.machine.meaning import phrases

T = TypeVar("T")
Word = TypeVar("Word", bound=StrEnum)
NONE = "inf"  # how JSON, which has no infinite numbers, holds a limit that is none
_COUNTS = {2: "two", 3: "three"}


def number(key: str, value: object, unit: str = "mm") -> float:
    """Return ``value`` as a finite float, or raise ConfigError."""
    try:
        return as_number(value, key)
    except InputError as error:
        raise ConfigError(f"{key} = {value!r:.80}: must be one finite number [{unit}]") from error


def positive(key: str, value: object, unit: str = "mm") -> float:
    """Return ``value`` as a finite float above zero, or raise ConfigError."""
    result = number(key, value, unit)
    if result <= 0.0:
        raise ConfigError(f"{key} = {result:g}: must be above 0 [{unit}]")
    return result


def not_negative(key: str, value: object, unit: str = "mm") -> float:
    """Return ``value`` as a finite float of at least zero, or raise ConfigError."""
    result = number(key, value, unit)
    if result < 0.0:
        raise ConfigError(f"{key} = {result:g}: must be 0 or above [{unit}]")
    return result


def whole(key: str, value: object, low: int, high: int) -> int:
    """Return ``value`` as an integer within [low, high], or raise ConfigError."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise ConfigError(f"{key} = {value!r:.80}: must be a whole number")
    if not low <= value <= high:
        raise ConfigError(f"{key} = {value}: must be from {low} to {high}")
    return int(value)


def true_or_false(key: str, value: object) -> bool:
    """Return ``value`` as a bool, or raise ConfigError."""
    if not isinstance(value, bool):
        raise ConfigError(f"{key} = {value!r:.80}: must be true or false")
    return value


def one_of(kind: type[Word], key: str, value: object) -> Word:
    """Return the member of an enumeration of words that ``value`` names, or raise ConfigError."""
    for member in kind:
        if value == member.value:
            return member
    words = ", ".join(f'"{member.value}"' for member in kind)
    raise ConfigError(f"{key} = {value!r:.80}: must be one of {words}")


def known_word(key: str, value: object, known: Iterable[str]) -> str:
    """Return ``value`` if it is one of the known words, or raise ConfigError."""
    words = list(known)
    if not isinstance(value, str) or value not in words:
        near = difflib.get_close_matches(str(value), words, 1)
        hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(words)}"
        raise ConfigError(f"{key} = {value!r:.80}: no such {key}; {hint}")
    return value


def several_whole(key: str, value: object, low: int, high: int, count: int) -> tuple[int, ...]:
    """Return ``count`` whole numbers within [low, high], or raise ConfigError."""
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != count:
        raise ConfigError(f"{key} = {value!r:.80}: must be {_COUNTS[count]} whole numbers")
    return tuple(whole(f"{key}[{i}]", v, low, high) for i, v in enumerate(value))


def three_whole(key: str, value: object, low: int, high: int) -> tuple[int, int, int]:
    """Return three whole numbers within [low, high], or raise ConfigError."""
    first, second, third = several_whole(key, value, low, high, 3)
    return first, second, third


def triple(key: str, value: object, unit: str = "mm") -> tuple[float, float, float]:
    """Return three finite floats from three values, or raise ConfigError."""
    try:
        array = as_floats(value, key)  # type: ignore[arg-type]  # found out here
    except InputError as error:
        raise ConfigError(f"{key} = {value!r:.80}: must be finite numbers [{unit}]") from error
    if array.shape != (3,):
        raise ConfigError(f"{key} = {value!r:.80}: must be three numbers [{unit}]")
    return float(array[0]), float(array[1]), float(array[2])


def any_per_carriage(key: str, value: object, unit: str) -> tuple[float, float, float]:
    """Return one value per carriage, from one number or three, or raise ConfigError."""
    return triple(key, _for_each_carriage(value), unit)


def per_carriage(
    key: str, value: object, unit: str, *, or_none: bool = False
) -> tuple[float, float, float]:
    """Return one positive value per carriage, from one number or three, or raise ConfigError.

    Args:
        key: Of the field.
        value: What was given for it.
        unit: Of the numbers.
        or_none: Whether inf is welcome, as a number or as the text that JSON has for it: no limit.
    """
    given = _for_each_carriage(value)
    endless = [or_none and isinstance(item, float | str) and item in (inf, NONE) for item in given]
    known = [1.0 if none else item for none, item in zip(endless, given, strict=True)]
    try:
        values = triple(key, known, unit)
    except ConfigError:
        values = triple(key, value, unit)  # raises again, with what was given
    if min(values) <= 0.0:
        raise ConfigError(f"{key} = {value!r:.80}: every value must be above 0 [{unit}]")
    first, second, third = (
        inf if none else item for none, item in zip(endless, values, strict=True)
    )
    return first, second, third


def _for_each_carriage(value: object) -> list[Any]:
    """Return the items of a list or an array, or one value three times."""
    array = isinstance(value, np.ndarray) and value.ndim > 0
    if array or (isinstance(value, Sequence) and not isinstance(value, str)):
        return list(value)  # type: ignore[call-overload,no-any-return]  # it has items
    return [value] * 3


def build(kind: type[T], table: object, prefix: str) -> T:
    """Construct the dataclass ``kind`` from a TOML table.

    Args:
        kind: A dataclass whose constructor raises ConfigError with ``field = value: rule``.
        table: What TOML gave for it.
        prefix: Where the table stands in the file, to put before the field's name.

    Raises:
        ConfigError: Not a table, a key that is not a field (names the nearest one), a key that is
            missing, or a broken rule.
    """
    if not isinstance(table, Mapping):
        raise ConfigError(f"{prefix} = {table!r:.80}: must be a table")
    dot = f"{prefix}." if prefix else ""
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]  # a dataclass
    meaning = {name: f" ({words})" for name, words in phrases(kind).items()}
    for key in table:
        if key not in names:
            near = difflib.get_close_matches(key, names, 1)
            hint = f"; known: {', '.join(names)}"
            if near:
                hint = f"; did you mean {dot}{near[0]}?{meaning.get(near[0], '')}"
            raise ConfigError(f"{dot}{key:.80}: no such key{hint}")
    for field in fields(kind):  # type: ignore[arg-type]  # a dataclass
        if (
            field.default is MISSING
            and field.default_factory is MISSING
            and field.name not in table
        ):
            words = meaning.get(field.name, "")
            raise ConfigError(f"{dot}{field.name}: missing; it has no default{words}")
    arguments: dict[str, Any] = dict(table)
    try:
        return kind(**arguments)
    except ConfigError as error:
        raise ConfigError(f"{dot}{error}") from error
