"""The path clock: how fast a trajectory is run, and how that changes while it runs.

The stream asks the clock once a cycle for the path time u, and sends the trajectory's setpoint at
u. Feed hold, resume, override and stop change the rate r = du/dtau, never the path. A change is a
ruckig velocity profile of r within the bounds that the plan carries (``StopBounds``).
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import ruckig

from duoglide.arrays import as_number
from duoglide.errors import InputError
from duoglide.motion.stop_bounds import RateBounds, StopBounds

_ROUNDING = 1e-9  # The rate may be wrong by so little: ruckig returns it with errors near 1e-15.


class ClockState(enum.Enum):
    """What the clock is doing."""

    RUNNING = "running"
    HOLDING = "holding"
    HELD = "held"
    STOPPING = "stopping"
    STOPPED = "stopped"
    FINISHED = "finished"


@dataclass(frozen=True, slots=True)
class _Change:
    """A change of rate under way."""

    target: float
    bounds: RateBounds
    profile: ruckig.Trajectory

    def at(self, tau: float) -> tuple[float, float, float]:
        (u,), (rate,), (slope,) = self.profile.at_time(tau)
        return u, min(max(rate, 0.0), 1.0), slope


class PathClock:
    """Path time as a function of running time, one step a cycle.

    At a constant rate, u is an anchor plus a whole number of cycles times the rate, never a running
    sum: at rate 1 from the start it is k * cycle to the last bit, on every machine.

    A command in the middle of a change takes effect at once where the plan's bounds certify it
    from there. Where they do not, the change under way first comes to a constant rate as its own
    bounds allow, or at the latest ends, and the new change begins there. Between changes and in
    them r'^2 <= 2 R2 min(r, 1 - r) always holds, which the bounds count on.

    Args:
        bounds: What the trajectory's plan carries; its ``duration`` is the end of path time.
        cycle: Period of ``step`` [s].
        start: Path time at which to begin [s].
        override: Rate to begin with and to run at, 0 to 1. Path time begins at that rate: right
            where the trajectory is at rest, or where the one before ended at the same rate.

    Raises:
        InputError: A value out of its range.
    """

    def __init__(
        self, bounds: StopBounds, cycle: float, *, start: float = 0.0, override: float = 1.0
    ) -> None:
        self._bounds = bounds
        self._cycle = as_number(cycle, "cycle")
        if self._cycle <= 0.0:
            raise InputError(f"cycle = {cycle:g} s: must be above zero")
        self._anchor = as_number(start, "start")
        if not 0.0 <= self._anchor <= bounds.duration:
            raise InputError(f"start = {start:g} s: must be from 0 to {bounds.duration:g} s")
        self._override = require_override(override)
        self._rate = self._override
        self._ticks = 0
        self._tau = 0.0
        self._change: _Change | None = None
        self._goal = self._override
        self._holding = self._stopping = False
        self._finished = self._anchor >= bounds.duration
        self._solver = ruckig.Ruckig(1)
        self._input = ruckig.InputParameter(1)
        self._input.control_interface = ruckig.ControlInterface.Velocity
        self._input.target_acceleration = [0.0]

    @property
    def state(self) -> ClockState:
        """What the clock is doing."""
        still = self._change is None and self._rate == 0.0
        if self._finished:
            return ClockState.FINISHED
        if self._stopping:
            return ClockState.STOPPED if still else ClockState.STOPPING
        if self._holding:
            return ClockState.HELD if still else ClockState.HOLDING
        return ClockState.RUNNING

    @property
    def path_time(self) -> float:
        """Path time u now [s]."""
        return self._now()[0]

    @property
    def rate(self) -> float:
        """Rate r = du/dtau now, 0 to 1."""
        return 0.0 if self._finished else self._now()[1]

    @property
    def override(self) -> float:
        """The rate to run at when nothing holds the clock, 0 to 1."""
        return self._override

    @property
    def changing(self) -> bool:
        """Whether a change of rate is under way."""
        return self._change is not None

    @property
    def holding(self) -> bool:
        """Whether a hold is asked for, wherever the clock is."""
        return self._holding

    @property
    def stopping(self) -> bool:
        """Whether it was told to stop for good, wherever it is."""
        return self._stopping

    def carry_on(self, bounds: StopBounds, shift: float) -> None:
        """Go on within the bounds of a longer motion, of which this one is a part.

        Args:
            bounds: Of the longer motion; they cover what comes after this one too.
            shift: Path time of this motion at which the longer one begins [s].

        Raises:
            InputError: A change of rate is under way: it was certified for this motion alone.
        """
        if self._change is not None:
            raise InputError("a change of rate is under way: it ends within the old bounds")
        self._bounds = bounds
        self._anchor -= shift

    def set_override(self, override: float) -> None:
        """Run at this rate, 0 to 1, now or when the hold ends.

        Raises:
            InputError: Not a number from 0 to 1.
        """
        self._override = require_override(override)
        self._aim()

    def hold(self) -> None:
        """Come to rest on the path; ``resume`` goes on."""
        self._holding = True
        self._aim()

    def resume(self) -> None:
        """Go on at the override after a hold; a stop stays a stop."""
        self._holding = False
        self._aim()

    def stop(self) -> None:
        """Come to rest on the path for good: only a new clock moves again."""
        self._stopping = True
        self._aim()

    def step(self, dt: float) -> tuple[float, float]:
        """Let ``dt`` pass [s], normally one cycle; return path time u [s] and rate r.

        A skipped cycle is a step of two cycles. At the end u is the duration exactly.
        """
        if self._finished:
            return self._bounds.duration, 0.0
        if self._change is None and self._rate != self._goal:
            self._aim()  # what could not begin where it was asked for begins as soon as it can
        if self._change is None:
            self._tick(dt)
        else:
            self._tau += dt
            self._pass_changes()
        u, rate, _ = self._now()
        if u >= self._bounds.duration:
            self._finish()
            return self._bounds.duration, 0.0
        return u, rate

    def _now(self) -> tuple[float, float, float]:
        if self._change is not None:
            return self._change.at(self._tau)
        return self._anchor + self._ticks * self._cycle * self._rate, self._rate, 0.0

    def _tick(self, dt: float) -> None:
        """Advance at a constant rate."""
        cycles = round(dt / self._cycle)
        if cycles * self._cycle == dt:
            self._ticks += cycles
        else:
            self._anchor = self._now()[0] + dt * self._rate
            self._ticks = 0

    def _pass_changes(self) -> None:
        """Leave a change that has ended, and begin the one that waits, if any."""
        while self._change is not None and self._tau >= self._change.profile.duration:
            rest = self._tau - self._change.profile.duration
            (end,), _, _ = self._change.profile.at_time(self._change.profile.duration)
            self._rate = self._change.target
            self._change = None
            self._anchor, self._ticks, self._tau = end, 0, rest
            self._aim()
        if self._change is None:
            self._anchor += self._tau * self._rate
            self._tau = 0.0

    def _finish(self) -> None:
        self._finished = True
        self._change = None
        self._anchor, self._ticks, self._rate = self._bounds.duration, 0, 0.0

    def _aim(self) -> None:
        """Begin the change of rate that the commands ask for, if it is not under way."""
        self._goal = 0.0 if self._holding or self._stopping else self._override
        if self._finished or self._goal == (self._change.target if self._change else self._rate):
            return
        u, rate, slope = self._now()
        old = self._change
        rising = self._goal > rate
        fresh = None
        if slope == 0.0 or (slope > 0.0) == rising:
            bounds = self._bounds.rising_at(u) if rising else self._bounds.falling_at(u)
            fresh = self._certified(u, rate, slope, self._goal, bounds)
            if fresh is None and old is not None:
                fresh = self._certified(u, rate, slope, self._goal, old.bounds)
        if fresh is None and old is not None:
            level = min(max(rate + slope * abs(slope) / (2.0 * old.bounds.bend), 0.0), 1.0)
            fresh = self._certified(u, rate, slope, level, old.bounds)
        if fresh is not None:
            self._change, self._tau = fresh, (0.0 if old is not None else self._tau)

    def _certified(
        self, u: float, rate: float, slope: float, target: float, bounds: RateBounds
    ) -> _Change | None:
        """Return the change to ``target`` within ``bounds``, or None where they do not cover it.

        A change to another rate than rest may travel farther than a stop, and past what one cell
        certifies: it then keeps to the lesser bounds of that cell and of those after it.
        """
        further = self._bounds.rising_at if target > rate else self._bounds.falling_at
        while (change := self._within(u, rate, slope, target, bounds)) is not None:
            (end,), _, _ = change.profile.at_time(change.profile.duration)
            if min(end, self._bounds.duration) <= bounds.until + _ROUNDING * self._cycle:
                return change
            ahead = further(bounds.until)
            if ahead.until <= bounds.until:
                return None
            bounds = RateBounds(
                min(bounds.slope, ahead.slope), min(bounds.bend, ahead.bend), ahead.until
            )
        return None

    def _within(
        self, u: float, rate: float, slope: float, target: float, bounds: RateBounds
    ) -> _Change | None:
        """Return the change within a pair of bounds, however far it goes, if it can begin."""
        room = 2.0 * bounds.bend * min(rate, 1.0 - rate) * (1.0 + _ROUNDING) + _ROUNDING**2
        if abs(slope) > bounds.slope * (1.0 + _ROUNDING) or slope * slope > room:
            return None
        state = self._input
        state.current_position, state.current_velocity = [u], [rate]
        state.current_acceleration = [min(max(slope, -bounds.slope), bounds.slope)]
        state.target_velocity = [target]
        state.max_acceleration, state.max_jerk = [bounds.slope], [bounds.bend]
        profile = ruckig.Trajectory(1)
        result = self._solver.calculate(state, profile)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            return None
        return _Change(target, bounds, profile)


def require_override(override: object) -> float:
    """Return the share of the planned speed that is asked for, 0 to 1; at 0 the run stands.

    Raises:
        InputError: It is not.
    """
    value = as_number(override, "override")
    if not 0.0 <= value <= 1.0:
        raise InputError(f"override = {value:g}: must be from 0 to 1 (1 is the planned speed)")
    return value
