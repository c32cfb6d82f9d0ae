"""A path as the user programs it: segments, corners, caps and actions.

Points are positions of the tool's tip in the work frame [mm]. A waypoint is an end of a segment;
waypoint 0 is the start. The corner between two segments is either exact (tolerance 0: the motion
comes to rest there, unless the segments join smoothly), or rounded within a corner tolerance, or
rounded by an explicit ``Blend``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_number, as_triples
from duoglide.errors import InputError, PathError
from duoglide.machine import Timing
from duoglide.motion.path.actions import Action, needs_rest, read_action, require_action
from duoglide.motion.path.segments import (
    COINCIDENT,
    Arc,
    Line,
    Point,
    Segment,
    Spline,
    as_point,
    as_speed,
    describe_segment,
    distance,
    merge_coincident,
    read_segment,
    require_apart,
    reverse_segment,
    show,
)
from duoglide.motion.rounding.blend import Blend, Corner, as_corner, turn_corner
from duoglide.motion.rounding.course import lay_course
from duoglide.motion.rounding.round_segments import RoundedCurve, round_course

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ARCH_REACH = 2.0  # how much further an arch bends along the way than upwards


@dataclass(frozen=True)
class Path:
    """A path of the tool's tip.

    Built by ``line``, ``polyline``, ``arc``, ``through``, ``fitted`` and ``arch``.

    Attributes:
        segments: At least one; each begins where the one before ends.
        corners: One per joint of two segments: a corner tolerance [mm] or a ``Blend``.
        actions: Pairs of a waypoint's index and what to do there, in order.
        tool_speed: Cap on the tool's speed along the whole path [mm/s]; None: no cap.
        tool_acceleration: Cap on the tool's acceleration [mm/s^2]; None: no cap.
        timing: How to time it, where ``plan`` is not told; None: as the machine has it.

    Raises:
        InputError: Names what breaks a rule.
    """

    segments: tuple[Segment, ...]
    corners: tuple[Corner, ...] = ()
    actions: tuple[tuple[int, Action], ...] = ()
    tool_speed: float | None = None
    tool_acceleration: float | None = None
    timing: Timing | None = None

    def __post_init__(self) -> None:
        store = object.__setattr__
        store(self, "segments", tuple(self.segments))
        store(self, "corners", tuple(as_corner(corner) for corner in self.corners))
        store(self, "actions", tuple(sorted(self.actions, key=lambda item: item[0])))
        store(self, "tool_speed", as_speed(self.tool_speed, "tool_speed [mm/s]"))
        cap = as_speed(self.tool_acceleration, "tool_acceleration [mm/s^2]")
        store(self, "tool_acceleration", cap)
        store(self, "timing", None if self.timing is None else as_timing(self.timing))
        count = len(self.segments)
        if count == 0 or len(self.corners) != count - 1:
            raise InputError(f"{count} segments need {count - 1} corners, got {len(self.corners)}")
        for i, (one, other) in enumerate(zip(self.segments, self.segments[1:], strict=False)):
            if one.end != other.start and distance(one.end, other.start) >= COINCIDENT:
                raise InputError(
                    f"segment {i + 1} starts at {show(other.start)} mm,"
                    f" {distance(one.end, other.start):.6g} mm from where segment {i} ends"
                )
        for waypoint, action in self.actions:
            require_action(action, waypoint, count)

    @classmethod
    def line(cls, a: ArrayLike, b: ArrayLike, speed: float | None = None) -> Path:
        """Build a straight path from ``a`` to ``b`` [mm]; ``speed`` caps the tool [mm/s].

        Raises:
            InputError: Not points, or they coincide.
        """
        return cls.polyline([as_point(a, "a"), as_point(b, "b")], speed=speed)

    @classmethod
    def polyline(
        cls,
        points: ArrayLike,
        tolerance: float = 0.0,
        *,
        blends: Sequence[Corner] | Blend | None = None,
        speed: float | Sequence[float | None] | None = None,
    ) -> Path:
        """Build straight segments through ``points``.

        Args:
            points: Shape (n, 3), n at least 2 [mm].
            tolerance: Corner tolerance of every corner [mm]; 0: come to rest in each. A corner
                that turns back by more than 170 degrees is a rest, whatever the tolerance. Points
                that are dense for it become a curve, see ``fitted``; those that coincide, one.
            blends: Instead of a tolerance: one blend for every corner, or one entry per corner.
            speed: Cap on the tool's speed [mm/s]: one for all segments, or one for each.

        Raises:
            InputError: Not points, or neighbours coincide, or a rule is broken.
        """
        array = as_triples(points, "points")
        if blends is None and as_number(tolerance, "tolerance [mm]") > 0.0 and array.ndim == 2:
            array, kept = merge_coincident(array)
            if isinstance(speed, Sequence) and len(speed) == kept.size - 1:
                speed = [cap for cap, stays in zip(speed, kept[1:], strict=True) if stays]
        require_apart(array)
        corners: list[Point] = [(x, y, z) for x, y, z in array.tolist()]
        count = len(corners) - 1
        if blends is None:
            blends = [as_number(tolerance, "tolerance [mm]")] * (count - 1)
        elif isinstance(blends, Blend):
            blends = [blends] * (count - 1)
        elif not isinstance(blends, Sequence):
            raise InputError(f"blends = {blends!r:.80}: must be a Blend, or one entry per corner")
        speeds = list(speed) if isinstance(speed, Sequence) else [speed] * count
        if len(speeds) != count:
            raise InputError(f"{count} segments need {count} speeds, got {len(speeds)}")
        lines = [
            Line(a, b, as_speed(cap))
            for a, b, cap in zip(corners[:-1], corners[1:], speeds, strict=True)
        ]
        return cls(tuple(lines), tuple(blends))

    @classmethod
    def fitted(cls, points: ArrayLike, tolerance: float, *, speed: float | None = None) -> Path:
        """Build a smooth path within a tolerance of dense points, as of a scanned or sliced curve.

        Points are dense where the lines between them are shorter than the blends that the tolerance
        allows. There the path becomes a spline of continuous curvature that passes every point
        within the tolerance and leaves no line by more: that is bounded on every span. It uses
        what the tolerance leaves to be quick. Corners between longer lines stay corners, rounded
        within the tolerance. Points that coincide are one.

        Args:
            points: Shape (n, 3), n at least 2 [mm]; both ends are kept exactly.
            tolerance: How far the path may be from the points, above 0 [mm].
            speed: Cap on the tool's speed [mm/s]; None: no cap.

        Raises:
            InputError: Not points, or the tolerance is not above 0.
        """
        if as_number(tolerance, "tolerance [mm]") <= 0.0:
            raise InputError(
                f"tolerance = {tolerance:g} mm: must be above 0; Path.through passes points exactly"
            )
        return cls.polyline(points, tolerance, speed=speed)

    @classmethod
    def arc(
        cls, start: ArrayLike, via: ArrayLike, end: ArrayLike, speed: float | None = None
    ) -> Path:
        """Build the arc of a circle from ``start`` through ``via`` to ``end`` [mm].

        Raises:
            InputError: Not points, or they coincide or lie on one line.
        """
        points = as_point(start, "start"), as_point(via, "via"), as_point(end, "end")
        return cls((Arc(*points, as_speed(speed)),))

    @classmethod
    def through(cls, points: ArrayLike, speed: float | None = None) -> Path:
        """Build a smooth path through ``points`` [mm], shape (n, 3): a natural cubic spline.

        Raises:
            InputError: Not points, or neighbours coincide.
        """
        return cls((Spline(as_triples(points, "points"), as_speed(speed)),))

    @classmethod
    def arch(
        cls, start: ArrayLike, end: ArrayLike, lift: float = 25.0, straight: float = 5.0
    ) -> Path:
        """Build an arch (JUMP) motion: up, across and down in one sweep.

        Args:
            start: Where it begins [mm].
            end: Where it ends [mm].
            lift: How far the top is above the higher end [mm].
            straight: How far it rises straight up first, and comes straight down last [mm].

        Raises:
            InputError: Not points; the ends are not apart in x or y; lift not above straight.
        """
        a, b = as_point(start, "start"), as_point(end, "end")
        rise, stem = as_number(lift, "lift [mm]"), as_number(straight, "straight [mm]")
        across = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        if across < COINCIDENT:
            raise InputError(f"arch: {show(a)} and {show(b)} mm stand over each other; use a line")
        if not 0.0 <= stem < rise:
            raise InputError(
                f"arch: lift {rise:g} mm must be above straight {stem:g} mm, 0 or more"
            )
        top = max(a[2], b[2]) + rise
        rises = top - a[2] - stem, top - b[2] - stem
        alongs = [min(0.5 * across, _ARCH_REACH * up) for up in rises]
        corners = Blend(rises[0], alongs[0]), Blend(alongs[1], rises[1])
        points = [a, (a[0], a[1], top), (b[0], b[1], top), b]
        return cls.polyline(points, blends=corners)

    def then(self, other: Path, tolerance: float | Blend = 0.0) -> Path:
        """Append a path that starts where this one ends; ``tolerance`` is that of the new corner.

        Raises:
            InputError: The ends are apart, or the caps or the timing of the whole paths differ.
        """
        if not isinstance(other, Path):
            raise InputError(f"a path goes on with a Path, got {other!r:.80}")
        for name in ("tool_speed", "tool_acceleration", "timing"):
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                raise InputError(f"cannot join paths with {name} {mine} and {its}")
        gap = distance(self.end, other.start)
        if gap >= COINCIDENT:
            raise InputError(
                f"the next path starts at {show(other.start)} mm, {gap:.6g} mm from the end"
                f" {show(self.end)} mm; put a line between them"
            )
        shift = len(self.segments)
        return replace(
            self,
            segments=self.segments + other.segments,
            corners=(*self.corners, tolerance, *other.corners),
            actions=self.actions + tuple((shift + i, action) for i, action in other.actions),
        )

    def at(self, waypoint: int, *actions: Action) -> Path:
        """Return this path with ``actions`` at a waypoint; -1 is the last, -2 the one before."""
        count = len(self.segments)
        if not isinstance(waypoint, int):
            raise InputError(f"waypoint = {waypoint!r:.80}: must be a whole number")
        index = waypoint + count + 1 if waypoint < 0 else waypoint
        return replace(self, actions=self.actions + tuple((index, action) for action in actions))

    def capped(self, speed: float | None = None, acceleration: float | None = None) -> Path:
        """Return this path with caps on the tool's speed [mm/s] and acceleration [mm/s^2]."""
        return replace(self, tool_speed=speed, tool_acceleration=acceleration)

    def reversed(self) -> Path:
        """Return the way back: the same points, corners and caps; actions stay at their points."""
        count = len(self.segments)
        return replace(
            self,
            segments=tuple(reverse_segment(segment) for segment in self.segments[::-1]),
            corners=tuple(turn_corner(corner) for corner in self.corners[::-1]),
            actions=tuple((count - i, action) for i, action in self.actions),
        )

    @property
    def start(self) -> Point:
        """Where it begins [mm]."""
        return self.segments[0].start

    @property
    def end(self) -> Point:
        """Where it ends [mm]."""
        return self.segments[-1].end

    @property
    def waypoints(self) -> tuple[Point, ...]:
        """The ends of the segments [mm]."""
        return self.start, *(segment.end for segment in self.segments)

    @property
    def halts(self) -> frozenset[int]:
        """The waypoints with an action that needs the machine at rest, by index."""
        return frozenset(i for i, action in self.actions if needs_rest(action))

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, from which ``from_dict`` builds this very path."""
        corners = [c.to_dict() if isinstance(c, Blend) else c for c in self.corners]
        return {
            "segments": [describe_segment(segment) for segment in self.segments],
            "corners": corners,
            "actions": [[i, action.to_dict()] for i, action in self.actions],
            "tool_speed": self.tool_speed,
            "tool_acceleration": self.tool_acceleration,
            **({} if self.timing is None else {"timing": self.timing.value}),
        }

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Path:
        """Build a path from what ``to_dict`` gave.

        Raises:
            InputError: A key is missing, or the values make no path.
        """
        try:
            corners = [Blend(**c) if isinstance(c, Mapping) else c for c in table["corners"]]
            return cls(
                segments=tuple(read_segment(segment) for segment in table["segments"]),
                corners=tuple(corners),
                actions=tuple((int(i), read_action(a)) for i, a in table["actions"]),
                tool_speed=table["tool_speed"],
                tool_acceleration=table["tool_acceleration"],
                timing=table.get("timing"),
            )
        except (KeyError, IndexError, TypeError, AttributeError) as error:
            raise InputError(f"not a path: {error!r}") from error

    def plot(self) -> Figure:
        """Draw the path with its corners rounded, from the side, along the rails and from above.

        Returns:
            A matplotlib figure; a notebook shows it, ``savefig`` writes it.

        Raises:
            PathError: Explicit blends do not fit.
        """
        from duoglide.motion.curve.picture import plot_curve

        return plot_curve(self._rounded().curve, *self._marks())

    def _repr_html_(self) -> str:
        from duoglide.drawing.notebook import notebook_html
        from duoglide.motion.curve.picture import plot_curve

        try:
            curve = self._rounded().curve
            length = f"{float(curve.length):.1f} mm, corners rounded"
            figure = plot_curve(curve, *self._marks(), (5.0, 2.6))
        except PathError as error:  # explicit blends that do not fit: still a value to look at
            length, figure = str(error), None
        rows = [
            ("from", f"{show(self.start)} mm"),
            ("to", f"{show(self.end)} mm"),
            ("length", length),
            ("segments", f"{len(self.segments)}"),
            ("corners", _describe_corners(self.corners)),
            ("actions", f"{len(self.actions)}"),
            ("tool speed", _cap_in_words(self.tool_speed, "mm/s")),
            ("tool acceleration", _cap_in_words(self.tool_acceleration, "mm/s²")),
            ("timing", "as the machine has it" if self.timing is None else self.timing.value),
        ]
        return notebook_html("Path", [rows], figure)

    def _rounded(self) -> RoundedCurve:
        return round_course(lay_course(self.segments, self.corners, self.halts))

    def _marks(self) -> tuple[FloatArray, FloatArray]:
        """Return the waypoints, and those with actions [mm], shapes (n, 3) and (m, 3)."""
        points = np.array(self.waypoints)
        return points, points[[i for i, _ in self.actions]]

    def __repr__(self) -> str:
        count = len(self.segments)
        return f"Path({show(self.start)} to {show(self.end)} mm, {count} segment{'s'[: count > 1]})"


def as_timing(value: object) -> Timing:
    """Return the method that a word names.

    Raises:
        InputError: None has this name.
    """
    if not isinstance(value, str) or value not in list(Timing):
        words = ", ".join(f'"{timing.value}"' for timing in Timing)
        raise InputError(f"timing = {value!r:.80}: must be one of {words}")
    return Timing(value)


def _describe_corners(corners: Sequence[Corner]) -> str:
    blends = sum(isinstance(corner, Blend) for corner in corners)
    tolerances = [corner for corner in corners if not isinstance(corner, Blend)]
    rounded = [value for value in tolerances if value > 0.0]
    words = [f"{blends} explicit"] if blends else []
    if rounded:
        low, high = min(rounded), max(rounded)
        span = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        words.append(f"{len(rounded)} within {span} mm")
    if exact := len(tolerances) - len(rounded):
        words.append(f"{exact} exact")
    return ", ".join(words) or "none"


def _cap_in_words(value: float | None, unit: str) -> str:
    return f"at most {value:g} {unit}" if value is not None else "not capped"
