"""A machine as a file to read and change: TOML with what each key means beside it.

The words are those of the docstrings, so that they cannot drift.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from typing import Any

WIDTH = 100
HEAD = """\
# A machine for Duoglide: lengths in mm, times in s. A key that is left out takes its default;
# "duoglide machine FILE" checks the file and says what it means.

"""
_ARRAY = re.compile(r"= \[\n((?: {4}[^\[\]{}\n]*,\n)+)\]$", re.M)
_HEADING = re.compile(r"\[+([a-z_.]+)\]+$")
_KEY = re.compile(r"([a-z_]+) = ")
_SHAPE = re.compile(r", (?:stored as a read-only array of )?shape \([^)]*\)")
_ENTRY = re.compile(r"^ {8}(\w+): (.*(?:\n {12}.*)*)", re.M)


def commented(tables: Mapping[str, Any], kinds: Mapping[str, type]) -> str:
    """Write tables as TOML with comments.

    Args:
        tables: What the file shall hold.
        kinds: The class whose docstring explains the keys of a table, by the table's heading; of
            the keys before the first heading, under the empty name.
    """
    import tomli_w

    text = _ARRAY.sub(_on_one_line, tomli_w.dumps(tables))
    lines, words, seen = [HEAD.rstrip("\n"), ""], _words(kinds.get("")), set[str]()
    lines += _left_out(tables, kinds)
    for line in text.splitlines():
        if heading := _HEADING.match(line):
            name = heading[1]
            again, kind = name in seen, kinds.get(name)
            words = {} if again else _words(kind)
            seen.add(name)
            lines.append(line)
            if kind is not None and not again:
                lines += _comment((kind.__doc__ or "").split("\n", 1)[0])
        elif (key := _KEY.match(line)) and (word := words.get(key[1])):
            beside = f"{line}  # {word}"
            lines += [beside] if len(beside) <= WIDTH else [*_comment(word), line]
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"


def _on_one_line(array: re.Match[str]) -> str:
    """Put the items of an array beside each other where they fit."""
    items = " ".join(item.strip() for item in array[1].splitlines()).rstrip(",")
    return f"= [{items}]" if len(items) < WIDTH // 2 else array[0]


def _words(kind: type | None) -> dict[str, str]:
    """Return what the docstring of a class says of each attribute."""
    found = _ENTRY.findall((kind.__doc__ or "").split("Raises:")[0]) if kind else []
    return {name: _plain(" ".join(text.split())).removesuffix(".") for name, text in found}


def _left_out(tables: Mapping[str, Any], kinds: Mapping[str, type]) -> list[str]:
    """Tell of the keys and tables that the file could hold and does not."""
    lines = []
    for name, word in _words(kinds.get("")).items():
        if name in tables:
            continue
        inner = f"[{name}] with {', '.join(_words(kinds[name]))}" if name in kinds else name
        lines += _comment(f"Not given here, {inner}: {word.replace('None:', 'left out,')}")
    return [*lines, ""] if lines else []


def _comment(text: str) -> list[str]:
    return textwrap.wrap(_plain(text), WIDTH, initial_indent="# ", subsequent_indent="# ")


def _plain(text: str) -> str:
    """Take away what only Sphinx and numpy need."""
    return _SHAPE.sub("", text.replace("]_", "]").replace("``", ""))
