"""The segments that a path is programmed from: line, arc, helix, spline."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, hypot, sin
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import BoolArray, FloatArray, as_number, as_triples, read_only
from duoglide.errors import InputError

COINCIDENT = 1e-6  # [mm]; points nearer to each other than this are one point
CRAMPED = 2e-5  # [mm]; between nearer points a spline bends more sharply than can be timed
FARTHEST = 1e18  # [mm]; coordinates beyond are a mistake, and overflow further on
ROUGH = 0.005  # [mm], by which an arc's radii at both ends may differ: files round coordinates
ROUGH_SHARE = 0.001  # or by this share of the radius,
ROUGHEST = 0.5  # [mm], but never by more than this; all three as in grbl
_COLLINEAR = 1e-9  # [mm]; an arc that bulges less than this is a line
_MOST_SWEEP = 1e5  # [rad]; 16 000 turns, and the angle keeps ten digits
_UNIT = 1e-9  # by which the length of an axis may differ from 1
Point: TypeAlias = tuple[float, float, float]


def as_point(value: ArrayLike, name: str) -> Point:
    """Convert ``value`` to one finite point.

    Raises:
        InputError: Not three finite numbers.
    """
    array = as_triples(value, name)
    if array.shape != (3,):
        raise InputError(f"{name} must be one point (x, y, z), got shape {array.shape}")
    _require_near(array, name)
    x, y, z = array.tolist()
    return x, y, z


def as_speed(value: float | None, name: str = "speed [mm/s]") -> float | None:
    """Convert a cap to a float above zero; None stays: no cap.

    Raises:
        InputError: Not one finite number above zero.
    """
    if value is None:
        return None
    number = as_number(value, name)
    if number <= 0.0:
        raise InputError(f"{name} = {number:g}: must be above 0")
    return number


def distance(a: Point, b: Point) -> float:
    """Return the distance between two points [mm]."""
    return hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2])


def show(point: Point | FloatArray) -> str:
    """Write a point for people."""
    return f"({point[0]:.6g}, {point[1]:.6g}, {point[2]:.6g})"


@dataclass(frozen=True, slots=True)
class Line:
    """A straight segment.

    Attributes:
        start: Where it begins [mm].
        end: Where it ends [mm].
        speed: Cap on the tool's speed along it [mm/s]; None: no cap.

    Raises:
        InputError: The ends coincide.
    """

    start: Point
    end: Point
    speed: float | None = None

    def __post_init__(self) -> None:
        if distance(self.start, self.end) < COINCIDENT:
            raise InputError(f"line: both ends coincide at {show(self.start)} mm")

    @property
    def points(self) -> tuple[Point, ...]:
        """The points that it is programmed by."""
        return self.start, self.end


@dataclass(frozen=True, slots=True)
class Arc:
    """A circular segment through three points.

    Attributes:
        start: Where it begins [mm].
        via: A point on it, between the ends [mm].
        end: Where it ends [mm].
        speed: Cap on the tool's speed along it [mm/s]; None: no cap.

    Raises:
        InputError: The three points lie on one line, or two of them coincide.
    """

    start: Point
    via: Point
    end: Point
    speed: float | None = None

    def __post_init__(self) -> None:
        pairs = (("start", "via"), ("via", "end"), ("start", "end"))
        for one, other in pairs:
            a, b = getattr(self, one), getattr(self, other)
            if distance(a, b) < COINCIDENT:
                raise InputError(f"arc: {one} {show(a)} and {other} {show(b)} mm coincide")
        if self._bulge() < _COLLINEAR:
            raise InputError(
                f"arc: {show(self.start)}, {show(self.via)} and {show(self.end)} mm lie on one"
                " line; use a line"
            )

    def _bulge(self) -> float:
        """How far the middle one of the three points is from the line through the others [mm]."""
        a, b, c = (np.array(point) for point in self.points)
        area = float(np.linalg.norm(np.cross(b - a, c - a)))
        sides = (self.start, self.via), (self.via, self.end), (self.start, self.end)
        return area / max(distance(*side) for side in sides)

    @property
    def points(self) -> tuple[Point, ...]:
        """The points that it is programmed by."""
        return self.start, self.via, self.end

    def circle(self) -> tuple[FloatArray, FloatArray, float, float]:
        """Find the circle.

        Returns:
            Radius vectors at the start and a quarter turn on [mm]; radius [mm]; angle swept [rad],
            above 0.
        """
        a, b, c = (np.array(point) for point in self.points)
        ab, ac = b - a, c - a
        normal = np.cross(ab, ac)
        size = float(normal @ normal)
        outward = (np.cross(normal, ab) * (ac @ ac) + np.cross(ac, normal) * (ab @ ab)) / (2 * size)
        first = -outward
        radius = float(np.linalg.norm(first))
        second = np.cross(normal / np.sqrt(size), first)
        last = ac - outward
        angle = float(np.arctan2(last @ second, last @ first)) % (2.0 * np.pi)
        if angle < 1.0:  # by the chord, which keeps its digits where the radius is huge
            angle = 2.0 * float(np.arcsin(0.5 * np.sqrt(ac @ ac) / radius))
        return first, second, radius, angle


@dataclass(frozen=True, slots=True)
class Helix:
    """A turn about an axis: an arc given by its centre, or a helix where it also advances.

    It leaves ``start`` on the circle about ``centre`` and ends at ``end`` exactly: what the end is
    off the circle, along the axis or across it by rounding, is spread evenly over the turn.

    Attributes:
        start: Where it begins [mm].
        end: Where it ends [mm].
        centre: Centre of the circle, in the plane through the start [mm].
        axis: Direction of the axis, of length 1; the turn is right-handed about it.
        sweep: Angle of the turn [rad], above 0; once round is 2 pi.
        speed: Cap on the tool's speed along it [mm/s]; None: no cap.

    Raises:
        InputError: No radius, no angle, an axis that is none, or an end too far from the circle.
    """

    start: Point
    end: Point
    centre: Point
    axis: Point
    sweep: float
    speed: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.sweep <= _MOST_SWEEP:
            raise InputError(
                f"helix: a sweep of {self.sweep:g} rad; it must be above 0 and at most"
                f" {_MOST_SWEEP:g}"
            )
        if abs(hypot(*self.axis) - 1.0) > _UNIT:
            raise InputError(f"helix: axis {show(self.axis)} must have length 1")
        radius = self.radius
        if radius < COINCIDENT:
            raise InputError(f"helix: the centre {show(self.centre)} mm is its start")
        first, _, advance = self.vectors()
        aside = abs(_dot(first, self.axis))
        if aside > max(COINCIDENT, _UNIT * radius):
            raise InputError(
                f"helix: the centre {show(self.centre)} mm is {aside:.6g} mm along the axis from"
                " the start; it must be in its plane"
            )
        rise = _dot(advance, self.axis)
        if hypot(radius * self.sweep, rise) < COINCIDENT:
            raise InputError(f"helix: it is only {hypot(radius * self.sweep, rise):.3g} mm long")
        x, y, z = self.axis
        error = distance(advance, (rise * x, rise * y, rise * z))
        if error > measure_roughness(radius) + COINCIDENT:
            raise InputError(f"helix: the end is {error:.6g} mm off the circle")

    @property
    def radius(self) -> float:
        """Radius at the start [mm]."""
        return distance(self.start, self.centre)

    @property
    def points(self) -> tuple[Point, ...]:
        """The points that it is programmed by."""
        return self.start, self.end

    def vectors(self) -> tuple[Point, Point, Point]:
        """Return the radius vectors at the start and a quarter turn on, and the advance [mm]."""
        x, y, z = (s - c for s, c in zip(self.start, self.centre, strict=True))
        u, v, w = self.axis
        first, second = (x, y, z), (v * z - w * y, w * x - u * z, u * y - v * x)
        sine, drop = sin(self.sweep), 2.0 * sin(0.5 * self.sweep) ** 2
        ends = zip(self.start, self.end, first, second, strict=True)
        dx, dy, dz = (e - s - (b * sine - a * drop) for s, e, a, b in ends)
        return first, second, (dx, dy, dz)

    def length(self) -> float:
        """Return its length [mm], but for the rounding of the end."""
        _, _, advance = self.vectors()
        return hypot(self.radius * self.sweep, _dot(advance, self.axis))


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A smooth segment through points: the natural cubic spline over chord length.

    Attributes:
        through: Points [mm], shape (n, 3), n at least 2; neighbours do not coincide, and of more
            than two are at least 2e-5 mm apart.
        speed: Cap on the tool's speed along it [mm/s]; None: no cap.

    Raises:
        InputError: Fewer than two points, or neighbours that coincide or are too near.
    """

    through: FloatArray
    speed: float | None = None

    def __post_init__(self) -> None:
        points = as_triples(self.through, "points")
        require_apart(points, COINCIDENT if len(points) < 3 else CRAMPED)
        object.__setattr__(self, "through", read_only(points))

    @property
    def start(self) -> Point:
        """Where it begins [mm]."""
        return as_point(self.through[0], "start")

    @property
    def end(self) -> Point:
        """Where it ends [mm]."""
        return as_point(self.through[-1], "end")

    @property
    def points(self) -> tuple[Point, ...]:
        """The points that it is programmed by."""
        return tuple(as_point(point, "point") for point in self.through)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Spline)
            and np.array_equal(self.through, other.through)
            and self.speed == other.speed
        )

    def __hash__(self) -> int:
        return hash((self.through.tobytes(), self.speed))


