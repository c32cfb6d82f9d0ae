"""Puts a path together move by move, as the programs do."""

from __future__ import annotations

from dataclasses import dataclass, field

from duoglide.errors import InputError
from duoglide.motion.path.actions import Action
from duoglide.motion.path.path import Path
from duoglide.motion.path.segments import COINCIDENT, Point, Segment, distance, show
from duoglide.motion.rounding.blend import Corner


@dataclass(slots=True)
class PathBuilder:
    """A path in the making.

    Attributes:
        corner: What the next corner is to be: that at which the latest segment ends.
        place: Where the path has got to [mm]; None before it has begun.
    """

    corner: Corner = 0.0
    place: Point | None = None
    segments: list[Segment] = field(default_factory=list)
    corners: list[Corner] = field(default_factory=list)
    actions: list[tuple[int, Action]] = field(default_factory=list)

    def add(self, segment: Segment, corner: Corner) -> None:
        """Append a segment; ``corner`` is the one at which it ends.

        Raises:
            InputError: It does not start where the path has got to.
        """
        if self.place is not None and distance(self.place, segment.start) >= COINCIDENT:
            raise InputError(
                f"it starts at {show(segment.start)} mm,"
                f" {distance(self.place, segment.start):.6g} mm from {show(self.place)} mm, where"
                " the move before ends"
            )
        if self.segments:
            self.corners.append(self.corner)
        self.segments.append(segment)
        self.corner, self.place = corner, segment.end

    def extend(self, path: Path) -> None:
        """Append a whole path, and a rest after it.

        Raises:
            InputError: It does not start where this one has got to.
        """
        first = len(self.segments)
        for segment, corner in zip(path.segments, (*path.corners, 0.0), strict=True):
            self.add(segment, corner)
        self.actions += [(first + waypoint, action) for waypoint, action in path.actions]

    def act(self, action: Action) -> None:
        """Do something where the path has got to."""
        self.actions.append((len(self.segments), action))

    def build(self, speed: float | None = None, acceleration: float | None = None) -> Path:
        """Return the path, with caps on the tool's speed [mm/s] and acceleration [mm/s^2].

        Raises:
            InputError: Nothing moves.
        """
        if not self.segments:
            raise InputError("nothing moves in this program")
        return Path(
            tuple(self.segments), tuple(self.corners), tuple(self.actions), speed, acceleration
        )
