"""The arcs of G-code: from a centre or a radius to three points."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin, sqrt

from duoglide.errors import InputError
from duoglide.motion.path_segments import COINCIDENT, Arc, Point, distance

PLANES = {17.0: (0, 1, 2), 18.0: (2, 0, 1), 19.0: (1, 2, 0)}  # right-handed: two axes, the normal
_OFFSETS = "IJK"
_ROUGH = 0.005  # [mm], by which the radii at both ends may differ, as in LinuxCNC
_ROUGH_SHARE = 0.001  # or by this share of the radius


@dataclass(frozen=True, slots=True)
class Turn:
    """How an arc runs.

    Attributes:
        plane: 17, 18 or 19.
        counterclockwise: G3 rather than G2, seen against the plane's normal.
    """

    plane: float
    counterclockwise: bool


def arcs(
    start: Point, end: Point, turn: Turn, words: dict[str, float], speed: float | None
) -> tuple[Arc, ...]:
    """Build an arc, or the two halves of a full circle; takes I, J, K or R out of ``words``.

    Raises:
        InputError: A helix, no centre, a centre that does not fit, or a radius that is too small.
    """
    first, second, normal = PLANES[turn.plane]
    if abs(end[normal] - start[normal]) >= COINCIDENT:
        raise InputError(
            f"helical arcs are not read: {'XYZ'[normal]} changes by"
            f" {end[normal] - start[normal]:g} mm in the plane G{turn.plane:g}"
        )
    a, b = (start[first], start[second]), (end[first], end[second])
    is_circle = distance(start, end) < COINCIDENT
    if "R" in words:
        if is_circle:
            raise InputError("a full circle needs I, J or K; R does not say where its centre is")
        centre = _centre_by_radius(a, b, words.pop("R"), turn.counterclockwise)
    else:
        centre = _centre_by_offset(a, (first, second), words)
    radius, angle, sweep = _sweep(a, b, centre, turn.counterclockwise, is_circle)

    def point(share: float) -> Point:
        at = angle + share * sweep
        values = [0.0, 0.0, 0.0]
        values[first] = centre[0] + radius * cos(at)
        values[second] = centre[1] + radius * sin(at)
        values[normal] = start[normal]
        return values[0], values[1], values[2]

    if is_circle:
        half = point(0.5)
        return Arc(start, point(0.25), half, speed), Arc(half, point(0.75), start, speed)
    return (Arc(start, point(0.5), end, speed),)


def _centre_by_offset(
    a: tuple[float, float], axes: tuple[int, int], words: dict[str, float]
) -> tuple[float, float]:
    """Find the centre from I, J, K, which count from the start."""
    letters = [_OFFSETS[axis] for axis in axes]
    if not any(letter in words for letter in letters):
        raise InputError(f"an arc needs {' or '.join(letters)}, or R")
    return a[0] + words.pop(letters[0], 0.0), a[1] + words.pop(letters[1], 0.0)


def _centre_by_radius(
    a: tuple[float, float], b: tuple[float, float], radius: float, counterclockwise: bool
) -> tuple[float, float]:
    """Find the centre from R: the short way round, or with R below 0 the long one."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    chord = hypot(dx, dy)
    square = radius * radius - 0.25 * chord * chord
    if square < -_ROUGH * abs(radius) or radius == 0.0:
        raise InputError(f"R{radius:g} is too small: the ends are {chord:.6g} mm apart")
    height = sqrt(max(square, 0.0)) / chord
    side = 1.0 if counterclockwise == (radius > 0.0) else -1.0
    return a[0] + 0.5 * dx - side * height * dy, a[1] + 0.5 * dy + side * height * dx


def _sweep(
    a: tuple[float, float],
    b: tuple[float, float],
    centre: tuple[float, float],
    counterclockwise: bool,
    is_circle: bool,
) -> tuple[float, float, float]:
    """Return radius, angle of the start, and angle swept with its sign."""
    before, after = (hypot(p[0] - centre[0], p[1] - centre[1]) for p in (a, b))
    if before < COINCIDENT:
        raise InputError("the centre of the arc is its start")
    if abs(after - before) > max(_ROUGH, _ROUGH_SHARE * before):
        raise InputError(
            f"the centre does not fit: the start is {before:.6g} mm away from it, the end"
            f" {after:.6g} mm"
        )
    angle, last = (atan2(p[1] - centre[1], p[0] - centre[0]) for p in (a, b))
    sweep = (last - angle) % (2.0 * pi)
    if is_circle:
        sweep = 2.0 * pi if counterclockwise else -2.0 * pi
    elif not counterclockwise:
        sweep -= 2.0 * pi
    return 0.5 * (before + after), angle, sweep
