"""A stop on the path that one drive leads: it brakes by itself, and the others keep to its place.

A drive in its fault reaction, or in a quick stop of its own, brakes whatever setpoints say. Path
time is then read off its feedback (``braking_drive``), and the other two get setpoints at the path
time at which it will be where it will be. ``LedStops`` says where the plan allows that. Where it
does not, or as soon as the drive is not where one that brakes would be, all brake by themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from duoglide.motion.led_stops import LEAST_STEP, catch_up

if TYPE_CHECKING:
    from duoglide.control.channel.setpoints import PreparedSetpoints
    from duoglide.control.streamer.braking_drive import BrakingDrive
    from duoglide.motion.led_stops import LedStops

_AHEAD = 2  # cycles from this SYNC to the one at which its setpoint is reached; feedback is older
_AHEAD_OF = np.arange(40)  # cycles of path time within which a drive that brakes comes to rest
_NEWTON = 6
_CLOSE = 1e-3  # [mm]
_ELSEWHERE = 2.0  # cycles of path time ahead, from which on a drive that brakes cannot be there


class Course(NamedTuple):
    """What is followed, and how far.

    Attributes:
        prepared: Its setpoints.
        path_times: Of the two newest ones, the older one first [s].
    """

    prepared: PreparedSetpoints
    path_times: tuple[float, float]


class LedStop:
    """Path time by the place of a drive that brakes; ``step`` once a cycle, after ``see``.

    Args:
        course: What is followed, and how far.
        stops: What its plan allows.
        index: Of the drive.
        drive: What is known of it.
        confirmed: Whether its state says that it brakes.
        departed: Whether it brakes although its state says that it is enabled.

    Attributes:
        index: As given.
        drive: As given; it may be replaced by ``confirm``.
        confirmed: As given.
        departed: As given.
        over: Whether all stand.
    """

    def __init__(
        self,
        course: Course,
        stops: LedStops,
        index: int,
        drive: BrakingDrive,
        confirmed: bool,
        *,
        departed: bool = False,
    ) -> None:
        self._prepared, self._stops, self.index = course.prepared, stops, index
        self._before, self._newest = course.path_times
        self._goal, self._pace = self._newest, 0.0  # of the drive: path time and change in a cycle
        self._quickest = 0.0
        self.drive, self.confirmed, self.departed = drive, confirmed, departed
        self.over = False

    def confirm(self, drive: BrakingDrive) -> None:
        """Take it from its state that it brakes, and since when."""
        self.drive, self.confirmed = drive, True

    def find(self) -> bool:
        """Find the path time at which the drive will be in its place; whether it can be followed.

        One that had left its setpoints before it was known to brake may come to no place of the
        path: it goes on where its plan turns it round, or stands where the others have passed. They
        then go as near as they can.
        """
        place, velocity = self.drive.after(_AHEAD + self.confirmed)
        u = self._path_time_of(place)
        cycle, i = self._prepared.cycle, self.index
        if self.departed and (u is None or u > self._newest + _ELSEWHERE * cycle):
            u, velocity = self._nearest_ahead(place), 0.0
        if u is None:
            return False
        speeds = self._prepared.trajectory.at(u).velocity * cycle
        speed = float(speeds[i])
        forward = velocity / speed if velocity and abs(speed) >= LEAST_STEP else 0.0
        self._goal, self._pace = u, min(max(forward, 0.0), 1.0) * cycle
        self._quickest = cycle**3 * min(
            limit / max(abs(float(speeds[j])), 1e-9)
            for j, limit in enumerate(self._stops.limits)
            if j != i
        )
        return True

    def _path_time_of(self, place: float) -> float | None:
        """Return the path time at which the drive's carriage is in a place; None for none near."""
        trajectory, u = self._prepared.trajectory, self._goal + self._pace
        for _ in range(_NEWTON):
            state = trajectory.at(u)
            speed = float(state.velocity[self.index])
            off = place - float(state.carriages[self.index])
            if abs(off) <= _CLOSE:
                return u
            if abs(speed) * self._prepared.cycle < LEAST_STEP:
                return None
            u = min(max(u + off / speed, 0.0), trajectory.duration)
        return None

    def _nearest_ahead(self, place: float) -> float:
        """Return the path time ahead at which the drive's carriage first is nearest to a place."""
        trajectory = self._prepared.trajectory
        times = np.minimum(self._newest + self._prepared.cycle * _AHEAD_OF, trajectory.duration)
        away = np.abs(trajectory.at(times).carriages[:, self.index] - place)
        grows = np.flatnonzero(np.diff(away) >= 0.0)
        return float(times[grows[0]] if len(grows) else times[-1])

    def step(self) -> tuple[float, float]:
        """Return the path time of the next setpoint [s], and its rate.

        The others catch up with the drive as fast as ``limit`` lets them, and never go back.
        """
        cycle, most = self._prepared.cycle, self._quickest
        step = catch_up(self._goal - self._newest, self._newest - self._before, self._pace, most)
        way = min(step, cycle)
        self._before, self._newest = self._newest, self._newest + way
        self.over = self.drive.stands and way == 0.0
        return self._newest, way / cycle
