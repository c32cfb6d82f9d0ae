"""What each field of a machine means, kept as data beside the field.

Docstrings cannot carry that: ``python -OO`` drops them, and Python 3.13 indents them another way.
So words and unit stand in the metadata of the dataclass field. The comments of a machine file, the
errors, the docstrings of the classes, and through them the pages, all take them from there.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import Field, field, fields
from typing import Any, TypeVar

T = TypeVar("T")
_WORDS, _UNIT = "words", "unit"
_WIDTH = 100


def told(words: str, unit: str = "") -> Mapping[str, str]:
    """Return the metadata of a field.

    Args:
        words: What the field means: one phrase, without a full stop.
        unit: The unit of its numbers; empty where they have none.
    """
    return {_WORDS: words, _UNIT: unit}


def setting(default: T, words: str, unit: str = "") -> T:
    """Return a field with a default and its meaning, for the class body of a dataclass."""
    made: Any = field(default=default, metadata=told(words, unit))
    return made  # type: ignore[no-any-return]  # as dataclasses.field does: the type of the value


def phrases(kind: type[Any]) -> dict[str, str]:
    """Return what the fields of a dataclass mean, with their units, as far as they have words."""
    return {item.name: _phrase(item) for item in fields(kind) if _WORDS in item.metadata}


def unit_of(kind: type[Any], name: str) -> str:
    """Return the unit of one field."""
    return next(str(item.metadata[_UNIT]) for item in fields(kind) if item.name == name)


def sentence(words: str) -> str:
    """Return a phrase as a sentence of its own."""
    return f"{words[:1].upper()}{words[1:]}."


def documented(kind: type[T]) -> type[T]:
    """Write what the fields mean into the docstring of a dataclass, as its section Attributes."""
    entries = [f"{name}: {sentence(words)}" for name, words in phrases(kind).items()]
    lines = [
        textwrap.fill(entry, _WIDTH, initial_indent=" " * 4, subsequent_indent=" " * 8)
        for entry in entries
    ]
    kind.__doc__ = "\n".join([inspect.cleandoc(kind.__doc__ or ""), "", "Attributes:", *lines])
    return kind


def _phrase(item: Field[Any]) -> str:
    words, unit = item.metadata[_WORDS], item.metadata[_UNIT]
    return f"{words} [{unit}]" if unit else str(words)
