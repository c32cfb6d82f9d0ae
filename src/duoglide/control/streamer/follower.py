"""Prepared setpoints under way: which is next, at what pace, and what the path asks for there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from duoglide.arrays import AXES
from duoglide.control.channel.events import Happening, RunState
from duoglide.motion.path_clock import ClockState, PathClock

if TYPE_CHECKING:
    from duoglide.control.channel.scale import IntTriple
    from duoglide.control.channel.setpoints import PreparedSetpoints
    from duoglide.control.streamer.led_stop import LedStop
    from duoglide.control.streamer.wire import Wire
    from duoglide.motion.led_stops import LedStops
    from duoglide.motion.path.actions import SetOutput, WaitInput

_RUN_STATES = {state: RunState[state.name] for state in ClockState}
_LED_AFTER = 4  # cycles after a seam: a drive that leads may have begun to brake before it
_SAME_TIME = 1e-6  # [s] between the same place on two ways
OVER = (RunState.STOPPED, RunState.FINISHED)


class Follower:
    """Goes along prepared setpoints, and from them to the next ones; ``advance`` once a cycle.

    Where the next ones take over in motion, they do so in the cycle in which the seam is passed, at
    whatever rate, and while that changes. If they come too late for that, the way to rest is
    followed, and the next ones are gone on with from wherever on it the motion has come to rest:
    they lie on the same curve. At rest the next ones begin as soon as they have come.

    Args:
        prepared: What to follow.
        override: Rate to begin with, 0 to 1.

    Attributes:
        prepared: What is followed now.
        path_time: Of the newest setpoint [s].
        rate: Path time per time.
        margin: What the plan leaves the carriages at the newest setpoint [mm].
        waited: How long the wait at hand has lasted [s].
        led: The stop that a drive leads, once one does; nothing else moves path time then.
        last: Number of the setpoints after which nothing comes; 0: not known yet.
        following: What comes next; None: it has not come yet.
        unjoined: Whether what comes next does not go on from where the motion rests.
    """

    def __init__(self, prepared: PreparedSetpoints, override: float) -> None:
        self.path_time = self.rate = self.waited = self._before = 0.0
        self.led: LedStop | None = None
        self.last = 0
        self.following: PreparedSetpoints | None = None
        self.unjoined = False
        self._setpoint = prepared.first
        self._due: list[SetOutput] = []
        self._waiting = self._stopped = self._starved = False
        self._fresh = _LED_AFTER
        self._begin(prepared)
        self._clock = PathClock(prepared.bounds, prepared.cycle, override=override)

    def _begin(self, prepared: PreparedSetpoints) -> None:
        """Have new setpoints followed from their start on."""
        self.prepared, self._lead_in, self._carried = prepared, prepared.lead_in, False
        self.margin = prepared.stretches[0].margin(0.0)
        self._stretch, self._later = prepared.stretches[0], iter(prepared.stretches[1:])
        self._switched = 0
        self.following = None

    @property
    def state(self) -> RunState:
        """What the run is doing."""
        if self.led is not None:
            return RunState.STOPPED if self.led.over else RunState.STOPPING
        if self._stopped:
            return RunState.STOPPED
        if self._starved and self.last == self.prepared.number:
            return RunState.FINISHED
        if self._starved and self._clock.holding:
            return RunState.HELD
        waits = self._waiting or self._starved
        return RunState.WAITING if waits else _RUN_STATES[self._clock.state]

    @property
    def wait(self) -> WaitInput | None:
        """What the run waits for; None while it does not."""
        return self._stretch.wait if self._waiting and self.led is None else None

    @property
    def starved(self) -> bool:
        """Whether it has come to rest at the end of what there is, and something is to come."""
        return self._starved and self.last != self.prepared.number and not self._stopped

    @property
    def path_times(self) -> tuple[float, float]:
        """Of the two newest setpoints, the older one first [s]."""
        return self._before, self.path_time

    @property
    def led_stops(self) -> LedStops | None:
        """Where a drive may lead a stop; not just after a seam, before which it may have begun."""
        return self.prepared.led if self._fresh >= _LED_AFTER else None

    def hold(self) -> None:
        """Come to rest on the path until ``resume``."""
        self._clock.hold()

    def resume(self) -> None:
        """Go on after a hold."""
        self._clock.resume()

    def set_override(self, override: float) -> None:
        """Run at this rate, 0 to 1."""
        self._clock.set_override(override)

    def stop(self) -> None:
        """Come to rest on the path for good."""
        self._clock.stop()
        self._stopped = self._stopped or self._waiting or self._starved

    def end_wait(self) -> None:
        """Let the next stretch begin at the next ``advance``."""
        self._restart(self._stretch.end)
        self._waiting, self.waited, self._stretch = False, 0.0, next(self._later)

    def _restart(self, start: float, rate: float | None = None) -> None:
        """Begin anew at a path time of these setpoints [s]; at their override, or another rate."""
        before, prepared = self._clock, self.prepared
        self._lead_in, self._carried = prepared.lead_in, False
        place = min(self._lead_in + start, prepared.bounds.duration)
        override = before.override if rate is None else rate
        clock = PathClock(prepared.bounds, prepared.cycle, start=place, override=override)
        if before.holding:
            clock.hold()
        if rate is not None:
            clock.set_override(before.override)
        self._clock = clock

    def advance(self, cycles: int = 1) -> IntTriple:
        """Let ``cycles`` pass and return the setpoint for now [increments]."""
        self._before = self.path_time
        self._fresh += cycles
        if self._starved and self.led is None and not self._stopped:
            self._go_on_from_rest()
        if self.led is None and (self._waiting or self._stopped or self._starved):
            self.waited += 0.0 if self._clock.holding else cycles * self.prepared.cycle
            return self._setpoint
        if self.led is None:
            self._reach_beyond_the_seam()
            clock, self.rate = self._clock.step(cycles * self.prepared.cycle)
            u = self._pass_seam(clock - self._lead_in)
        else:
            u, self.rate = self.led.step()
        stretch = self._stretch
        ended = self.led is None and self._clock.state is ClockState.FINISHED
        if u >= stretch.end or ended:  # the clock counts from before the start, and rounds
            u = stretch.end
            if stretch.wait is not None:
                self._waiting, self.rate = True, 0.0
                self._stopped = self._clock.state in (ClockState.STOPPING, ClockState.STOPPED)
            elif self.led is None:
                self._starved, self.rate = True, 0.0
                self._stopped = self._clock.stopping and self.last != self.prepared.number
        if u != self.path_time:
            self.path_time = u
            self._setpoint = self._at(u)
            self.margin = stretch.margin((u - stretch.start) / self.prepared.cycle)
        return self._setpoint

    # From one to the next

    def _reach_beyond_the_seam(self) -> None:
        """Let changes of rate end beyond the seam, from when on the next setpoints are there."""
        following, seam = self.following, self.prepared.seam
        if following is None or seam is None or self._carried or self._clock.changing:
            return
        if self.path_time < seam and following.pace is not None:
            self._clock.carry_on(following.pace, self._lead_in)
            self._lead_in, self._carried = 0.0, True
        elif self._clock.rate == 0.0 and self.path_time > seam and following.lead_in:
            self._rejoin(following, seam)  # it is held on the way to rest

    def _pass_seam(self, u: float) -> float:
        """Go over to the next setpoints if their seam is passed; return the path time there [s]."""
        following, seam = self.following, self.prepared.seam
        if following is None or seam is None or not self._carried or u < seam:
            return u
        outputs = self.prepared.outputs[self._switched :]
        self._due += [timed.output for timed in outputs if timed.time < seam]
        self._begin(following)
        self.path_time = self._before = self._before - seam
        self._fresh = 0
        return u - seam

    def _go_on_from_rest(self) -> None:
        """Begin the next setpoints at rest, once they have come and nothing holds the motion."""
        following, seam = self.following, self.prepared.seam
        if following is None or self._clock.holding:
            return
        if seam is not None and following.lead_in:
            self._rejoin(following, seam)
            return
        self._begin(following)
        self._restart(0.0)
        self.path_time = self._before = 0.0
        self._starved, self.waited = False, 0.0

    def _rejoin(self, following: PreparedSetpoints, seam: float) -> None:
        """Go on with the next setpoints from a rest on the way to rest that replaced them."""
        if following.passing:
            self.following = None
            return
        here = self.prepared.trajectory.profile
        beyond = here.at_time(self.path_time)[0] - here.at_time(seam)[0]
        start = following.trajectory.profile.time_at(beyond)
        apart = zip(following.at(start), self._setpoint, strict=True)
        if any(abs(one - other) > 1 for one, other in apart):
            self.unjoined = True
            self.stop()
            return
        self._begin(following)
        stretches = [following.stretches[0], *self._later]
        index = next(i for i, one in enumerate(stretches) if start < one.end or one.wait is None)
        self._stretch, self._later = stretches[index], iter(stretches[index + 1 :])
        self._switched = sum(timed.time <= start + _SAME_TIME for timed in following.outputs)
        self._restart(start, rate=0.0)
        self.path_time = self._before = start
        self._starved, self.waited = False, 0.0

    def take_outputs(self) -> list[SetOutput]:
        """Return the outputs whose path time has come since the last call."""
        due, self._due = self._due, []
        outputs, first = self.prepared.outputs, self._switched
        while self._switched < len(outputs) and outputs[self._switched].time <= self.path_time:
            self._switched += 1
        return due + [timed.output for timed in outputs[first : self._switched]]

    def _at(self, u: float) -> IntTriple:
        """Return the setpoint at ``u``: from the validated grid where u is on it."""
        stretch, cycle = self._stretch, self.prepared.cycle
        k = round((u - stretch.start) / cycle)
        if k < len(stretch.grid) - 1 and stretch.start + k * cycle == u:
            return stretch.grid[k]
        return stretch.grid[-1] if u == stretch.end else self.prepared.at(u)


class Tell(Protocol):
    """Records an event of this cycle."""

    def __call__(
        self, kind: Happening, axis: int = 0, detail: int = 0, code: int = 0, value: float = 0.0
    ) -> None:
        """Record it."""


class PathActions:
    """The drives' outputs and inputs, as a path uses them.

    Args:
        wire: Where outputs go and inputs come from.
        tell: Records what was done.
    """

    def __init__(self, wire: Wire, tell: Tell) -> None:
        self._wire = wire
        self._tell = tell
        self._outputs = [0] * AXES

    def set_outputs(self, axis: int, word: int) -> None:
        """Set 0x60FE:1 of one axis (index) with the frames of this cycle."""
        self._outputs[axis] = word
        self._wire.set_outputs(axis, word)
        self._tell(Happening.OUTPUT, axis=axis + 1, code=word)

    def carry_out(self, follower: Follower) -> None:
        """Do what the path asks for here: outputs, and the end of waits."""
        for action in follower.take_outputs():
            axis = action.axis - 1
            mask = 1 << action.bit
            word = self._outputs[axis] | mask if action.value else self._outputs[axis] & ~mask
            self.set_outputs(axis, word)
        if (wait := follower.wait) is None:
            return
        if bool(self._wire.tracks[wait.axis - 1].inputs >> wait.bit & 1) == wait.value:
            self._tell(Happening.INPUT, wait.axis, wait.bit, value=follower.waited)
            follower.end_wait()
        elif follower.waited >= wait.timeout:
            self._tell(Happening.INPUT_TIMEOUT, wait.axis, wait.bit, value=follower.waited)
            follower.stop()
