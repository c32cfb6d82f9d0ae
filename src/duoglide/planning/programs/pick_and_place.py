"""Pick-and-place moves: up, across, down; one of them, or many in a row."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

from numpy.typing import ArrayLike

from duoglide.arrays import as_number
from duoglide.errors import InputError
from duoglide.motion.path.actions import Action, Dwell
from duoglide.motion.path.path import Path
from duoglide.motion.path.segments import COINCIDENT, Point, as_point, distance, show
from duoglide.motion.rounding.blend import Blend

_Item = TypeVar("_Item")


def pick_and_place(
    pick: ArrayLike,
    place: ArrayLike,
    lift: float = 25.0,
    tolerance: float | Blend = 2.0,
    *,
    depart: float = 0.0,
    approach: float = 0.0,
    dwell: float = 0.0,
    at_pick: Sequence[Action] = (),
    at_place: Sequence[Action] = (),
) -> Path:
    """Build the path from ``pick`` up, across and down to ``place``.

    Args:
        pick: Where it starts [mm].
        place: Where it ends [mm].
        lift: How far the way across is above the higher end [mm], 0 or above.
        tolerance: Corner tolerance of both corners [mm]; or a blend, whose ``before`` is then the
            cut-back on the vertical side of both corners.
        depart: Height above ``pick`` below which it stays vertical, whatever the tolerance [mm].
        approach: The same above ``place``.
        dwell: How long to stand still at both ends, after the actions there [s].
        at_pick: Actions at the start.
        at_place: Actions at the end.

    Raises:
        InputError: Not points, a value out of range, or pick and place are one point and lift is 0.
    """
    a, b = as_point(pick, "pick"), as_point(place, "place")
    rise = as_number(lift, "lift [mm]")
    if rise < 0.0:
        raise InputError(f"lift = {rise:g} mm: must be 0 or above")
    top = max(a[2], b[2]) + rise
    turned = tolerance.turned() if isinstance(tolerance, Blend) else tolerance
    up, over = (a[0], a[1], top), (b[0], b[1], top)
    stations: list[tuple[Point, float | Blend]] = [
        (_raise_point(a, depart, top, "depart"), 0.0),
        (up, tolerance),
        (over, turned),
        (_raise_point(b, approach, top, "approach"), 0.0),
        (b, 0.0),
    ]
    points: list[Point] = [a]
    corners: list[float | Blend] = [0.0]
    for point, corner in stations:
        if distance(points[-1], point) >= COINCIDENT:
            points.append(point)
            corners.append(corner)
    if len(points) == 1:
        raise InputError(f"pick and place are the same point {show(a)} mm, and lift is 0")
    path = Path.polyline(points, blends=corners[1:-1])
    pause = (Dwell(dwell),) if as_number(dwell, "dwell [s]") != 0.0 else ()
    first = _iterate(at_pick, "at_pick", "actions")
    last = _iterate(at_place, "at_place", "actions")
    return path.at(0, *first, *pause).at(-1, *last, *pause)


def picks(
    stations: Iterable[ArrayLike],
    lift: float = 25.0,
    tolerance: float | Blend = 2.0,
    *,
    depart: float = 0.0,
    approach: float = 0.0,
    dwell: float = 0.0,
    actions: Sequence[Sequence[Action]] = (),
) -> Iterator[Path]:
    """Yield the moves from station to station, each up, across and down, one at a time.

    Every station is a rest. The stations may be a generator, as long as wished.

    Args:
        stations: Pick, place, pick, place, ... [mm].
        lift: See ``pick_and_place``.
        tolerance: See ``pick_and_place``.
        depart: See ``pick_and_place``.
        approach: See ``pick_and_place``.
        dwell: How long to stand still on arrival at each station [s].
        actions: What to do on arrival, in turn: with two entries, the first at each place and the
            second at each next pick.

    Raises:
        InputError: See ``pick_and_place``; names the station.
    """
    turns = tuple(_iterate(actions, "actions", "lists of actions"))
    for i, (one, other) in enumerate(pairwise(_iterate(stations, "stations", "points"))):
        arrival = turns[i % len(turns)] if turns else ()
        pause = (Dwell(dwell),) if as_number(dwell, "dwell [s]") != 0.0 else ()
        try:
            move = pick_and_place(
                one, other, lift, tolerance, depart=depart, approach=approach, at_place=arrival
            )
        except InputError as error:
            raise InputError(f"from station {i} to station {i + 1}: {error}") from error
        yield move.at(-1, *pause)


def chain(paths: Iterable[Path]) -> Path:
    """Join paths, each of which starts where the one before ends, with a rest between them.

    Raises:
        InputError: There are none, or two do not meet, or their caps differ.
    """
    parts = list(_iterate(paths, "paths", "Paths"))
    if not parts:
        raise InputError("no paths to chain")
    first = parts[0]
    for i, part in enumerate(parts):
        if not isinstance(part, Path):
            raise InputError(f"part {i} of the chain must be a Path, got {part!r:.80}")
    for one, other in pairwise(parts):
        one.then(other)  # refuses two that do not fit
    shifts = [0]
    for part in parts:
        shifts.append(shifts[-1] + len(part.segments))
    corners = [corner for part in parts for corner in (*part.corners, 0.0)]
    return replace(
        first,
        segments=tuple(segment for part in parts for segment in part.segments),
        corners=tuple(corners[:-1]),
        actions=tuple(
            (shift + i, action)
            for shift, part in zip(shifts, parts, strict=False)
            for i, action in part.actions
        ),
    )


def _iterate(items: Iterable[_Item], name: str, of: str) -> Iterator[_Item]:
    """Go through items one at a time, or refuse what is not many."""
    try:
        return iter(items)
    except TypeError as error:
        raise InputError(f"{name} must be a list of {of}, got {items!r:.80}") from error


def _raise_point(point: Point, height: float, top: float, name: str) -> Point:
    """Return the point ``height`` above ``point``, or refuse one above the way across."""
    value = as_number(height, f"{name} [mm]")
    if not 0.0 <= value <= top - point[2]:
        raise InputError(
            f"{name} = {value:g} mm: must be from 0 to {top - point[2]:g} mm, the height of the"
            f" way across over {show(point)} mm"
        )
    return point[0], point[1], point[2] + value
