"""How the paths of a program join: which joints are rests, and every blend beside a moving one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from duoglide.errors import DuoglideError, PathError
from duoglide.machine import Machine
from duoglide.motion.path.actions import needs_rest
from duoglide.motion.path.path import Path
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.path.segments import COINCIDENT, Line, Segment, distance, show
from duoglide.motion.rounding.blend import Blend, Corner
from duoglide.planning.programs.windows import STRAIGHT
from duoglide.planning.rounding.choice import choose_blends
from duoglide.planning.tolerances import NANOMETRE

_MANY = 5.0  # times the room for a seam; a blend that long may lose so much
_FOLLOWING = 2  # segments of the next path that decide how long the blend into it may be


@dataclass(frozen=True, slots=True)
class Entry:
    """One path of a program.

    Attributes:
        number: Its number, from 1.
        path: The path; beside a joint that the motion does not rest at, with explicit blends.
        corner: The corner between it and the next path; None: the motion rests there.
    """

    number: int
    path: Path
    corner: Corner | None


def find_entries(machine: Machine, paths: Iterable[Path], tolerance: float) -> Iterator[Entry]:
    """Yield the paths of a program, each as soon as the one after it is known.

    Raises:
        PathError: A path does not start where the one before ends.
    """
    source = iter(paths)
    current, number = next(source, None), 1
    before: tuple[Segment, Corner] | None = None
    while current is not None:
        following, failure = None, None
        try:
            following = next(source, None)
            if following is not None:
                _require_joined(number, current, following)
        except DuoglideError as error:  # what comes before it is planned all the same
            following, failure = None, error
        passes = following is not None and _passes(current, following, tolerance)
        if passes or before is not None:
            beyond = following if passes else None
            current, joint = _fix_blends(machine, before, current, beyond, tolerance)
        else:
            joint = tolerance
        yield Entry(number, current, joint if passes else None)
        if failure is not None:
            raise failure
        before = (current.segments[-1], joint) if passes else None
        current, number = following, number + 1


def _require_joined(number: int, one: Path, other: Path) -> None:
    gap = distance(one.end, other.start)
    if gap >= COINCIDENT:
        raise PathError(
            f"path {number + 1} starts at {show(other.start)} mm,"
            f" {gap:.6g} mm from where path {number} ends",
            position=other.start,
            quantity="start",
            amount=gap,
        )


def _passes(one: Path, other: Path, tolerance: float) -> bool:
    """Whether the motion need not rest between two paths."""
    last = len(one.segments)
    halts = [action for i, action in one.actions if i == last and needs_rest(action)]
    halts += [action for i, action in other.actions if i == 0 and needs_rest(action)]
    whole = ((path.tool_speed, path.tool_acceleration, path.timing) for path in (one, other))
    if halts or len(set(whole)) > 1:
        return False
    joint = Path((one.segments[-1], other.segments[0]), (tolerance,))
    return round_corners(joint).curve.rests == ()


def _leave_room(last: Segment, joint: Corner, following: Segment) -> Corner:
    """Shorten a blend to the segment before it, and to half of the one after it.

    If that is long, a seam has room too. Lines that go straight on count one by one, as a window
    may end in each of them.
    """
    if not isinstance(joint, Blend):
        return joint
    if isinstance(last, Line):
        joint = replace(joint, before=min(joint.before, distance(last.start, last.end)))
    half = 0.5 * distance(following.start, following.end)
    room = half - STRAIGHT if half > _MANY * STRAIGHT + NANOMETRE else half
    return replace(joint, after=min(joint.after, room))


def _fix_blends(
    machine: Machine,
    before: tuple[Segment, Corner] | None,
    path: Path,
    following: Path | None,
    tolerance: float,
) -> tuple[Path, Corner]:
    """Choose the blends of a path and of the joint after it, in the light of both neighbours.

    Args:
        machine: Whose limits the choice depends on.
        before: Last segment of the path before, and the joint, which is fixed already; None: the
            path begins at a rest.
        path: The path.
        following: The next path; None: the path ends at a rest.
        tolerance: Of the joint [mm].

    Returns:
        The path with explicit blends, and the joint after it.
    """
    first = 0 if before is None else 1
    segments, corners = list(path.segments), list(path.corners)
    if before is not None:
        segments.insert(0, before[0])
        corners.insert(0, before[1])
    if following is not None:
        segments += following.segments[:_FOLLOWING]
        corners += [tolerance, *following.corners[: _FOLLOWING - 1]]
    if not any(isinstance(corner, Blend) or corner > 0.0 for corner in corners):
        return path, tolerance
    actions = tuple((first + i, action) for i, action in path.actions)
    probe = replace(path, segments=tuple(segments), corners=tuple(corners), actions=actions)
    rounded = choose_blends(machine, probe)
    fixed = [rounded.blend(i) or corner for i, corner in enumerate(rounded.path.corners)]
    inner = first + len(path.corners)
    joint: Corner = tolerance
    if following is not None:
        joint = _leave_room(path.segments[-1], fixed[inner], following.segments[0])
    return replace(path, corners=tuple(fixed[first:inner])), joint
