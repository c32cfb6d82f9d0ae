"""The cycle: SYNC, listen, obey, supervise, move, send, record. Nothing in it waits.

SYNC goes out first, at the deadline. Then the drives' answers to the SYNC *before* are read: this
process never reacts to a frame by sending one. The setpoint that follows acts at the next SYNC.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from duoglide.control.channel.events import Condition, Happening, Reaction, Refusal, RunState, Trip
from duoglide.control.channel.orders import Command, Order, Power, StreamSettings
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.streamer.follower import OVER, Follower, PathActions
from duoglide.control.streamer.lead import Lead
from duoglide.control.streamer.power import Departure, all_in, controlword
from duoglide.control.streamer.supervise import DueSetpoints, Watch
from duoglide.control.streamer.wire import Wire
from duoglide.drives.cia402 import State
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from duoglide.control.channel.scale import IntTriple
    from duoglide.control.channel.setpoints import PreparedSetpoints
    from duoglide.control.streamer.link import Link
    from duoglide.control.streamer.trail import AxisTrail

SETPOINT_DELAY = 2  # cycles from the SYNC that a setpoint follows to the SYNC when it is reached
DRIVES_BRIDGE = 1  # cycle without a setpoint, at the velocity of the one before; then they stop
_REMEMBERED = 6  # setpoints: those due at an answered SYNC, one cycle later, and earlier
_DUE = -SETPOINT_DELAY - 1  # which of them was due at it
_ASK_EVERY = 16  # cycles between two looks at how long a silent host has waited
_WAITING = 0.25  # share of its silence that makes the computer the reason for it
_BUSY_PATIENCE = 5  # times the ordinary patience, for a host that waits for a processor
_ZEROS: IntTriple = (0, 0, 0)
_INFINITE = float("inf")
_LEAST, _MOST = -(1 << 31), (1 << 31) - 1  # what a record has room for


def _saturate(increments: int) -> int:
    """Return a difference of two positions as far as a record can hold it."""
    return min(max(increments, _LEAST), _MOST)


class Inbox(Protocol):
    """Where the host's orders come from."""

    def orders(self) -> Sequence[Order]:
        """Return the orders that have come, without waiting."""
        ...

    def prepared(self, number: int) -> PreparedSetpoints | None:
        """Return setpoints that have been handed over; None if they have not."""
        ...

    def following(self, number: int) -> PreparedSetpoints | None:
        """Return the setpoints that go on from others; None if they have not been handed over."""
        ...

    @property
    def host_gone(self) -> bool:
        """Whether the host process has ended."""
        ...

    @property
    def host_waited(self) -> int:
        """For how long its threads have been ready to run and were not let, in all [ns]."""
        ...

    def end_deaf_host(self) -> None:
        """End a host in which nothing goes on any more, if a signal has told it to end."""
        ...


class Outbox(Protocol):
    """Where records go: a ``Ring``, or a list in tests."""

    def put_cycle(self, entry: CycleEntry) -> None:
        """Keep the record of a cycle."""
        ...

    def put_event(self, entry: EventEntry) -> None:
        """Keep the record of an event."""
        ...

    @property
    def signs_of_life(self) -> int:
        """A number that changes while somebody reads."""
        ...


