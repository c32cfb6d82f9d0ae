"""Splits lines of G-code into words, and refuses what can be read in two ways."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import reduce
from operator import xor

from duoglide.errors import InputError
from duoglide.motion.path.segments import FARTHEST

LINE_END = re.compile(r"\r\n|\r|\n")  # a comment may hold what str.splitlines takes for an end
_COMMENT = re.compile(r"\([^()]*\)|;.*", re.DOTALL)
_CHECKED = re.compile(r"(?P<text>[^*();]*)\*[ \t]*(?P<sum>[0-9]{1,3})[ \t]*(?:;.*)?", re.DOTALL)
_HEAD = re.compile(r"[ \t]*[NnOo][ \t]*[0-9]+(?![0-9.])")
_WORD = re.compile(r"[ \t]*(?P<letter>[A-Za-z])[ \t]*(?P<number>[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))")
_GROUPS = {
    "motion": (
        0.0,
        1.0,
        2.0,
        3.0,
        5.0,
        5.1,
        33.0,
        38.2,
        73.0,
        76.0,
        *(80.0 + k for k in range(10)),
    ),
    "dwell": (4.0,),
    "plane": (17.0, 17.1, 18.0, 18.1, 19.0, 19.1),
    "units": (20.0, 21.0),
    "cutter compensation": (40.0, 41.0, 41.1, 42.0, 42.1),
    "tool length": (43.0, 43.1, 43.2, 49.0),
    "work offset": (*(54.0 + k for k in range(6)), 59.1, 59.2, 59.3),
    "path control": (61.0, 61.1, 64.0),
    "distance": (90.0, 91.0),
    "arc centres": (90.1, 91.1),
    "feed": (93.0, 94.0, 95.0),
    "origin": (92.0, 92.1, 92.2, 92.3),
    "spindle speed": (96.0, 97.0),
    "return": (98.0, 99.0),
}
_GROUP_OF_G = {number: name for name, numbers in _GROUPS.items() for number in numbers}
_M_GROUPS = {
    "stop": (0.0, 1.0, 2.0, 30.0, 60.0),
    "input or output": (62.0, 63.0, 64.0, 65.0, 66.0),
    "spindle": (3.0, 4.0, 5.0),
}
_GROUP_OF_M = {number: name for name, numbers in _M_GROUPS.items() for number in numbers}


@dataclass(slots=True)
class Block:
    """The words of one line.

    Attributes:
        gs: Numbers of the G words, in order, no two of one modal group.
        ms: Numbers of the M words.
        words: The other words, each at most once.
        order: All words as they stand, as ``G1``, ``M104`` or ``E``.
        glued: Words that follow a number without a blank and without a point: ``E3`` of ``X1E3``.
    """

    gs: list[float] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)
    words: dict[str, float] = field(default_factory=dict)
    order: list[str] = field(default_factory=list)
    glued: dict[str, str] = field(default_factory=dict)


def strip_line(line: str) -> str:
    """Return a line without its comments, checksum and number.

    Raises:
        InputError: A comment that does not end, a checksum that is wrong, or a block delete.
    """
    if (checked := _CHECKED.fullmatch(line)) is not None:
        line = checked["text"]
        found = reduce(xor, line.encode("utf-8", "surrogateescape"), 0)
        if found != int(checked["sum"]):
            raise InputError(
                f"the checksum is {int(checked['sum'])}, that of the line is {found}: it is damaged"
            )
    code = _COMMENT.sub("\t", line)
    if "(" in code or ")" in code:
        raise InputError("a comment goes from ( to ) in one line, without ( or ) in it")
    code = code.strip(" \t\v\f\x1a")  # control-Z once marked the end of a file
    if code.startswith("/"):
        raise InputError(
            "'/' leaves it to a switch of the controller whether the line is obeyed; delete the"
            " '/', or the line"
        )
    return _HEAD.sub("", code, count=1) if _HEAD.match(code) else code


def split_words(code: str) -> Block:
    """Split what ``strip_line`` has left of a line.

    Raises:
        InputError: Not a word, a word or a modal group twice, or a number that is too large.
    """
    block, end = Block(), 0
    while (match := _WORD.match(code, end)) is not None:
        _append(block, match["letter"].upper(), match["number"])
        if end and match.start("letter") == end and "." not in match["number"]:
            block.glued[match["letter"].upper()] = match[0]
        end = match.end()
    if code[end:].strip():
        raise _refuse_unreadable(code[end:].strip())
    for name, groups, numbers in (("G", _GROUP_OF_G, block.gs), ("M", _GROUP_OF_M, block.ms)):
        _require_one_of_each_group(name, numbers, groups)
    return block


def _append(block: Block, letter: str, text: str) -> None:
    value = float(text)
    if abs(value) > FARTHEST:
        digits = len(text.lstrip("+-").split(".")[0])
        raise InputError(f"{letter}{text:.12}...: a number of {digits} digits; a mistake")
    if letter in "GM":
        (block.gs if letter == "G" else block.ms).append(value)
        block.order.append(f"{letter}{value:g}")
        return
    if letter in block.words:
        raise InputError(f"{letter} twice")
    block.words[letter] = value
    block.order.append(letter)


def _refuse_unreadable(text: str) -> InputError:
    if re.match(r",[0-9]", text):
        return InputError(f"cannot read {text!r:.80}: the decimal sign is a point")
    if re.match(r"[+-]?[0-9.]", text):
        return InputError(f"cannot read {text!r:.80}: a number without a letter before it")
    return InputError(f"cannot read {text!r:.80}")


def _require_one_of_each_group(letter: str, numbers: list[float], groups: dict[float, str]) -> None:
    """Refuse two words of which only one can hold."""
    seen: dict[str, float] = {}
    for number in numbers:
        group = groups.get(number, f"{letter}{number:g}")
        if group in seen:
            raise InputError(
                f"{letter}{seen[group]:g} and {letter}{number:g} in one line: both set the"
                f" {group}; leave one out"
                if seen[group] != number
                else f"{letter}{number:g} twice"
            )
        seen[group] = number
