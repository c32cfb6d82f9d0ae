"""The arcs of G-code: a centre, an axis and an angle, from a centre or a radius."""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, atan2, hypot, pi, sqrt

from duoglide.errors import InputError
from duoglide.motion.path.segments import COINCIDENT, ROUGH, Helix, Point, measure_roughness

PLANES = {17.0: (0, 1, 2), 18.0: (2, 0, 1), 19.0: (1, 2, 0)}  # right-handed: two axes, the normal
_OFFSETS = "IJK"
_SAME_ANGLE = 5e-7  # [rad]; LinuxCNC (1e-6) and grbl (5e-7) go once round below
_NEARLY_CLOSED = 0.01  # chord over radius below which R < 0 leaves the centre to the last digits
_Flat = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Turn:
    """How an arc runs.

    Attributes:
        plane: 17, 18 or 19.
        counterclockwise: G3 rather than G2, seen against the plane's normal.
    """

    plane: float
    counterclockwise: bool

    @property
    def axis(self) -> Point:
        """Direction about which the turn is right-handed."""
        axis = [0.0, 0.0, 0.0]
        axis[PLANES[self.plane][2]] = 1.0 if self.counterclockwise else -1.0
        return axis[0], axis[1], axis[2]


def build_arc(
    start: Point, end: Point, turn: Turn, words: dict[str, float], speed: float | None
) -> Helix:
    """Build an arc, a full circle or a helix; takes I, J, K or R out of ``words``.

    Raises:
        InputError: No centre, a centre that does not fit, or a radius that is too small.
    """
    first, second, normal = PLANES[turn.plane]
    a, b = (start[first], start[second]), (end[first], end[second])
    if "R" in words:
        flat, sweep = _by_radius(a, b, words.pop("R"), turn.counterclockwise)
    else:
        flat = _centre_by_offset(a, (first, second), words)
        sweep = _sweep(a, b, flat, turn.counterclockwise)
    centre = [0.0, 0.0, 0.0]
    centre[first], centre[second], centre[normal] = *flat, start[normal]
    return Helix(start, end, (centre[0], centre[1], centre[2]), turn.axis, sweep, speed)


def _centre_by_offset(a: _Flat, axes: tuple[int, int], words: dict[str, float]) -> _Flat:
    """Find the centre from I, J, K, which count from the start."""
    letters = [_OFFSETS[axis] for axis in axes]
    if not any(letter in words for letter in letters):
        raise InputError(f"an arc needs {' or '.join(letters)}, or R")
    return a[0] + words.pop(letters[0], 0.0), a[1] + words.pop(letters[1], 0.0)


def _by_radius(a: _Flat, b: _Flat, radius: float, counterclockwise: bool) -> tuple[_Flat, float]:
    """Find the centre and the angle from R: the short way round, or with R below 0 the long one."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    chord = hypot(dx, dy)
    if chord < COINCIDENT:
        raise InputError("a full circle needs I, J or K; R does not say where its centre is")
    half = 0.5 * chord
    if half - abs(radius) > 0.5 * ROUGH:
        raise InputError(f"R{radius:g} is too small: the ends are {chord:.6g} mm apart")
    if radius < 0.0 and chord < -_NEARLY_CLOSED * radius:
        raise InputError(
            f"R{radius:g} with ends {chord:.6g} mm apart: the last digits would say where the"
            " centre is; write I, J or K"
        )
    size = max(abs(radius), half)
    height = sqrt((size - half) * (size + half)) / chord
    side = 1.0 if counterclockwise == (radius > 0.0) else -1.0
    centre = a[0] + 0.5 * dx - side * height * dy, a[1] + 0.5 * dy + side * height * dx
    short = 2.0 * asin(min(half / size, 1.0))
    return centre, short if radius > 0.0 else 2.0 * pi - short


def _sweep(a: _Flat, b: _Flat, centre: _Flat, counterclockwise: bool) -> float:
    """Return the angle from ``a`` to ``b`` in the direction of the turn [rad]; once round: 2 pi."""
    (ax, ay), (bx, by) = ((p[0] - centre[0], p[1] - centre[1]) for p in (a, b))
    before, after = hypot(ax, ay), hypot(bx, by)
    if before < COINCIDENT:
        raise InputError("the centre of the arc is its start")
    if abs(after - before) > measure_roughness(before):
        raise InputError(
            f"the centre does not fit: the start is {before:.6g} mm away from it, the end"
            f" {after:.6g} mm"
        )
    if hypot(bx - ax, by - ay) < COINCIDENT:
        return 2.0 * pi
    angle = atan2(ax * by - ay * bx, ax * bx + ay * by)
    if not counterclockwise:
        angle = -angle
    return angle + 2.0 * pi if angle < _SAME_ANGLE else angle
