"""Plan a long program piece by piece: one trajectory after the other, in bounded memory.

The motion does not stop between two paths that join smoothly, or whose corner may be rounded. As
planners of machine tools do, this one looks ahead: it plans a window of the program, from where the
motion has got to and how fast it is there, to a rest at the end of the window. Of that only the
part up to a seam in the next path is kept; the next window begins there, in the state in which this
part ends, and reaches further. So there is a certified way to rest at all times: ``whole`` of the
trajectory that runs, of which it is the first part. When nothing comes after it, run on with that.

Joints are rests where the program says so (a dwell, a wait), where the path turns back, and where
a corner has no tolerance; there a window ends, and the next trajectory begins at rest.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from duoglide.arrays import as_number
from duoglide.errors import DuoglideError, InputError, LimitError, PathError
from duoglide.machine import Machine, Timing
from duoglide.motion.path.actions import SetPayload
from duoglide.motion.path.path import Path, as_timing
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.path.segments import distance
from duoglide.planning.programs.joints import Entry, find_entries
from duoglide.planning.programs.windows import (
    Seam,
    cut_at,
    cut_before_joint,
    place_of_seam,
    plan_window,
    take_rest,
)
from duoglide.planning.timing.lead import Lead
from duoglide.planning.tolerances import NANOMETRE
from duoglide.planning.trajectory import Trajectory

Count = Callable[[int, float], None]
"""Told after each path how many are planned, and how long they take together [s]."""

_MOST_PATHS = 64  # in one window
_FARTHER = 1.5  # the platform goes than its carriages


def plan_program(
    machine: Machine,
    paths: Iterable[Path],
    brake_safe: bool = True,
    progress: Count | None = None,
    *,
    tolerance: float = 0.0,
    timing: Timing | str | None = None,
) -> Iterator[Trajectory]:
    """Plan one path after the other, each trajectory from the state in which the last one ends.

    A trajectory that does not end at rest has a ``whole``: the certified way on to rest, of which
    it is the first part. Nothing is planned long before it is asked for, and nothing is kept but
    the look-ahead: the paths may be a generator, as long as wished.

    Args:
        machine: The machine that is to move.
        paths: What it is to do, such as ``picks`` yields.
        brake_safe: See ``plan``.
        progress: Told after each path.
        tolerance: Corner tolerance between one path and the next [mm]; 0: rest in that corner,
            unless the paths join smoothly.
        timing: See ``plan``. Parts that begin in motion under a jerk limit are timed near-optimal
            where toppra is asked for, as toppra's motion has none of its own.

    Raises:
        InputError: The tolerance is not a number from 0, there is no such timing, or a path changes
            its payload.
        PathError: Names the path, and where, what and by how much; or that it does not start where
            the one before ends. What comes before that path is yielded first, to a rest.
    """
    if as_number(tolerance, "tolerance [mm]") < 0.0:
        raise InputError(f"tolerance = {tolerance:g} mm: must be 0 or above")
    total = 0.0
    method = None if timing is None else as_timing(timing)
    paths = (_without_payload(path) for path in paths)
    program = _Program(machine, brake_safe, find_entries(machine, paths, tolerance), method)
    for done, trajectory in program.run():
        total += trajectory.duration
        if progress is not None:
            progress(done, total)
        yield trajectory


def _without_payload(path: Path) -> Path:
    """Refuse a change of the payload, which the parts of a program could not hand on."""
    if isinstance(path, Path) and any(isinstance(a, SetPayload) for _, a in path.actions):
        raise InputError(
            "a program that is planned part by part takes machine.masses.payload all along: plan a"
            " path with SetPayload by itself (dg.plan)"
        )
    return path


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """What is planned next.

    Attributes:
        path: From where the motion has got to, to a rest.
        count: How many paths that takes up.
        seam: Sigma where the next window takes over [mm]; None: nowhere, all of it is run.
        rest: What is left of the last of these paths; None: nothing.
    """

    path: Path
    count: int
    seam: float | None = None
    rest: Path | None = None


@dataclass(slots=True, eq=False)
class _Program:
    """A program being planned.

    Attributes:
        machine: The machine.
        brake_safe: See ``plan``.
        source: Of the paths.
        timing: See ``plan``.
        queue: Paths that the motion has not passed, the first one perhaps in part.
        path: What is left of the first one; None: all of it.
        lead: How the motion begins there; None: at rest.
        held: What comes next if it can be gone on from; how many paths its ``whole`` takes up, and
            what that leaves of the last one.
        failure: Why no more paths come.
        done: Number of the last path that the motion has passed.
    """

    machine: Machine
    brake_safe: bool
    source: Iterator[Entry]
    timing: Timing | None = None
    queue: deque[Entry] = field(default_factory=deque)
    path: Path | None = None
    lead: Lead | None = None
    held: tuple[Trajectory, int, Path | None] | None = None
    failure: DuoglideError | None = None
    done: int = 0

    def run(self) -> Iterator[tuple[int, Trajectory]]:
        """Yield each trajectory, with how many paths are done at its end."""
        most = _MOST_PATHS
        while self._reaches(1):
            window = self._choose_window(most)
            try:
                trajectory = self._plan_window(window)
            except (PathError, LimitError) as error:
                if isinstance(error, PathError) and window.count > 1:
                    most = window.count - 1  # all may be well before the path that is refused
                elif self.held is None:
                    raise _number_error(self.queue[0].number, error) from error
                else:
                    part, count, rest = self.held
                    self._advance(count, rest)
                    yield self.done, part.whole or part
                continue
            most = _MOST_PATHS
            if self.held is not None:
                yield self.done, self.held[0]
            seam = None if window.seam is None else cut_at(trajectory, window.seam)
            if seam is None:
                self._advance(window.count, window.rest)
                yield self.done, trajectory
            else:
                self._enter(seam, window)
        if self.failure is not None:
            raise self.failure

    def _reaches(self, count: int) -> bool:
        """Whether the queue has so many paths; fetches them if there are."""
        while len(self.queue) < count and self.failure is None:
            try:
                entry = next(self.source, None)
            except DuoglideError as error:
                self.failure = error
                break
            if entry is None:
                break
            self.queue.append(entry)
        return len(self.queue) >= count

    def _choose_window(self, most: int) -> _Window:
        """Choose how far to look ahead: as far as what is done first may depend on it."""
        path = self.path or self.queue[0].path
        first, ahead = len(path.segments), _estimate_stopping_distance(self.machine)
        enough = max(_measure_chords(path), ahead) + ahead
        count = 1
        while count < most and (corner := self.queue[count - 1].corner) is not None:
            if not self._reaches(count + 1):
                break
            path, count = path.then(self.queue[count].path, corner), count + 1
            if _measure_chords(path) < enough - NANOMETRE:
                continue
            until, rest = cut_before_joint(path, self.queue[count - 1].corner)
            rounded = round_corners(until)
            seam = place_of_seam(rounded, until, max(float(rounded.waypoints[first]), ahead))
            if seam is not None and seam + ahead <= rounded.curve.end + NANOMETRE:
                return _Window(until, count, seam, rest)
        return _Window(path, count)

    def _plan_window(self, window: _Window) -> Trajectory:
        lead = self.lead
        if window.seam is not None:
            lead = replace(lead or Lead(), ahead=window.seam)
        return plan_window(self.machine, window.path, lead, self.brake_safe, self.timing)

    def _advance(self, count: int, rest: Path | None) -> None:
        """Go to the rest at the end of so many paths, or where a part of the last one is left."""
        for _ in range(count - (rest is not None)):
            self.done = self.queue.popleft().number
        self.path, self.lead, self.held = rest, None, None

    def _enter(self, seam: Seam, window: _Window) -> None:
        """Go on to a seam in one of the paths of a window."""
        count = window.count
        segment, ahead = seam.segment, len((self.path or self.queue[0].path).segments)
        while segment >= ahead:
            segment, count = segment - ahead, count - 1
            self.done = self.queue.popleft().number
            ahead = len(self.queue[0].path.segments)
        self.path = take_rest(self.queue[0].path, segment, seam.place)
        self.lead, self.held = seam.lead, (seam.part, count, window.rest)


def _measure_chords(path: Path) -> float:
    """Return about how long a path is [mm]."""
    return sum(distance(one, other) for one, other in pairwise(path.waypoints))


def _estimate_stopping_distance(machine: Machine) -> float:
    """Return how far the platform goes while it stops from the largest velocity, about [mm]."""
    limits = machine.limits
    v, a, j = limits.velocity, limits.acceleration, limits.jerk
    way = np.where(v * j > a * a, 0.5 * v * (v / a + a / j), v * np.sqrt(v / j))
    return _FARTHER * float(way.max())


def _number_error(number: int, error: PathError | LimitError) -> DuoglideError:
    """Return the error with the path's number in front."""
    if not isinstance(error, PathError):
        return LimitError(f"path {number}: {error}")
    return PathError(
        f"path {number}: {error}",
        arc_length=error.arc_length,
        position=error.position,
        quantity=error.quantity,
        amount=error.amount,
    )
