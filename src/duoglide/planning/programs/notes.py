"""What a reader of programs may skip, and what it has to tell about its reading."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from duoglide.errors import InputError

_WORD = re.compile(r"([A-Z])(\d{1,4}(?:\.\d{1,2})?)?")
_G92_E = re.compile(r"G92 *E[-+.\d]*")
_KEY = re.compile(r"[a-z][a-z0-9_-]+")
_LETTERS = {"D", "E", "H", "S", "T"}  # extruder, spindle and tool: nothing that this robot moves
_G = {"G92", "G96", "G97", "G98", "G99"}  # of G92 only what sets E; see ``gcode_skip``
_READ_HERE = {2.0, 30.0, 62.0, 63.0, 64.0, 65.0, 66.0}
_NEVER = {
    0.0: "stops for a person",
    60.0: "stops for a person",
    25.0: "stops for a person",
    226.0: "stops for a person",
    291.0: "stops for a person",
    601.0: "stops for a person",
    808.0: "goes to another place of the program",
    579.0: "changes units",
    556.0: "offsets",
    852.0: "offsets",
    605.0: "moves",
    112.0: "is an emergency stop",
    72.0: "brings back other modes",
    97.0: "goes to another place of the program",
    98.0: "goes to another program",
    99.0: "goes to another place of the program",
    92.0: "changes units",
    149.0: "changes units",
    200.0: "changes units",
    350.0: "changes units",
    401.0: "moves",
    402.0: "moves",
    420.0: "offsets",
    421.0: "offsets",
    667.0: "offsets",
    669.0: "offsets",
    125.0: "moves",
    600.0: "moves",
    701.0: "moves",
    702.0: "moves",
    206.0: "offsets",
    218.0: "offsets",
    290.0: "offsets",
    428.0: "offsets",
    665.0: "offsets",
    666.0: "offsets",
    851.0: "offsets",
}
_MEANINGS = {"unit", "units", "offset", "origin", "frame", "relative", "incremental", "scale"}
_MEANINGS |= {
    "rotation",
    "rotate",
    "shift",
    "mirror",
    "inch",
    "inches",
    "feed",
    "wait",
    "move",
    "repeat",
}


@dataclass(slots=True)
class ProgramNotes:
    """What may be skipped, how often it was, and what a person should know of the reading.

    Attributes:
        names: Words of G-code (``M104``, ``E``) and keys of TOML (``author``) to skip.
        ignored: How often each of them was skipped, in order of first appearance.
        remarks: Sentences about the reading.
    """

    names: frozenset[str] = frozenset()
    ignored: Counter[str] = field(default_factory=Counter)
    remarks: list[str] = field(default_factory=list)

    @classmethod
    def ignoring(cls, names: Iterable[str], keys: Iterable[str] = ()) -> ProgramNotes:
        """Start notes that skip ``names``; ``keys`` are those that TOML programs have anyway.

        Raises:
            InputError: A name that moves, offsets or changes units, or that is read here.
        """
        notes = cls()
        notes.skip_also(names, keys)
        return notes

    def skip_also(self, names: Iterable[str], keys: Iterable[str] = ()) -> None:
        """Skip more names; see ``ignoring``."""
        if isinstance(names, str) or not isinstance(names, Iterable):
            raise InputError(f"ignore = {names!r:.80}: must be a list of words, as M104 or E")
        self.names |= {_name(name, frozenset(keys)) for name in names}

    def skip(self, name: str) -> bool:
        """Tell whether a word is to be skipped, and count it."""
        if name not in self.names:
            return False
        self.ignored[name] += 1
        return True

    @property
    def is_for_a_printer(self) -> bool:
        """Whether the names are those of 3D printers, whose dwells are in milliseconds."""
        return "E" in self.names or any(n[0] == "M" and float(n[1:]) >= 100.0 for n in self.names)

    def remark(self, line: int, text: str) -> None:
        """Tell something, once."""
        if not any(known.endswith(text) for known in self.remarks):
            self.remarks.append(f"line {line}: {text}")


def skip_hint(words: Iterable[str]) -> str:
    """Return how to skip words that are not read, or nothing where not all of them can be."""
    try:
        names = sorted(ProgramNotes.ignoring(list(words)).names)
    except InputError:
        return ""
    return f"; --ignore {','.join(names)} skips it"


def _name(given: object, keys: frozenset[str]) -> str:
    """Return a name as it is counted, or refuse it."""
    text = given.strip() if isinstance(given, str) else ""
    if _KEY.fullmatch(text) and not _WORD.fullmatch(text.upper()):
        if text in keys or not _MEANINGS.isdisjoint(re.split("[-_]", text)):
            raise _make_refusal(text, "says where or how to move")
        return text
    text = text.upper()
    if _G92_E.fullmatch(text):
        return "G92"
    if text.startswith("G92 "):
        raise _make_refusal(text, "moves the origin")
    word = _WORD.fullmatch(text)
    if not word:
        raise InputError(f"ignore {given!r:.80}: not a word; words are as M104, E or G92")
    letter, number = word[1], word[2]
    if number is None:
        return _take_letter(letter)
    name = f"{letter}{float(number):g}"
    if letter == "G" and name not in _G:
        raise _make_refusal(name, "moves, offsets or changes how other words are read")
    if letter == "M" and float(number) in _READ_HERE:
        raise _make_refusal(name, "is obeyed here")
    if letter == "M" and float(number) in _NEVER:
        raise _make_refusal(name, _NEVER[float(number)])
    if letter not in "GM":
        return _take_letter(letter)  # T1 is the word T
    return name


def _take_letter(letter: str) -> str:
    if letter in _LETTERS:
        return letter
    if letter in "XYZABCUVWIJKR":
        raise _make_refusal(letter, "moves")
    raise _make_refusal(letter, "belongs to the words that are read, or is none by itself")


def _make_refusal(name: str, why: str) -> InputError:
    return InputError(
        f"ignore {name}: it {why}; only words that neither move, offset nor change units can be"
        " skipped"
    )
