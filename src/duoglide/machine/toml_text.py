"""A machine as a file to read and change: TOML with what each key means beside it."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from typing import Any

from duoglide.machine.meaning import phrases, sentence

WIDTH = 100
HEAD = """\
# A machine for Duoglide: lengths in mm, times in s. A key that is left out takes its default;
# "duoglide machine FILE" checks the file and says what it means.

"""
_ARRAY = re.compile(r"= \[\n((?: {4}[^\[\]{}\n]*,\n)+)\]$", re.M)
_HEADING = re.compile(r"\[+([a-z_.]+)\]+$")
_KEY = re.compile(r"([a-z_]+) = ")


def commented(tables: Mapping[str, Any], kinds: Mapping[str, type]) -> str:
    """Write tables as TOML with comments.

    Args:
        tables: What the file shall hold.
        kinds: The dataclass whose fields are the keys of a table, by the table's heading; that of
            the keys before the first heading, under the empty name.
    """
    import tomli_w

    meaning = {heading: phrases(kind) for heading, kind in kinds.items()}
    text = _ARRAY.sub(_on_one_line, tomli_w.dumps(tables))
    lines, words, seen = [HEAD.rstrip("\n"), ""], meaning.get("", {}), set[str]()
    lines += _left_out(tables, meaning)
    for line in text.splitlines():
        if heading := _HEADING.match(line):
            name = heading[1]
            again = name in seen
            words = {} if again else meaning.get(name, {})
            seen.add(name)
            lines.append(line)
            outer, _, key = name.rpartition(".")
            if not again and key in meaning.get(outer, {}):
                lines += _comment(sentence(meaning[outer][key]))
            if isinstance(table := tables.get(name), Mapping):
                lines += _left_out(table, {"": words})[:-1]
        elif (key_of := _KEY.match(line)) and (word := words.get(key_of[1])):
            beside = f"{line}  # {word}"
            lines += [beside] if len(beside) <= WIDTH else [*_comment(word), line]
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"


def _on_one_line(array: re.Match[str]) -> str:
    """Put the items of an array beside each other where they fit."""
    items = " ".join(item.strip() for item in array[1].splitlines()).rstrip(",")
    return f"= [{items}]" if len(items) < WIDTH // 2 else array[0]


def _left_out(tables: Mapping[str, Any], meaning: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Tell of the keys and tables that the file could hold and does not."""
    lines = []
    for name, word in meaning.get("", {}).items():
        if name in tables:
            continue
        inner = f"[{name}] with {', '.join(meaning[name])}" if name in meaning else name
        lines += _comment(f"Not given here, {inner}: {word}")
    return [*lines, ""] if lines else []


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ")
