"""Where a drive wants its carriage to be, between one setpoint and the next.

The same arithmetic as firmware_interface/reference_axis/axis.c, to the last bit: whole numbers,
positions in 1/256 increment, velocities in 1/256 increment per second, time in microseconds,
divisions rounded down. firmware_interface/conformance.json holds both to it.
"""

from __future__ import annotations

from enum import Enum, auto

FRACTION = 256  # parts of an increment
SECOND = 1_000_000  # [us]
LONGEST_STEP = 10_000  # [us]


class Phase(Enum):
    """What the demand is doing."""

    HOLD = auto()  # it stands
    FOLLOW = auto()  # it goes to a setpoint, and past it for one period if no other comes
    BRAKE = auto()  # it slows down to a stand
    JOG = auto()  # it runs at a speed, to search for a reference; not in the C axis


class Demand:
    """Position demand: interpolation, bridging of one lost setpoint, and the braking ramp."""

    __slots__ = (
        *("acceleration", "elapsed", "end", "goal", "period", "phase", "position", "start"),
        "velocity",
    )

    def __init__(self) -> None:
        self.phase = Phase.HOLD
        self.position = 0
        self.velocity = 0
        self.start = self.end = self.elapsed = 0
        self.period = 1
        self.goal = self.acceleration = 0  # of a jog

    def place(self, increments: int) -> None:
        """Stand at a position."""
        self.phase = Phase.HOLD
        self.position = increments * FRACTION
        self.velocity = 0

    def aim(self, increments: int, period: int) -> None:
        """Go to a setpoint, to be there after one period [us]."""
        self.phase = Phase.FOLLOW
        self.start = self.position
        self.end = increments * FRACTION
        self.elapsed = 0
        self.period = period
        self.velocity = (self.end - self.start) * SECOND // period

    def jog(self, speed: int, acceleration: int) -> None:
        """Run at a speed [increments/s], with this acceleration [increments/s^2]."""
        self.phase = Phase.JOG
        self.goal = speed * FRACTION
        self.acceleration = acceleration

    def brake(self) -> None:
        """Slow down from here on."""
        if self.phase in (Phase.FOLLOW, Phase.JOG):
            self.phase = Phase.BRAKE

    def advance(self, dt: int, deceleration: int) -> None:
        """Let time pass.

        Args:
            dt: [us]
            deceleration: Of the braking ramp [increments/s^2].
        """
        if self.phase is Phase.FOLLOW:
            self.elapsed += dt
            late = self.elapsed - 2 * self.period
            within = self.elapsed - max(late, 0)
            self.position = self.start + (self.end - self.start) * within // self.period
            if late <= 0:
                return
            self.phase = Phase.BRAKE
            dt = late
        elif self.phase is Phase.JOG:
            self._run(dt)
        while self.phase is Phase.BRAKE and dt > 0:
            step = min(dt, LONGEST_STEP)
            self._slow_down(step, deceleration)
            dt -= step

    def _slow_down(self, dt: int, deceleration: int) -> None:
        before = self.velocity
        loss = max(deceleration * dt * FRACTION // SECOND, 1)
        if abs(before) <= loss:
            rest = dt * abs(before) // loss  # time until it stands
            self.position += before * rest // (2 * SECOND)
            self.velocity = 0
            self.phase = Phase.HOLD
            return
        self.velocity = before - loss if before > 0 else before + loss
        self.position += (before + self.velocity) * dt // (2 * SECOND)

    def _run(self, dt: int) -> None:
        before = self.velocity
        change = max(self.acceleration * dt * FRACTION // SECOND, 1)
        self.velocity = min(max(self.goal, before - change), before + change)
        self.position += (before + self.velocity) * dt // (2 * SECOND)
