"""When and how to stop: from what one cycle saw to what must happen, and what is latched.

``Watch`` fills an ``Observation`` every cycle and asks ``assess``, a pure policy. Nothing here
knows a bus, a clock or a process, so every row of the table can be tested by itself.

Two stops exist. A *stop on the path* slows the path time down: all three carriages come to rest
together on the planned curve. It needs three drives that follow setpoints. Where one does not, a
*quick stop* tells every drive to brake by itself at its own 0x6085; a brake-safe plan has proved
that clearance is kept while they do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

from duoglide.arrays import AXES
from duoglide.control.channel.events import Condition, Reaction, Trip
from duoglide.control.channel.orders import Policy, TrailRule
from duoglide.control.streamer.tracks import AxisTrack, AxisView
from duoglide.control.streamer.trail import AxisTrail
from duoglide.drives.cia402 import State, Status
from duoglide.drives.pdo import NmtState

if TYPE_CHECKING:
    from duoglide.control.channel.scale import IntTriple


_UNSURE = 2  # cycles by which the first answers after a gap may be of another SYNC


class DueSetpoints(NamedTuple):
    """What the drives should have reached at the SYNC that their feedback answers.

    Attributes:
        setpoints: In the order in which they were due; the last but one was due at that SYNC, the
            last is due one cycle later [increments].
        margin: Distance that the plan leaves a carriage there [mm]; inf where no plan says.
        unsure: By how many cycles they may be others, because cycles were skipped just now.
    """

    setpoints: Sequence[IntTriple]
    margin: float
    unsure: int


@dataclass(slots=True)
class Observation:
    """What a cycle saw; written anew every cycle, never kept.

    Attributes:
        axes: The three drives.
        enabled: All three have been enabled by this streamer, and not told otherwise.
        moving: A trajectory is running.
        late: Late cycles in a row.
        unsent: Cycles in a row whose frames could not be sent.
        bus_failed: The link is dead, or the controller is bus-off or error-passive.
        host_gone: The host process has ended.
        host: Age of its last sign of life [cycles].
        host_waits: Whether it is silent because the computer gives it no processor.
        refused: Axis whose setpoint broke a rule, 1 to 3; 0 for none.
        pressed: Quick stop was commanded.
        astray: Axis that has not arrived where a run ends, 1 to 3; 0 for none.
        unled: Axis of a drive that led a stop, and cannot be followed any more; 0 for none.
        foreign: Somebody else has sent SYNC, a setpoint, or a heartbeat as this host.
    """

    axes: tuple[AxisView, ...] = field(default_factory=lambda: tuple(AxisView() for _ in range(3)))
    enabled: bool = False
    moving: bool = False
    late: int = 0
    unsent: int = 0
    bus_failed: bool = False
    host_gone: bool = False
    host: int = 0
    host_waits: bool = False
    refused: int = 0
    astray: int = 0
    unled: int = 0
    pressed: bool = False
    foreign: bool = False

    def host_is_silent(self, policy: Policy) -> bool:
        """Whether the host has not spoken for longer than it may."""
        return self.host >= policy.host and not self.host_waits


_FOLLOWING_ERROR = int(Status.FOLLOWING_ERROR)  # plain numbers: an IntFlag's & costs 1.5 us
_FOLLOWS = int(Status.FOLLOWS_COMMAND)


def assess(seen: Observation, policy: Policy) -> Iterator[Trip]:
    """Yield every condition that this cycle met, with the reaction that it asks for.

    While nothing is enabled only what concerns the bus, the host and lost references is reported:
    a drive that is switched off may be in fault, silent or absent without anybody stopping.
    """
    yield from _of_the_host(seen, policy)
    for index in range(AXES):
        yield from _of_an_axis(index, seen, policy)


def _of_the_host(seen: Observation, policy: Policy) -> Iterator[Trip]:
    if seen.host_gone:
        yield Trip(Condition.HOST_GONE, Reaction.STOP_AND_DISABLE)
    if seen.pressed:
        yield Trip(Condition.PRESSED, Reaction.QUICK_STOP)
    if seen.bus_failed:
        yield Trip(Condition.BUS, Reaction.QUICK_STOP)
    if seen.host_is_silent(policy):
        yield Trip(Condition.HOST_SILENT, Reaction.STOP_AND_DISABLE)
    if not seen.enabled:
        return
    if seen.foreign:
        yield Trip(Condition.FOREIGN, Reaction.QUICK_STOP)
    if seen.refused:
        yield Trip(Condition.REFUSED, Reaction.QUICK_STOP, seen.refused)
    if seen.unled:
        yield Trip(Condition.UNLED, Reaction.QUICK_STOP, seen.unled)
    if seen.astray:
        yield Trip(Condition.ASTRAY, Reaction.STOP_ON_PATH, seen.astray)
    if seen.unsent >= policy.unsent:
        yield Trip(Condition.UNSENT, Reaction.STOP_ON_PATH)
    if seen.moving and seen.late >= policy.late:
        yield Trip(Condition.LATE, Reaction.STOP_ON_PATH)


def _of_an_axis(index: int, seen: Observation, policy: Policy) -> Iterator[Trip]:
    """Yield what one drive shows; the reaction depends on whether it still follows setpoints."""
    axis, number = seen.axes[index], index + 1
    if axis.booted:
        yield Trip(Condition.BOOT_UP, Reaction.QUICK_STOP, number)
    if not seen.enabled:
        return
    follows = axis.state is State.OPERATION_ENABLED
    stop = Reaction.STOP_ON_PATH if follows else Reaction.QUICK_STOP
    if code := axis.emergency:
        reaction = Reaction.QUICK_STOP if axis.is_deaf else stop
        yield Trip(Condition.EMERGENCY, reaction, number, code)
    if not follows:
        yield Trip(_NOT_ENABLED.get(axis.state, Condition.NOT_ENABLED), stop, number)
        return
    off = stop if seen.moving else Reaction.QUICK_STOP  # it would pull, or creep, where it stands
    if axis.statusword & _FOLLOWING_ERROR or axis.following > axis.allowed:
        yield Trip(Condition.FOLLOWING_ERROR, off, number)
    if axis.away:
        yield Trip(Condition.LOST, Reaction.QUICK_STOP if axis.far else off, number)
    if axis.stays:
        yield Trip(Condition.LASTING, off, number)
    if axis.limited >= policy.missing:  # for less, it caught up with setpoints that were lost
        yield Trip(Condition.LIMIT, stop, number)
    if axis.alone >= policy.missing or axis.missing >= policy.silence:
        yield Trip(Condition.SILENT, stop, number)
    if axis.heartbeat >= policy.heartbeat:
        yield Trip(Condition.HEARTBEAT, stop, number)
    if axis.nmt != NmtState.OPERATIONAL:
        yield Trip(Condition.NMT, Reaction.QUICK_STOP, number)
    if seen.moving and not axis.statusword & _FOLLOWS:
        yield Trip(Condition.NOT_FOLLOWING, Reaction.QUICK_STOP, number)


_NOT_ENABLED: dict[State | None, Condition] = {
    None: Condition.UNDEFINED,
    State.FAULT: Condition.FAULT,
    State.FAULT_REACTION_ACTIVE: Condition.FAULT,
}


_OF_A_LEADER = (
    Condition.EMERGENCY,
    Condition.FAULT,
    Condition.NOT_ENABLED,
    Condition.FOLLOWING_ERROR,
    Condition.LOST,
)


class Watch:
    """Fills in an observation every cycle, and latches what has tripped.

    Args:
        policy: What is bridged, and for how long.
        rules: How the carriages may trail their setpoints.

    Attributes:
        policy: As given; it may be replaced.
        leader: Axis of a drive that brakes by itself and leads the stop, so that its state asks for
            no more than that; 0 for none.
        trails: How the carriages trail their setpoints.
        seen: Of this cycle.
        reaction: The strongest that is latched.
    """

    def __init__(self, policy: Policy, rules: Sequence[TrailRule] = ()) -> None:
        self.seen = Observation()
        self.trails = tuple(map(AxisTrail, rules))
        self.reaction = Reaction.NONE
        self.policy = policy
        self.leader = 0
        self._told: set[tuple[Condition, int, int]] = set()
        self._life = 0

    @property
    def too_late(self) -> bool:
        """Whether so many cycles in a row are late that the run must stop."""
        return self.seen.late >= self.policy.late

    def see_axes(
        self, tracks: tuple[AxisTrack, ...], due: DueSetpoints | None, homing: bool = False
    ) -> None:
        """Note what the drives said.

        Args:
            tracks: Of the drives.
            due: Setpoints that they should have reached; None while they are not enabled.
            homing: Whether they have been sent to find their reference; a drive without TPDO2 does
                not say in which mode it is.
        """
        for index, (view, track) in enumerate(zip(self.seen.axes, tracks, strict=True)):
            track.fill(view)
            view.following, view.stays, view.away, view.far = 0.0, False, False, False
            if not self.trails[index].rule.tells:
                view.statusword |= _FOLLOWS  # also in the last answer, where one is missing
            if homing or track.homing:
                view.statusword = 0  # bits 12 and 13 mean something else there
            elif due is not None and not track.missing:
                self._judge_trail(index, track, due)
        self.seen.enabled = due is not None

    def _judge_trail(self, index: int, track: AxisTrack, due: DueSetpoints) -> None:
        view, trail = self.seen.axes[index], self.trails[index]
        # after a gap the answer may be to an earlier SYNC, for a while
        unsure = due.unsure if track.settled else max(due.unsure, _UNSURE + track.gap)
        row = [setpoint[index] for setpoint in due.setpoints]
        if index + 1 == self.leader:
            trail.remember(track.actual, row)
            return
        trail.see(track.actual, row, due.margin / trail.rule.mm, unsure)
        view.following, view.allowed = trail.off, trail.allowed
        view.stays, view.away, view.far = trail.stays, trail.breaks_away, trail.is_far

    def farthest_from(self, goal: IntTriple) -> int:
        """Return the axis that is too far from the end of a run, 1 to 3; 0 where all are there."""
        for index, (view, trail) in enumerate(zip(self.seen.axes, self.trails, strict=True)):
            if view.missing or abs(view.actual - goal[index]) > trail.rule.goal:
                return index + 1
        return 0

    def see_time(self, skipped: int, life: int) -> None:
        """Note how late this cycle is, and whether the host has read since the last one."""
        seen = self.seen
        seen.late = seen.late + skipped if skipped else 0
        seen.host = seen.host + 1 + skipped if life == self._life else 0
        self._life = life

    def see_sending(self, failed: bool) -> None:
        """Note whether this cycle's frames could be sent."""
        self.seen.unsent = self.seen.unsent + 1 if failed else 0

    def find_new_trips(self) -> Iterator[Trip]:
        """Yield what is met for the first time, and let the reaction grow with it."""
        for found in assess(self.seen, self.policy):
            led = found.axis == self.leader and found.condition in _OF_A_LEADER
            trip = replace(found, reaction=Reaction.STOP_ON_PATH) if led else found
            self.reaction = max(self.reaction, trip.reaction)
            key = (trip.condition, trip.axis, trip.code)
            if key not in self._told:
                self._told.add(key)
                yield trip

    def forget(self) -> None:
        """Drop what is latched, on purpose."""
        self._told.clear()
        self.reaction = Reaction.NONE
