"""When a drive leads a stop on the path: what of it is believed, and when it is given up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from duoglide.control.channel.orders import Power
from duoglide.control.streamer.braking_drive import BrakingDrive, Trailing
from duoglide.control.streamer.led_stop import Course, LedStop
from duoglide.drives.cia402 import State

if TYPE_CHECKING:
    from duoglide.control.channel.scale import IntTriple
    from duoglide.control.streamer.follower import Follower
    from duoglide.control.streamer.tracks import AxisView
    from duoglide.control.streamer.trail import AxisTrail

_BRAKING = (State.FAULT_REACTION_ACTIVE, State.QUICK_STOP_ACTIVE)
_DUE = -3  # of the setpoints that were sent: which was due at the SYNC that was answered
_MOST_MISSING = 1  # feedback in a row that is predicted instead


class Lead:
    """Whether a drive leads a stop, and which.

    Attributes:
        axis: 1 to 3; 0 for none.
        lost: Axis of a drive that led, and cannot be followed any more; 0 for none.
    """

    def __init__(self) -> None:
        self.axis = self.lost = 0
        self._departed = False  # it brakes although its state says that it is enabled

    def look(
        self,
        follower: Follower,
        views: Sequence[AxisView],
        trails: Sequence[AxisTrail],
        sent: Sequence[IntTriple],
        skipped: int,
    ) -> None:
        """Begin, go on with, or give up a stop that a drive leads.

        Args:
            follower: What moves.
            views: What this cycle saw of the drives.
            trails: How their carriages trail.
            sent: Setpoints; the last one is reached one cycle after this one's SYNC.
            skipped: Cycles that were left out before this one.
        """
        self.lost = 0
        if follower.led is not None:
            if skipped or not self._goes_on(follower, follower.led, views, trails, sent):
                self.lost, self.axis = self.axis, 0
            return
        self.axis, self._departed = 0, False
        stops = follower.led_stops
        if stops is None or skipped:
            return
        stopping = [i for i, view in enumerate(views) if _may_brake(view)]
        if len(stopping) != 1 or not _others_follow(views, stopping[0]):
            return
        index = stopping[0]
        view, trail = views[index], trails[index]
        if view.away or view.is_deaf:
            drive = _recognise(follower, index, trail)
            departed = confirmed = True
        else:
            drive, departed, confirmed = None, False, view.state in _BRAKING
            begun = follower.path_time - (2 + confirmed) * follower.rate * follower.prepared.cycle
            if stops.allow(index, begun):
                drive = _begin(follower, index, trail, sent, confirmed)
        if drive is None or (confirmed and not _sees(follower, index, view, drive)):
            return
        course = Course(follower.prepared, follower.path_times)
        stop = LedStop(course, stops, index, drive, confirmed, departed=departed)
        if stop.find():
            follower.led, self.axis, self._departed = stop, index + 1, departed

    def _goes_on_unheard(
        self, follower: Follower, stop: LedStop, view: AxisView, trail: AxisTrail
    ) -> bool:
        """Weigh in a cycle of a drive that has left its setpoints, or recognise it once more."""
        if not _sees(follower, stop.index, view, stop.drive):
            drive = _recognise(follower, stop.index, trail)
            if drive is None:
                return False
            stop.drive = drive
        return stop.find()

    def power_of(self, axis: int, power: Power, state: State | None) -> Power:
        """Return what is wanted of a drive's power: one that leads is not brought back up.

        One that has not said that it brakes is told to, so that it goes on with it should it hear
        again.
        """
        leads = axis == self.axis and (self._departed or state is not State.OPERATION_ENABLED)
        return Power.QUICK_STOP if leads else power

    def _goes_on(
        self,
        follower: Follower,
        stop: LedStop,
        views: Sequence[AxisView],
        trails: Sequence[AxisTrail],
        sent: Sequence[IntTriple],
    ) -> bool:
        """Let a cycle pass; whether the drive still is where one that brakes would be."""
        index = stop.index
        view = views[index]
        if not _others_follow(views, index) or view.missing > _MOST_MISSING or view.booted:
            return False
        braking = view.state in _BRAKING
        if braking and not stop.confirmed:
            stop.confirm(_begin(follower, index, trails[index], sent, confirmed=True))
            return _sees(follower, index, view, stop.drive) and stop.find()
        stop.drive.pass_cycle()
        if stop.departed and (braking or view.state is State.OPERATION_ENABLED):
            return self._goes_on_unheard(follower, stop, view, trails[index])
        if view.state is State.OPERATION_ENABLED:  # the message was a warning, or comes early
            return not stop.confirmed and stop.find()
        if not braking:
            if not stop.drive.is_slow:  # it has no torque to brake with
                return False
            stop.drive.rest()
            stop.confirmed = True
        return _sees(follower, index, view, stop.drive) and stop.find()


def _may_brake(view: AxisView) -> bool:
    """Whether a drive says that it brakes by itself, or shows it."""
    return bool(view.emergency) or view.state in _BRAKING or view.away


def _others_follow(views: Sequence[AxisView], index: int) -> bool:
    """Whether the drives but one follow their setpoints, and say nothing else."""
    return not any(
        view.emergency or view.state is not State.OPERATION_ENABLED
        for other, view in enumerate(views)
        if other != index
    )


def _begin(
    follower: Follower, index: int, trail: AxisTrail, sent: Sequence[IntTriple], confirmed: bool
) -> BrakingDrive:
    """Return a drive that has begun to brake in the cycle before, or one cycle earlier."""
    prepared = follower.prepared
    end = _DUE if confirmed else _DUE + 1
    scale = prepared.fence.scales.axes[index]
    here, before = scale.to_mm(sent[end][index]), scale.to_mm(sent[end - 1][index])
    stops = prepared.led
    assert stops is not None
    deceleration = stops.decelerations[index] * prepared.cycle**2
    return BrakingDrive(here, here - before, deceleration, Trailing(trail.lag, trail.bend))


def _recognise(follower: Follower, index: int, trail: AxisTrail) -> BrakingDrive | None:
    """Return the drive that hears no setpoints any more, and brakes; None where it does not."""
    prepared, stops = follower.prepared, follower.prepared.led
    assert stops is not None
    scale = prepared.fence.scales.axes[index]
    due = [scale.to_mm(step.due) for step in trail.steps]
    places = [scale.to_mm(step.actual) for step in trail.steps]
    deceleration = stops.decelerations[index] * prepared.cycle**2
    return BrakingDrive.recognise(due, places, deceleration, Trailing(trail.lag, trail.bend))


def _sees(follower: Follower, index: int, view: AxisView, drive: BrakingDrive) -> bool:
    """Weigh in the newest feedback, if there is some; whether it is credible."""
    if view.missing:
        return True
    return drive.see(follower.prepared.fence.scales.axes[index].to_mm(view.actual))