class Streamer:
    """The state of the stream, and one cycle of it.

    Args:
        link: The bus.
        settings: Of the machine.
        inbox: The host's orders.
        outbox: Where records go.

    Attributes:
        done: Whether it was told to end, or has nothing to end for.
        standstill: See ``clock.Cyclic``.
    """

    def __init__(self, link: Link, settings: StreamSettings, inbox: Inbox, outbox: Outbox) -> None:
        self._settings = settings
        self._inbox, self._outbox = inbox, outbox
        self._wire = Wire(link, settings)
        self._tracks = self._wire.tracks
        self._watch = Watch(settings.policy, settings.trails)
        self._follower: Follower | None = None
        self._lead = Lead()
        self._setpoint, self._words = _ZEROS, _ZEROS
        self._sent = deque([_ZEROS] * _REMEMBERED, _REMEMBERED)
        self._margins = deque([_INFINITE] * _REMEMBERED, _REMEMBERED)
        self._unsteady = self._unsure = self._settling = 0
        self._path_time = self._rate = 0.0
        self._last = 0  # number of the setpoints after which nothing comes
        self._phase, self._state = Phase.HOLD, RunState.NONE
        self._actions = PathActions(self._wire, self.tell)
        self._power, self._enabled = Power.SILENT, False
        self._cycle = self._time = self._lateness = self._skipped = self._run = 0
        self._asked = self._waited = 0  # when the host was silent for a while
        self._departure = Departure()
        self._closing = self._company = self._silenced = False
        self.done = False
        self.standstill = 0

    def cycle(self, number: int, time: int, lateness: int, skipped: int) -> None:
        """Do one cycle; see ``clock.Cyclic``."""
        if self._cycle >= self._settings.quiet and not self._silenced:
            self._wire.begin(number, self._cycle)
        self._wire.listen(1 + skipped)
        if self._cycle:
            self._record()
        self._cycle, self._time, self._lateness, self._skipped = number, time, lateness, skipped
        for order, argument, value in self._inbox.orders():
            self._obey(Command(order), argument, value)
        self._supervise()
        self._move()
        self._command()
        self._watch.see_sending(self._wire.unsent)

    def tell(
        self, kind: Happening, axis: int = 0, detail: int = 0, code: int = 0, value: float = 0.0
    ) -> None:
        """Record an event of this cycle."""
        self._outbox.put_event(EventEntry(self._cycle, self._time, kind, axis, detail, code, value))

    # What is kept

    def _record(self) -> None:
        """Write the record of the cycle before, whose feedback has just come."""
        first, second, third = self._tracks
        actual = (first.actual, second.actual, third.actual)
        a, b, c = (
            due if self._enabled and track.certain else track.actual
            for due, track in zip(self._sent[_DUE], self._tracks, strict=True)
        )
        lost = (first.missing > 0) | (second.missing > 0) << 1 | (third.missing > 0) << 2
        self._outbox.put_cycle(
            CycleEntry(  # in order, not by name: half the time
                self._cycle,
                self._time,
                self._lateness,
                self._skipped,
                self._path_time,
                self._rate,
                self._setpoint,
                actual,
                (_saturate(actual[0] - a), _saturate(actual[1] - b), _saturate(actual[2] - c)),
                self._words,
                (first.statusword, second.statusword, third.statusword),
                self._phase,
                lost,
                self._state,
                self._power,
                self._run,
            )
        )

    # What the host wants

    def _obey(self, order: Command, argument: int, value: float) -> None:
        if order is Command.POWER:
            self._switch(Power(argument))
        elif order is Command.RUN:
            self._start(argument, value)
        elif order is Command.FORGET:
            self._watch.forget()
        elif order is Command.OUTPUTS:
            self._actions.set_outputs(argument, int(value))
        elif order is Command.CLOSE:
            self._closing = True
        elif order is Command.STANDSTILL:
            self.standstill = round(value * 1e9)
            self._watch.policy = self._settings.allow_standstill(value)
        elif order is Command.QUICK_STOP:
            self._watch.seen.pressed = True
        elif order is Command.END:
            self._last = argument
        elif self._follower is not None:
            self._change_pace(self._follower, order, value)

    def _change_pace(self, follower: Follower, order: Command, value: float) -> None:
        if order is Command.HOLD:
            follower.hold()
        elif order is Command.RESUME:
            follower.resume()
        elif order is Command.OVERRIDE:
            follower.set_override(value)
        elif order is Command.STOP:
            follower.stop()
        self.tell(Happening.ORDER, detail=order, value=value)

    def _switch(self, power: Power) -> None:
        """Change the goal of the drives' power; what is latched forbids to switch it on."""
        on = power is Power.ON or power.homes
        if self._follower is not None:
            self._refuse(Command.POWER, Refusal.BUSY)
            return
        if on and self._watch.reaction is not Reaction.NONE:
            self._refuse(Command.POWER, Refusal.LATCHED)
            return
        self._power = power
        self._enabled = self._enabled and on
        self.tell(Happening.POWER, detail=power, value=float(self._enabled))

    def _start(self, number: int, override: float) -> None:
        """Begin a run, if everything is as it must be; tell if it is not."""
        prepared = self._inbox.prepared(number)
        if prepared is None:
            self._refuse(Command.RUN, Refusal.NOT_LOADED)
        elif not self._enabled or self._power is not Power.ON:
            self._refuse(Command.RUN, Refusal.NOT_ENABLED)
        elif self._watch.reaction is not Reaction.NONE:
            self._refuse(Command.RUN, Refusal.LATCHED)
        elif self._follower is not None:
            self._refuse(Command.RUN, Refusal.BUSY)
        elif prepared.lead_in:
            self._refuse(Command.RUN, Refusal.MOVING)
        elif axis := prepared.fence.refuses(prepared.first, self._setpoint):
            self._refuse(Command.RUN, Refusal.ELSEWHERE, axis)
        else:
            self._follower, self._run, self._last = Follower(prepared, override), number, 0
            self.tell(Happening.STARTED, detail=prepared.phase, value=number)

    def _refuse(self, order: Command, reason: Refusal, axis: int = 0) -> None:
        self.tell(Happening.REFUSED, axis=axis, detail=order, code=reason)

    # When and how to stop

    def _supervise(self) -> None:
        seen, watch = self._watch.seen, self._watch
        if self._skipped:
            self.tell(Happening.LATE, value=self._skipped)
        for number, track in enumerate(self._tracks, 1):
            for code in track.emergencies:
                self.tell(Happening.EMERGENCY, axis=number, code=code)
        due = self._due() if self._enabled else None
        watch.see_axes(self._tracks, due, self._power.homes)
        self._look_for_a_leader()
        for number, trail in enumerate(watch.trails, 1):
            if trail.departure_is_over:
                self._tell_departure(number, trail)
        watch.see_time(self._skipped, self._outbox.signs_of_life)
        seen.host_waits = self._host_waits()
        silent = seen.host_is_silent(watch.policy) and self._power is not Power.SILENT
        if silent and not self._cycle % _ASK_EVERY:
            self._inbox.end_deaf_host()
        seen.moving = self._follower is not None
        seen.bus_failed, seen.foreign = self._wire.failed, self._wire.foreign
        self.done = self._closing and self._power is Power.OFF
        seen.host_gone = self._inbox.host_gone or self._closing
        if self._power is not Power.SILENT:
            self._judge()
        else:
            self._look_on()
        seen.pressed, seen.astray, seen.refused = False, 0, 0
        self._lead.lost = 0

    def _look_on(self) -> None:
        """Tell what concerns the host while nothing is commanded, and nothing can be stopped."""
        seen = self._watch.seen
        for number, axis in enumerate(seen.axes, 1):
            if axis.booted:  # it has lost its reference and what it was told
                trip = Trip(Condition.BOOT_UP, Reaction.QUICK_STOP, number)
                self.tell(Happening.TRIP, *trip.to_fields())
        if seen.host_gone:
            self.done = True
        elif seen.foreign and not self._company:
            self._company = True
            self._silenced = self._cycle <= self._settings.quiet
            self.tell(Happening.FOREIGN)

    def _look_for_a_leader(self) -> None:
        """Let a drive that brakes by itself lead the others along the path, where that is good."""
        watch, lead = self._watch, self._lead
        if self._follower is not None and self._enabled:
            lead.look(self._follower, watch.seen.axes, watch.trails, self._sent, self._skipped)
        else:
            lead.axis = 0
        watch.leader, watch.seen.unled = lead.axis, lead.lost

    def _host_waits(self) -> bool:
        """Whether a silent host would speak if a busy computer let it; for so long, and no longer.

        The kernel says how long threads have waited for a processor. That costs a look into files,
        so it is asked for half of the host's patience at the earliest, and now and then.
        """
        seen, limit = self._watch.seen, self._watch.policy.host
        if seen.host < limit // 2:
            self._asked = 0
            return False
        if not self._asked:
            self._asked, self._waited = seen.host, self._inbox.host_waited
        silent = seen.host - self._asked
        if seen.host < limit or self._watch.reaction is not Reaction.NONE or not silent:
            return False
        if seen.host_waits and silent % _ASK_EVERY:
            return True
        share = (self._inbox.host_waited - self._waited) / (silent * self._settings.cycle)
        return share > _WAITING and seen.host < _BUSY_PATIENCE * limit

    def _due(self) -> DueSetpoints:
        """Return the setpoints that the newest feedback is compared with."""
        if self._skipped or self._wire.unsent:
            self._unsure, self._unsteady = 2 + self._skipped, _REMEMBERED
        elif self._unsteady:
            self._unsteady -= 1
        else:  # whoever follows a drive that brakes is asked for more than usual, and trails more
            self._unsure = int(self._lead.axis > 0)
        return DueSetpoints(tuple(self._sent)[:-1], self._margins[_DUE], self._unsure)

    def _tell_departure(self, number: int, trail: AxisTrail) -> None:
        """Tell that a carriage has not been where its setpoints lead, for some cycles."""
        if trail.departed:
            worst = trail.worst * trail.rule.mm
            self.tell(Happening.LOST, axis=number, code=trail.departed, value=worst)
        trail.forget_departure()

    def _judge(self) -> None:
        """React to what is met for the first time, and only ever more strongly."""
        before = self._watch.reaction
        for trip in self._watch.find_new_trips():
            self.tell(Happening.TRIP, *trip.to_fields())
        reaction = self._watch.reaction
        if reaction is before:
            return
        if reaction is Reaction.QUICK_STOP:
            self._end_run(Happening.STOPPED, by_themselves=True)
            if self._power is not Power.OFF:  # what is being switched off must not stay on
                self._power = Power.QUICK_STOP
            self._enabled = False
        elif self._follower is not None:
            self._follower.stop()

    def _end_run(self, kind: Happening, by_themselves: bool = False) -> None:
        """Tell how a run has ended, if there is one; ``by_themselves``: the drives stop off it."""
        if (follower := self._follower) is not None:
            for number, trail in enumerate(self._watch.trails, 1):
                self._tell_departure(number, trail)
            phase, code = follower.prepared.phase, int(by_themselves)
            self.tell(kind, detail=phase, code=code, value=follower.path_time)
            self._follower = None

    def _leave(self) -> None:
        """The host is gone and everything stands: power off, wait for the drives, end."""
        seconds = (1 + self._skipped) * self._settings.cycle * 1e-9
        quick_stop = self._watch.reaction is Reaction.QUICK_STOP
        if self._departure.may_switch_off(seconds, quick_stop):
            self._power, self._enabled = Power.OFF, False
        self.done = self._departure.is_over(self._power, self._tracks)

    # Setpoints

    def _move(self) -> None:
        if self._follower is not None:
            self._advance(self._follower)
            return
        self._rate, self._phase, self._state = 0.0, Phase.HOLD, RunState.NONE
        self._stand()
        if self._watch.seen.host_gone:
            self._leave()
        elif self._watch.reaction is Reaction.STOP_AND_DISABLE:  # silent; it may speak again
            self._power, self._enabled = Power.OFF, False

    def _advance(self, follower: Follower) -> None:
        """Take the run's next setpoint.

        A gap is bridged as far as the drives have gone on through it, unless it is why we stop;
        whoever made up for a longer one would have them leap.
        """
        gap = 0 if self._watch.too_late else min(self._skipped, DRIVES_BRIDGE)
        before, reached, follower.last = follower.prepared, follower.path_time, self._last
        waited = follower.waited if follower.starved else 0.0
        if follower.following is None:
            follower.following = self._inbox.following(before.number)
        target = follower.advance(1 + gap)
        if follower.prepared is not before:
            self._tell_part(follower.prepared, before, reached, waited)
        refused = follower.prepared.fence.refuses(target, self._setpoint, 1 + gap)
        if refused:
            self._watch.seen.refused = refused
            self._judge()
            return
        self._setpoint = target
        self._path_time, self._rate = follower.path_time, follower.rate
        self._state = state = follower.state
        stopping = state in (RunState.STOPPING, RunState.STOPPED)
        self._phase = Phase.STOP if stopping else follower.prepared.phase
        self._actions.carry_out(follower)
        if state is RunState.FINISHED:
            self._arrive(follower)
        elif state in OVER:
            if follower.unjoined:
                self._refuse(Command.RUN, Refusal.ELSEWHERE)
            self._end_run(Happening.STOPPED)

    def _tell_part(
        self, now: PreparedSetpoints, before: PreparedSetpoints, reached: float, waited: float
    ) -> None:
        """Tell that other setpoints have taken over, and how long the motion rested for them."""
        self._run = now.number
        if waited:
            self.tell(Happening.AWAITED, value=waited)
        if now.phase is before.phase:
            self.tell(Happening.PART, code=int(now.lead_in > 0.0), value=now.number)
        else:
            self.tell(Happening.FINISHED, detail=before.phase, value=reached)
            self.tell(Happening.STARTED, detail=now.phase, value=now.number)

    def _arrive(self, follower: Follower) -> None:
        """End a run once all carriages are where it ends, and stand; name the one that is not."""
        stands = self._sent[_DUE] == self._setpoint
        astray = self._watch.farthest_from(self._setpoint)
        if stands and not astray:
            self._settling = 0
            stopped = self._watch.reaction is not Reaction.NONE  # too late to stop before the end
            self._end_run(Happening.STOPPED if stopped else Happening.FINISHED)
            return
        self._rate, self._phase = 0.0, Phase.HOLD
        self._settling += 1 + self._skipped
        if stands and self._settling > self._settings.settling + _REMEMBERED:
            self._settling, self._watch.seen.astray = 0, astray
            self._judge()
            self._end_run(Happening.STOPPED)

    def _stand(self) -> None:
        """Hold the setpoints of drives that follow them; elsewhere keep to the actual position.

        A drive that is off, or in homing mode, must find its own position as its target when that
        ends, or it would jump.
        """
        on = self._power is Power.ON
        if on and not self._enabled and all_in(self._tracks, State.OPERATION_ENABLED):
            self._enabled = True
            for trail in self._watch.trails:
                trail.reset()
            self.tell(Happening.POWER, detail=Power.ON, value=1.0)
        first, second, third = (
            held if on and track.follows else track.actual
            for held, track in zip(self._setpoint, self._tracks, strict=True)
        )
        self._setpoint = (first, second, third)

    def _command(self) -> None:
        """Send what this cycle has to say."""
        self._sent.append(self._setpoint)
        follower = self._follower
        self._margins.append(_INFINITE if follower is None else follower.margin)
        if self._power is Power.SILENT:
            self._wire.flush()
            return
        first, second, third = (
            controlword(
                self._lead.power_of(axis, self._power, track.state), track.state, self._cycle
            )
            for axis, track in enumerate(self._tracks, 1)
        )
        self._words = (first, second, third)
        self._wire.command(self._words, self._setpoint)
