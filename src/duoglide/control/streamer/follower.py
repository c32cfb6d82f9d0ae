"""A program under way: which setpoint comes next, and what the operator made of its pace."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from duoglide.control.channel.setpoints import Program
from duoglide.motion.rate import ClockState, PathClock

if TYPE_CHECKING:
    from duoglide.control.channel.scale import IntTriple
    from duoglide.motion.actions import SetOutput, WaitInput


class MotionState(IntEnum):
    """What a motion is doing."""

    NONE = 0
    RUNNING = 1
    WAITING = 2
    HOLDING = 3
    HELD = 4
    STOPPING = 5
    STOPPED = 6
    FINISHED = 7


_OF_CLOCK = {
    ClockState.RUNNING: MotionState.RUNNING,
    ClockState.HOLDING: MotionState.HOLDING,
    ClockState.HELD: MotionState.HELD,
    ClockState.STOPPING: MotionState.STOPPING,
    ClockState.STOPPED: MotionState.STOPPED,
    ClockState.FINISHED: MotionState.FINISHED,
}
OVER = (MotionState.STOPPED, MotionState.FINISHED)


class Motion:
    """One program in progress; ``advance`` once a cycle.

    Args:
        program: What to run.
        override: Rate to begin with, 0 to 1.
    """

    def __init__(self, program: Program, override: float) -> None:
        self.program = program
        self.path_time = 0.0
        self.rate = 0.0
        self._setpoint = program.first
        self._leg = 0
        self._switched = 0
        self._waited = 0.0
        self._waiting = False
        self._stopped = False
        self._clock = PathClock(program.bounds, program.cycle, override=override)

    @property
    def state(self) -> MotionState:
        """What the motion is doing."""
        if self._stopped:
            return MotionState.STOPPED
        return MotionState.WAITING if self._waiting else _OF_CLOCK[self._clock.state]

    @property
    def wait(self) -> WaitInput | None:
        """What the motion waits for; None while it does not."""
        return self.program.legs[self._leg].wait if self._waiting else None

    @property
    def waited(self) -> float:
        """How long it has waited [s]."""
        return self._waited

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

    def go_on(self) -> None:
        """End the wait: the next leg begins at the next ``advance``."""
        before = self._clock
        start = self.program.legs[self._leg].end
        self._clock = PathClock(
            self.program.bounds, self.program.cycle, start=start, override=before.override
        )
        if before.state in (ClockState.HOLDING, ClockState.HELD):
            self._clock.hold()
        self._waiting, self._waited, self._leg = False, 0.0, self._leg + 1

    def advance(self, cycles: int = 1) -> IntTriple:
        """Let ``cycles`` pass and return the setpoint for now [increments]."""
        if self._waiting or self._stopped:
            self._waited += cycles * self.program.cycle
            return self._setpoint
        leg = self.program.legs[self._leg]
        u, self.rate = self._clock.step(cycles * self.program.cycle)
        if u >= leg.end:
            u = leg.end
            if leg.wait is not None:
                self._waiting, self.rate = True, 0.0
                self._stopped = self._clock.state in (ClockState.STOPPING, ClockState.STOPPED)
        if u != self.path_time:
            self.path_time = u
            self._setpoint = self._at(u)
        return self._setpoint

    def due(self) -> list[SetOutput]:
        """Return the outputs whose path time has come since the last call."""
        outputs, first = self.program.outputs, self._switched
        while self._switched < len(outputs) and outputs[self._switched][0] <= self.path_time:
            self._switched += 1
        return [output for _, output in outputs[first : self._switched]]

    def _at(self, u: float) -> IntTriple:
        """Return the setpoint at ``u``: from the validated grid where u is on it."""
        leg, cycle = self.program.legs[self._leg], self.program.cycle
        k = round((u - leg.start) / cycle)
        if k < len(leg.grid) - 1 and leg.start + k * cycle == u:
            return leg.grid[k]
        return leg.grid[-1] if u == leg.end else self.program.setpoint(u)
