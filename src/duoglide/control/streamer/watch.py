"""The supervisor's memory: what this cycle saw, what has been told, how strong the reaction is."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from duoglide.control.streamer.supervise import (
    Condition,
    Observation,
    Policy,
    Reaction,
    Trip,
    assess,
)

if TYPE_CHECKING:
    from duoglide.control.channel.scale import IntTriple
    from duoglide.control.streamer.tracks import AxisTrack


class Watch:
    """Fills in an observation every cycle and keeps what has tripped.

    Args:
        policy: What is bridged, and for how long.

    Attributes:
        policy: As given; it may be replaced.
        seen: Of this cycle.
        reaction: The strongest that is latched.
    """

    def __init__(self, policy: Policy) -> None:
        self.seen = Observation()
        self.reaction = Reaction.NONE
        self.policy = policy
        self._told: set[tuple[Condition, int, int]] = set()
        self._life = 0

    @property
    def too_late(self) -> bool:
        """Whether so many cycles in a row are late that the run must stop."""
        return self.seen.late >= self.policy.late

    def see_axes(self, tracks: tuple[AxisTrack, ...], due: IntTriple | None) -> None:
        """Note what the drives said.

        Args:
            tracks: Of the drives.
            due: Setpoints that they should have reached; None while they are not enabled.
        """
        for index, (view, track) in enumerate(zip(self.seen.axes, tracks, strict=True)):
            track.fill(view)
            # an old position proves nothing, and after a gap the answer may be to an earlier SYNC
            known = due is not None and track.settled
            view.following = abs(track.actual - due[index]) if due and known else 0
            if track.homing:
                view.statusword = view.following = 0  # bits 12 and 13 mean something else there
        self.seen.enabled = due is not None

    def see_time(self, skipped: int, life: int) -> None:
        """Note how late this cycle is, and whether the host has read since the last one."""
        seen = self.seen
        seen.late = seen.late + skipped if skipped else 0
        seen.host = seen.host + 1 + skipped if life == self._life else 0
        self._life = life

    def see_sending(self, failed: bool) -> None:
        """Note whether this cycle's frames could be sent."""
        self.seen.unsent = self.seen.unsent + 1 if failed else 0

    def news(self) -> Iterator[Trip]:
        """Yield what is met for the first time, and let the reaction grow with it."""
        for trip in assess(self.seen, self.policy):
            self.reaction = max(self.reaction, trip.reaction)
            key = (trip.condition, trip.axis, trip.code)
            if key not in self._told:
                self._told.add(key)
                yield trip

    def forget(self) -> None:
        """Drop what is latched, on purpose."""
        self._told.clear()
        self.reaction = Reaction.NONE
