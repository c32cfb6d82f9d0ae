"""Reads G-code, the dialect of RS-274/NGC (LinuxCNC), in millimetres.

| word | meaning here |
|---|---|
| G0, G1 | straight; the first one only says where the program starts, and needs X, Y and Z |
| G2, G3 | arc, clockwise or not, with I, J, K from the start to the centre, or with R |
| G4 P or S | stand still, in seconds |
| G17, G18, G19 | plane of the arcs: XY, ZX, YZ |
| G21, G90, G91 | millimetres, absolute, relative; G20 (inches) is refused |
| G61, G64 P | exact corners; corner tolerance P [mm] |
| F | cap on the tool's speed in G1, G2 and G3 [mm/min] |
| M2, M30 | end of the program; what follows is not read |
| M62, M64 P / M63, M65 P | output on / off; P counts 32 to a drive: P16 is bit 16 of axis 1 |
| M66 P L3 (or L4) Q | wait until input P is on (off), for at most Q seconds |

G40, G49, G54, G80, G91.1 and G94 say what holds here anyway. Comments, N, O and % are skipped. A
move that goes nowhere is skipped. Everything else is refused, and never guessed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from duoglide.errors import InputError
from duoglide.motion.actions import Dwell, SetOutput, WaitInput
from duoglide.motion.path import Path
from duoglide.motion.path_segments import COINCIDENT, Line, Point, distance
from duoglide.planning.gcode_arcs import PLANES, Turn, arcs
from duoglide.planning.path_builder import PathBuilder

_COMMENT = re.compile(r"\([^()]*\)|;.*$")
_WORD = re.compile(r"([A-Z])([+-]?(?:\d+\.?\d*|\.\d+))")
_MOTIONS = {0.0, 1.0, 2.0, 3.0}
_HOLDS_ANYWAY = {21.0, 40.0, 49.0, 54.0, 80.0, 91.1, 94.0}
_LONGEST_DWELL = 100.0  # [s]; a longer one was meant in milliseconds
_BITS = 32


@dataclass(slots=True)
class _Interpreter:
    """The modal state of a program.

    Attributes:
        builder: The path so far.
        tolerance: Corner tolerance [mm].
        motion: Which of G0 to G3 is on; None before the first.
        plane: Plane of the arcs.
        relative: Whether coordinates are relative.
        feed: Cap on the speed [mm/s].
        ended: Whether M2 or M30 has come.
    """

    tolerance: float
    builder: PathBuilder = field(default_factory=PathBuilder)
    motion: float | None = None
    plane: float = 17.0
    relative: bool = False
    feed: float | None = None
    ended: bool = False

    def run(self, line: str) -> None:
        """Obey one line."""
        gs, ms, words = _words(line)
        if "F" in words:
            self.feed = _positive("F", words.pop("F"), "mm/min") / 60.0
        dwell = self._set_modes(gs, words)
        if dwell:
            self.builder.act(Dwell(_dwell_seconds(words)))
        for m in ms:
            self._m_word(m, words)
        if not dwell and any(axis in words for axis in "XYZIJKR"):
            self._move(words)
        if words:
            raise InputError(f"{', '.join(words)}: of no meaning in this line")

    def _set_modes(self, gs: list[float], words: dict[str, float]) -> bool:
        """Obey G words that change how others are read; tell whether one is a dwell."""
        for g in gs:
            if g in _MOTIONS:
                self.motion = g
            elif g in PLANES:
                self.plane = g
            elif g in (90.0, 91.0):
                self.relative = g == 91.0
            elif g == 61.0:
                self.tolerance = 0.0
            elif g == 64.0:
                self.tolerance = _taken(words, "P", "G64 needs P, the corner tolerance [mm]")
            elif g == 20.0:
                raise InputError("G20: inches are not read; write millimetres (G21)")
            elif g != 4.0 and g not in _HOLDS_ANYWAY:
                raise InputError(f"G{g:g} is not known here")
        return 4.0 in gs

    def _m_word(self, m: float, words: dict[str, float]) -> None:
        if m in (2.0, 30.0):
            self.ended = True
        elif m in (62.0, 63.0, 64.0, 65.0):
            axis, bit = _line_of(words, f"M{m:g}")
            self.builder.act(SetOutput(axis, bit, m in (62.0, 64.0)))
        elif m == 66.0:
            axis, bit = _line_of(words, "M66")
            level = _taken(words, "L", "M66 needs L3 (on) or L4 (off)")
            if level not in (3.0, 4.0):
                raise InputError(f"M66 L{level:g}: must be L3 (on) or L4 (off)")
            timeout = _taken(words, "Q", "M66 needs Q, the longest time to wait [s]")
            self.builder.act(WaitInput(axis, bit, level == 3.0, timeout))
        else:
            raise InputError(f"M{m:g} is not known here; outputs are M62 to M65, inputs M66")

    def _move(self, words: dict[str, float]) -> None:
        """Go to the next point."""
        if self.motion is None:
            raise InputError("coordinates before any of G0, G1, G2, G3")
        given = {axis: words.pop(axis) for axis in "XYZ" if axis in words}
        place = self.builder.place
        if place is None:
            self.builder.place = self._start(given)
            return
        base = place if self.relative else (0.0, 0.0, 0.0)
        x, y, z = (
            base[i] + given[axis] if axis in given else place[i] for i, axis in enumerate("XYZ")
        )
        if self.motion in (2.0, 3.0):
            turn = Turn(self.plane, counterclockwise=self.motion == 3.0)
            for arc in arcs(place, (x, y, z), turn, words, self.feed):
                self.builder.add(arc, self.tolerance)
            return
        self._straight(place, (x, y, z))

    def _straight(self, place: Point, goal: Point) -> None:
        if distance(place, goal) >= COINCIDENT:
            feed = self.feed if self.motion == 1.0 else None
            self.builder.add(Line(place, goal, feed), self.tolerance)

    def _start(self, given: Mapping[str, float]) -> Point:
        """Take the first point as the start."""
        missing = [axis for axis in "XYZ" if axis not in given]
        if missing or self.relative or self.motion in (2.0, 3.0):
            raise InputError(
                "the first move says where the program starts: it must be G0 or G1, absolute, with"
                " X, Y and Z"
            )
        return given["X"], given["Y"], given["Z"]


def read_gcode(text: str, tolerance: float = 0.0) -> Path:
    """Read a path from G-code.

    Args:
        text: The program.
        tolerance: Corner tolerance [mm] until a G61 or G64.

    Raises:
        InputError: Names the line and what is wrong with it.
    """
    interpreter = _Interpreter(tolerance)
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            interpreter.run(line)
        except InputError as error:
            raise InputError(f"line {number}: {error}") from error
        if interpreter.ended:
            break
    return interpreter.builder.build()


def _words(line: str) -> tuple[list[float], list[float], dict[str, float]]:
    """Split a line into its G words, its M words, and the others."""
    code = re.sub(r"\s+", "", _COMMENT.sub("", line.upper()))
    if code.startswith("%"):
        return [], [], {}
    code = re.sub(r"^/?(?:[NO]\d+)?", "", code)
    gs: list[float] = []
    ms: list[float] = []
    words: dict[str, float] = {}
    end = 0
    for match in _WORD.finditer(code):
        if match.start() != end:
            break
        letter, value = match[1], float(match[2])
        if letter in words:
            raise InputError(f"{letter} twice")
        if letter in "GM":
            (gs if letter == "G" else ms).append(value)
        else:
            words[letter] = value
        end = match.end()
    if end != len(code):
        raise InputError(f"cannot read {code[end:]!r}")
    return gs, ms, words


def _taken(words: dict[str, float], letter: str, rule: str) -> float:
    """Take a word that has to be there."""
    if letter not in words:
        raise InputError(rule)
    return words.pop(letter)


def _line_of(words: dict[str, float], name: str) -> tuple[int, int]:
    """Turn P into a drive and a bit of its digital lines."""
    number = _taken(words, "P", f"{name} needs P, the number of the line")
    if number != int(number) or not 0 <= number < 3 * _BITS:
        raise InputError(f"{name} P{number:g}: must be a whole number from 0 to {3 * _BITS - 1}")
    return int(number) // _BITS + 1, int(number) % _BITS


def _dwell_seconds(words: dict[str, float]) -> float:
    letter = "P" if "P" in words else "S"
    seconds = _positive(letter, _taken(words, letter, "G4 needs P or S, in seconds"), "s")
    if seconds >= _LONGEST_DWELL:
        raise InputError(
            f"G4 {letter}{seconds:g} would stand still for {seconds:g} s; {letter} is in seconds,"
            f" for {seconds:g} ms write {letter}{seconds / 1000.0:g}"
        )
    return seconds


def _positive(letter: str, value: float, unit: str) -> float:
    if value <= 0.0:
        raise InputError(f"{letter}{value:g}: must be above 0 {unit}")
    return value
