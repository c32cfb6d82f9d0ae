"""Reads G-code, the dialect of RS-274/NGC (LinuxCNC), in millimetres.

| word | meaning here |
|---|---|
| G0, G1 | straight; the first ones, up to X, Y and Z, only say where the program starts |
| G2, G3 | arc or helix, clockwise or not: I, J, K from the start to the centre, or R |
| G80 | no motion mode: coordinates are refused until the next of G0 to G3 |
| G4 P or S | stand still, in seconds; for 0 s nothing happens |
| G17, G18, G19 | plane of the arcs: XY, ZX, YZ |
| G21, G90, G91 | millimetres, absolute, relative; G20 (inches) is refused |
| G61, G61.1 | exact corners |
| G64 P | corner tolerance P [mm]; without P that of the whole program, and the report says so |
| G64 P Q | the same: within Q LinuxCNC would leave points out; here all are kept, and it is told |
| F | cap on the tool's speed in G1, G2 and G3 [mm/min] |
| M2, M30 | end of the program; what follows is not read |
| M62, M64 P / M63, M65 P | output on / off; P counts 32 to a drive: P16 is bit 16 of axis 1 |
| M66 P L3 (or L4) Q | wait until input P is on (off), for at most Q seconds |

G40, G49, G54, G91.1 and G94 say what holds here anyway. Comments, N and O are skipped, checksums
(``*71``) are tested. A program may begin with a line ``%``; then the next one ends it. A move that
goes nowhere is skipped. An arc keeps its centre, its axis and its angle; its end may be off the
circle by 0.005 mm or 0.1 % of the radius, as in grbl; where start and end are the same to 5e-7 rad,
it goes once round, as in LinuxCNC and grbl. With R it never goes once round.

Everything else is refused, and never guessed: two words of one modal group in a line, blanks inside
numbers, a decimal comma, ``/``. Words of slicers and CAM systems that neither move, offset nor
change units can be named, and are then skipped and counted: ``--ignore M104,E``. ``E`` takes
``G92 E0`` with it. With words of 3D printers among them, ``G4 P`` is refused, which they count in
milliseconds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from duoglide.errors import InputError
from duoglide.motion.path.actions import Dwell, SetOutput, WaitInput
from duoglide.motion.path.path import Path
from duoglide.motion.path.segments import COINCIDENT, Line, Point, as_point, distance
from duoglide.planning.programs.gcode_arcs import PLANES, Turn, build_arc
from duoglide.planning.programs.gcode_skip import read_block
from duoglide.planning.programs.gcode_words import LINE_END, Block, strip_line
from duoglide.planning.programs.notes import ProgramNotes, skip_hint
from duoglide.planning.programs.path_builder import PathBuilder

_MOTIONS = {0.0, 1.0, 2.0, 3.0}
_NO_MOTION = 80.0
_HOLDS_ANYWAY = {21.0, 40.0, 49.0, 54.0, 91.1, 94.0}
_INSTEAD = {
    20.0: "inches are not read; write millimetres (G21)",
    90.1: "absolute arc centres are not read; write I, J, K from the start of the arc (G91.1)",
    92.0: "the origin is not moved; where a slicer sets E with it, --ignore E skips it",
    93.0: "F as inverse time is not read; write F in mm/min (G94)",
    95.0: "F per revolution is not read; write F in mm/min (G94)",
}
_LONGEST_DWELL = 100.0  # [s]; a longer one was meant in milliseconds
_BITS = 32


@dataclass(slots=True)
class _Interpreter:
    """The modal state of a program.

    Attributes:
        whole_tolerance: Corner tolerance of the program [mm], until a G61 or G64, and after a G64
            without P.
        notes: What may be skipped, and what is to be told.
        builder: The path so far.
        place: Where the program has got to [mm]; the path is there but for moves too short for one.
        known: Which coordinates of the start have been given [mm].
        motion: Which of G0 to G3 is on, or G80; None before the first.
        plane: Plane of the arcs.
        relative: Whether coordinates are relative.
        feed: Cap on the speed [mm/s].
        tolerance: Corner tolerance now [mm].
        line: Number of the line.
        ended: Whether M2 or M30 has come.
    """

    whole_tolerance: float
    notes: ProgramNotes
    builder: PathBuilder = field(default_factory=PathBuilder)
    place: Point | None = None
    known: dict[str, float] = field(default_factory=dict)
    motion: float | None = None
    plane: float = 17.0
    relative: bool = False
    feed: float | None = None
    tolerance: float = 0.0
    line: int = 0
    ended: bool = False

    def run(self, code: str) -> None:
        """Obey one line without its comments."""
        block = read_block(code, self.notes)
        words = block.words
        if "F" in words:
            self.feed = _require_positive("F", words.pop("F"), "mm/min") / 60.0
        dwell = self._set_modes(block.gs, words)
        if dwell and (seconds := self._read_dwell(words)) > 0.0:
            self.builder.act(Dwell(seconds))
        for m in block.ms:
            self._obey_m(m, words)
        if not dwell and any(axis in words for axis in "XYZIJKR"):
            self._move(words)
        if words:
            raise InputError(
                f"{', '.join(words)}: of no meaning in this line{_suggest(words, block)}"
            )

    def _set_modes(self, gs: list[float], words: dict[str, float]) -> bool:
        """Obey G words that change how others are read; tell whether one is a dwell."""
        for g in gs:
            if g in _MOTIONS or g == _NO_MOTION:
                self.motion = g
            elif g in PLANES:
                self.plane = g
            elif g in (90.0, 91.0):
                self.relative = g == 91.0
            elif g in (61.0, 61.1):
                self.tolerance = 0.0
            elif g == 64.0:
                self.tolerance = self._read_smoothness(words)
            elif g in _INSTEAD:
                raise InputError(f"G{g:g}: {_INSTEAD[g]}")
            elif g != 4.0 and g not in _HOLDS_ANYWAY:
                raise InputError(f"G{g:g} is not known here")
        return 4.0 in gs

    def _read_smoothness(self, words: dict[str, float]) -> float:
        """Return the corner tolerance after G64 [mm]."""
        if "P" in words:
            tolerance = words.pop("P")
            if words.pop("Q", None) is not None:
                self.notes.remark(self.line, "G64 Q: no point is left out; P is the tolerance")
            if tolerance < 0.0:
                raise InputError(f"G64 P{tolerance:g}: must be 0 mm or above")
            return tolerance
        whole = self.whole_tolerance
        means = f"the smoothest within {whole:g} mm" if whole else "exact corners, of 0 mm"
        self.notes.remark(self.line, f"G64 without P: {means}, the program's tolerance")
        return whole

    def _obey_m(self, m: float, words: dict[str, float]) -> None:
        if m in (2.0, 30.0):
            self.ended = True
        elif m in (62.0, 63.0, 64.0, 65.0):
            axis, bit = _find_line(words, f"M{m:g}")
            self.builder.act(SetOutput(axis, bit, m in (62.0, 64.0)))
        elif m == 66.0:
            axis, bit = _find_line(words, "M66")
            level = _take(words, "L", "M66 needs L3 (on) or L4 (off)")
            if level not in (3.0, 4.0):
                raise InputError(f"M66 L{level:g}: must be L3 (on) or L4 (off)")
            timeout = _take(words, "Q", "M66 needs Q, the longest time to wait [s]")
            self.builder.act(WaitInput(axis, bit, level == 3.0, timeout))
        else:
            raise InputError(
                f"M{m:g} is not known here; outputs are M62 to M65, inputs M66"
                f"{skip_hint([f'M{m:g}'])}"
            )

    def _move(self, words: dict[str, float]) -> None:
        """Go to the next point."""
        if self.motion is None:
            raise InputError("coordinates before any of G0, G1, G2, G3")
        if self.motion == _NO_MOTION:
            raise InputError(
                "coordinates after G80, which leaves no motion mode; write G0, G1, G2 or G3"
            )
        given = {axis: words.pop(axis) for axis in "XYZ" if axis in words}
        place = self.place
        if place is None:
            self._begin(given)
            return
        base = place if self.relative else (0.0, 0.0, 0.0)
        x, y, z = (
            base[i] + given[axis] if axis in given else place[i] for i, axis in enumerate("XYZ")
        )
        goal = as_point((x, y, z), "the end of the move [mm]")
        start = self.builder.place or place
        if self.motion in (2.0, 3.0):
            turn = Turn(self.plane, counterclockwise=self.motion == 3.0)
            self.builder.add(build_arc(start, goal, turn, words, self.feed), self.tolerance)
        elif distance(start, goal) >= COINCIDENT:
            feed = self.feed if self.motion == 1.0 else None
            self.builder.add(Line(start, goal, feed), self.tolerance)
        self.place = goal

    def _read_dwell(self, words: dict[str, float]) -> float:
        letter = "P" if "P" in words else "S"
        seconds = _take(words, letter, "G4 needs P or S, in seconds")
        if seconds < 0.0:
            raise InputError(f"G4 {letter}{seconds:g}: must be 0 s or above")
        if letter == "P" and seconds > 0.0 and self.notes.is_for_a_printer:
            raise InputError(
                f"G4 P{seconds:g} may be seconds or, as printers count, milliseconds; write G4 S,"
                " in seconds"
            )
        if seconds >= _LONGEST_DWELL:
            raise InputError(
                f"G4 {letter}{seconds:g} would stand still for {seconds:g} s; {letter} is in"
                f" seconds, for {seconds:g} ms write {letter}{seconds / 1000.0:g}"
            )
        return seconds

    def _begin(self, given: Mapping[str, float]) -> None:
        """Take coordinates of the start, which CAM systems give as X and Y first, and then Z."""
        twice = self.known.keys() & given.keys()
        if twice or not given or self.relative or self.motion in (2.0, 3.0):
            raise InputError(
                "the first moves say where the program starts: they must be G0 or G1, absolute, and"
                " give each of X, Y and Z once"
            )
        self.known |= given
        if len(self.known) == len("XYZ"):
            self.place = self.known["X"], self.known["Y"], self.known["Z"]
            self.builder.place = self.place

    def build(self) -> Path:
        """Return the path.

        Raises:
            InputError: Nothing moves, or the start was never said.
        """
        if self.known and self.place is None:
            missing = " and ".join(axis for axis in "XYZ" if axis not in self.known)
            raise InputError(f"it does not say where it starts: there is no {missing}")
        return self.builder.build()


def read_gcode(text: str, tolerance: float = 0.0, notes: ProgramNotes | None = None) -> Path:
    """Read a path from G-code.

    Args:
        text: The program.
        tolerance: Corner tolerance [mm] until a G61 or G64 P.
        notes: Which words to skip; takes how often they were, and remarks.

    Raises:
        InputError: Names the line and what is wrong with it.
    """
    interpreter = _Interpreter(tolerance, ProgramNotes() if notes is None else notes)
    interpreter.tolerance = tolerance
    frame = _Frame()
    for number, line in enumerate(LINE_END.split(text), start=1):
        interpreter.line = number
        try:
            code = frame.take_inside(strip_line(line), number)
            if code:
                interpreter.run(code)
        except InputError as error:
            raise InputError(f"line {number}: {error}") from error
        if frame.closed or interpreter.ended:
            break
    return interpreter.build()


@dataclass(slots=True)
class _Frame:
    """The lines ``%`` around a program.

    Attributes:
        opened: Whether the program began with one.
        closed: Whether the second one has come: the program has ended.
        begun: Whether there was code.
        stray: The line of a ``%`` after code that no other one is before.
    """

    opened: bool = False
    closed: bool = False
    begun: bool = False
    stray: int | None = None

    def take_inside(self, code: str, number: int) -> str:
        """Return what a line holds of the program.

        Raises:
            InputError: Something in the line of a ``%``, or code after one that may end it or not.
        """
        if code and self.stray is not None:
            raise InputError(
                f"it comes after the % of line {self.stray}, which may begin the program or end it;"
                " begin the program with %, or delete that line"
            )
        if not code.startswith("%"):
            self.begun = self.begun or bool(code)
            return code
        first = not (self.opened or self.begun)
        name = code[1:].strip()
        if name and not (first and name.isascii() and name.isdigit()):  # DIN 66025: %123
            raise InputError(f"cannot read {code!r:.80}: % stands alone in its line")
        self.closed = self.opened
        self.opened = self.opened or first
        if self.begun and not self.opened:
            self.stray = number
        return ""


def _suggest(words: Mapping[str, float], block: Block) -> str:
    """Say how to go on from words of no meaning."""
    if glued := [text.strip() for letter, text in block.glued.items() if letter in words]:
        return f"; if {glued[0]} is an exponent, write the number in full"
    return skip_hint(words)


def _take(words: dict[str, float], letter: str, rule: str) -> float:
    """Take a word that has to be there."""
    if letter not in words:
        raise InputError(rule)
    return words.pop(letter)


def _find_line(words: dict[str, float], name: str) -> tuple[int, int]:
    """Turn P into a drive and a bit of its digital lines."""
    number = _take(words, "P", f"{name} needs P, the number of the line")
    if number != int(number) or not 0 <= number < 3 * _BITS:
        raise InputError(f"{name} P{number:g}: must be a whole number from 0 to {3 * _BITS - 1}")
    return int(number) // _BITS + 1, int(number) % _BITS


def _require_positive(letter: str, value: float, unit: str) -> float:
    if value <= 0.0:
        raise InputError(f"{letter}{value:g}: must be above 0 {unit}")
    return value
