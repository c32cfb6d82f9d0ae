"""A stop on the path that one drive leads: it brakes by itself, and the others keep to its place.

A drive in its fault reaction, or in a quick stop of its own, brakes whatever setpoints say. Path
time is then read off its feedback (``braking_drive``), and the other two get setpoints at the path
time at which it will be where it will be. ``LedStops`` says where the plan allows that. Where it
does not, or as soon as the drive is not where one that brakes would be, all brake by themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from duoglide.motion.led_stops import LEAST_STEP, catch_up

if TYPE_CHECKING:
    from duoglide.control.channel.setpoints import PreparedSetpoints
    from duoglide.control.streamer.braking_drive import BrakingDrive
    from duoglide.motion.led_stops import LedStops

_AHEAD = 2  # cycles from this SYNC to the one at which its setpoint is reached; feedback is older
_NEWTON = 6
_CLOSE = 1e-3  # [mm]


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

    Attributes:
        index: As given.
        drive: As given; it may be replaced by ``confirm``.
        confirmed: As given.
        over: Whether all stand.
    """

    def __init__(
        self, course: Course, stops: LedStops, index: int, drive: BrakingDrive, confirmed: bool
    ) -> None:
        self._prepared, self._stops, self.index = course.prepared, stops, index
        self._before, self._newest = course.path_times
        self._goal, self._pace = self._newest, 0.0  # of the drive: path time and change in a cycle
        self._quickest = 0.0
        self.drive, self.confirmed = drive, confirmed
        self.over = False

    def confirm(self, drive: BrakingDrive) -> None:
        """Take it from its state that it brakes, and since when."""
        self.drive, self.confirmed = drive, True

    def find(self) -> bool:
        """Find the path time at which the drive will be in its place; whether there is one."""
        prepared, i = self._prepared, self.index
        place, velocity = self.drive.after(_AHEAD + self.confirmed)
        cycle, u = prepared.cycle, self._goal + self._pace
        for _ in range(_NEWTON):
            state = prepared.trajectory.at(u)
            speed = float(state.velocity[i]) * cycle
            off = place - float(state.carriages[i])
            if abs(off) <= _CLOSE:
                break
            if abs(speed) < LEAST_STEP:
                return False
            u = min(max(u + off / speed * cycle, 0.0), prepared.trajectory.duration)
        else:
            return False
        self._goal = u
        self._pace = min(max(velocity / speed, 0.0), 1.0) * cycle if velocity else 0.0
        self._quickest = cycle**3 * min(
            limit / max(abs(float(state.velocity[j])) * cycle, 1e-9)
            for j, limit in enumerate(self._stops.limits)
            if j != i
        )
        return True

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
