"""One long path as a program: parts that are planned one after the other, while the first ones run.

A path is divided where the motion rests anyway, and in corners that a program may round by itself:
those with the tolerance that most corners have.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from duoglide.errors import InputError
from duoglide.motion.path.path import Path
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.path.segments import COINCIDENT, distance, show
from duoglide.motion.rounding.blend import Blend

_LEAST = 30.0  # mm between the ends of a part, at the least: shorter ones are not worth a plan


class Program(NamedTuple):
    """What ``plan_program`` takes.

    Attributes:
        paths: Each from where the one before ends.
        tolerance: Of the corners between them [mm].
    """

    paths: Iterator[Path]
    tolerance: float


def divide(path: Path, times: int | None = 1) -> Program:
    """Divide a path into the paths of a program.

    Args:
        path: What is to be done.
        times: How often, one after the other; None: without an end.

    Raises:
        InputError: It is to be repeated, and does not end where it begins.
    """
    gap = distance(path.end, path.start)
    if times != 1 and gap >= COINCIDENT:
        raise InputError(
            f"the program ends at {show(path.end)} mm, {gap:.6g} mm from where it begins: to be"
            " repeated it has to lead back to its start"
        )
    counts = Counter(corner for corner in path.corners if not isinstance(corner, Blend))
    counts.pop(0.0, None)
    ((tolerance, _),) = counts.most_common(1) or ((0.0, 0),)
    places = [0, *_find_places(path, tolerance), len(path.segments)]
    parts = [_cut(path, begin, end) for begin, end in pairwise(places)]
    return Program(_repeat(parts, times), tolerance)


def _repeat(parts: list[Path], times: int | None) -> Iterator[Path]:
    done = 0
    while times is None or done < times:
        yield from parts
        done += 1


def _find_places(path: Path, tolerance: float) -> Iterator[int]:
    """Yield the waypoints at which a path is divided."""
    halts, begin = path.halts, path.start
    for waypoint, corner in enumerate(path.corners, start=1):
        here = path.segments[waypoint - 1].end
        if isinstance(corner, Blend):
            continue
        rests = waypoint in halts or (corner == 0.0 and _rests(path, waypoint, tolerance))
        if rests or (corner == tolerance and distance(begin, here) >= _LEAST):
            yield waypoint
            begin = here


def _rests(path: Path, waypoint: int, tolerance: float) -> bool:
    """Whether the motion rests in a corner, also where that may be rounded."""
    joint = Path(path.segments[waypoint - 1 : waypoint + 1], (tolerance,))
    return round_corners(joint).curve.rests != ()


def _cut(path: Path, begin: int, end: int) -> Path:
    """Return the segments from one waypoint to another; what is done at the first stays before."""
    actions = tuple(
        (i - begin, action)
        for i, action in path.actions
        if begin < i <= end or (i == 0 and begin == 0)
    )
    return replace(
        path,
        segments=path.segments[begin:end],
        corners=path.corners[begin : end - 1],
        actions=actions,
    )