Segment: TypeAlias = Line | Arc | Helix | Spline


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def measure_roughness(radius: float) -> float:
    """Return by how much an arc's radii at both ends may differ [mm]."""
    return min(max(ROUGH, ROUGH_SHARE * radius), ROUGHEST)


def merge_coincident(points: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Leave out points that coincide with the one before; both ends stay.

    Returns:
        The points that stay [mm], shape (m, 3), and which of the given ones they are, shape (n,).
    """
    kept = np.ones(len(points), dtype=bool)
    if (np.linalg.norm(np.diff(points, axis=0), axis=1) >= COINCIDENT).all():
        return points, kept
    last = 0
    for i in range(1, len(points)):
        kept[i] = np.linalg.norm(points[i] - points[last]) >= COINCIDENT
        last = i if kept[i] else last
    if last and not kept[-1]:  # the end stays, not the one that it coincides with
        kept[last], kept[-1] = False, True
    return points[kept], kept


def require_apart(points: FloatArray, least: float = COINCIDENT) -> None:
    """Refuse a list of points that is too short, or in which neighbours are nearer than ``least``.

    Raises:
        InputError: Names the two points.
    """
    if points.ndim != 2 or len(points) < 2:
        raise InputError(f"points must have shape (n, 3) with n at least 2, got {points.shape}")
    _require_near(points, "points")
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if gaps.min() < least:
        i = int(np.argmax(gaps < least))
        raise InputError(
            f"points {i} and {i + 1} coincide at {show(points[i])} mm ({gaps[i]:.3g} mm apart);"
            " leave one out"
        )


def _require_near(points: FloatArray, name: str) -> None:
    """Refuse coordinates that no machine has."""
    farthest = float(np.abs(points).max())
    if farthest > FARTHEST:
        raise InputError(f"{name}: a coordinate of {farthest:g} mm; none may exceed {FARTHEST:g}")


def reverse_segment(segment: Segment) -> Segment:
    """Return the segment from its end to its start."""
    if isinstance(segment, Line):
        return Line(segment.end, segment.start, segment.speed)
    if isinstance(segment, Arc):
        return Arc(segment.end, segment.via, segment.start, segment.speed)
    if isinstance(segment, Helix):
        return _reverse_helix(segment)
    return Spline(segment.through[::-1], segment.speed)


def _reverse_helix(helix: Helix) -> Helix:
    """Return the very same curve the other way round: its circle has the same radius."""
    first, second, _ = helix.vectors()
    cosine, sine = cos(helix.sweep), sin(helix.sweep)
    ends = zip(helix.end, first, second, strict=True)
    cx, cy, cz = (e - (a * cosine + b * sine) for e, a, b in ends)
    x, y, z = helix.axis
    return Helix(helix.end, helix.start, (cx, cy, cz), (-x, -y, -z), helix.sweep, helix.speed)


def describe_segment(segment: Segment) -> dict[str, Any]:
    """Return ``segment`` as plain values, its kind under ``"type"``."""
    if isinstance(segment, Spline):
        table: dict[str, Any] = {"type": "through", "points": segment.through.tolist()}
    else:
        kind = type(segment).__name__.lower()
        table = {"type": kind, "points": [list(point) for point in segment.points]}
    if isinstance(segment, Helix):
        table |= {"centre": list(segment.centre), "axis": list(segment.axis)}
        table["sweep"] = segment.sweep
    if segment.speed is not None:
        table["speed"] = segment.speed
    return table


def read_segment(table: Mapping[str, Any]) -> Segment:
    """Build a segment from what ``describe_segment`` gave.

    Raises:
        InputError: Not such a table.
    """
    kind = table.get("type")
    points = as_triples(table.get("points", ()), "points")
    speed = as_speed(table.get("speed"))
    if kind == "through":
        return Spline(points, speed)
    wanted = {"line": 2, "arc": 3, "helix": 2}.get(str(kind))
    if points.shape != (wanted, 3):
        raise InputError(f"not a segment: type {kind!r} with points of shape {points.shape}")
    first, *middle, last = (as_point(point, "point") for point in points)
    if kind == "helix":
        centre, axis = (as_point(table.get(name, ()), name) for name in ("centre", "axis"))
        sweep = as_number(table.get("sweep"), "sweep [rad]")
        return Helix(first, last, centre, axis, sweep, speed)
    return Arc(first, middle[0], last, speed) if middle else Line(first, last, speed)
