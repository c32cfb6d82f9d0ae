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
    from duoglide.motion.path.actions import SetOutput, WaitInput

_RUN_STATES = {state: RunState[state.name] for state in ClockState}
OVER = (RunState.STOPPED, RunState.FINISHED)


class Follower:
    """Goes along prepared setpoints; ``advance`` once a cycle.

    Args:
        prepared: What to follow.
        override: Rate to begin with, 0 to 1.

    Attributes:
        prepared: As given.
        path_time: Of the newest setpoint [s].
        rate: Path time per time.
        margin: What the plan leaves the carriages at the newest setpoint [mm].
        waited: How long the wait at hand has lasted [s].
        led: The stop that a drive leads, once one does; nothing else moves path time then.
    """

    def __init__(self, prepared: PreparedSetpoints, override: float) -> None:
        self.prepared = prepared
        self.path_time = self.rate = self.waited = self._before = 0.0
        self.led: LedStop | None = None
        self._setpoint = prepared.first
        self.margin = prepared.stretches[0].margin(0.0)
        self._stretch, self._later = prepared.stretches[0], iter(prepared.stretches[1:])
        self._switched = 0
        self._waiting = self._stopped = False
        self._clock = PathClock(prepared.trajectory.stops, prepared.cycle, override=override)

    @property
    def state(self) -> RunState:
        """What the run is doing."""
        if self.led is not None:
            return RunState.STOPPED if self.led.over else RunState.STOPPING
        if self._stopped:
            return RunState.STOPPED
        return RunState.WAITING if self._waiting else _RUN_STATES[self._clock.state]

    @property
    def wait(self) -> WaitInput | None:
        """What the run waits for; None while it does not."""
        return self._stretch.wait if self._waiting and self.led is None else None

    @property
    def path_times(self) -> tuple[float, float]:
        """Of the two newest setpoints, the older one first [s]."""
        return self._before, self.path_time

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
        self._stopped = self._stopped or self._waiting

    def end_wait(self) -> None:
        """Let the next stretch begin at the next ``advance``."""
        before = self._clock
        stops, cycle = self.prepared.trajectory.stops, self.prepared.cycle
        self._clock = PathClock(stops, cycle, start=self._stretch.end, override=before.override)
        if before.state in (ClockState.HOLDING, ClockState.HELD):
            self._clock.hold()
        self._waiting, self.waited, self._stretch = False, 0.0, next(self._later)

    def advance(self, cycles: int = 1) -> IntTriple:
        """Let ``cycles`` pass and return the setpoint for now [increments]."""
        self._before = self.path_time
        if self.led is None and (self._waiting or self._stopped):
            self.waited += cycles * self.prepared.cycle
            return self._setpoint
        stretch = self._stretch
        if self.led is None:
            u, self.rate = self._clock.step(cycles * self.prepared.cycle)
        else:
            u, self.rate = self.led.step()
        if u >= stretch.end:
            u = stretch.end
            if stretch.wait is not None:
                self._waiting, self.rate = True, 0.0
                self._stopped = self._clock.state in (ClockState.STOPPING, ClockState.STOPPED)
        if u != self.path_time:
            self.path_time = u
            self._setpoint = self._at(u)
            self.margin = stretch.margin((u - stretch.start) / self.prepared.cycle)
        return self._setpoint

    def take_outputs(self) -> list[SetOutput]:
        """Return the outputs whose path time has come since the last call."""
        outputs, first = self.prepared.outputs, self._switched
        while self._switched < len(outputs) and outputs[self._switched].time <= self.path_time:
            self._switched += 1
        return [timed.output for timed in outputs[first : self._switched]]

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
