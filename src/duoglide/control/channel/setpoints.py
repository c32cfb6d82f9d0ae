"""A trajectory prepared for the stream: every setpoint of the nominal grid, and what they keep to.

The host prepares it once, outside the cycle (``host.run.prepare``). What reaches the streamer has
passed every rule; the streamer applies the same ``Fence`` again to each setpoint that it sends,
because an override takes path times that no grid foresaw.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.control.channel.scale import IntTriple, Scales, as_int_triple
from duoglide.motion.path.actions import SetOutput, WaitInput
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from duoglide.machine import Machine
    from duoglide.motion.led_stops import LedStops
    from duoglide.motion.stop_bounds import StopBounds
    from duoglide.planning.trajectory import Trajectory

_STEP_RESERVE = 1.001  # audits allow a thousandth


@dataclass(frozen=True, slots=True)
class Fence:
    """What no setpoint may leave, in increments, so that the cycle compares whole numbers.

    Attributes:
        low: Least position of each axis.
        high: Greatest position of each axis.
        step: Greatest change in one cycle.
        scales: Between carriages [mm] and increments.
        gap: Distance that carriages 1 and 2 keep [mm].
        cycle: Between two setpoints [s].
    """

    low: IntTriple
    high: IntTriple
    step: IntTriple
    scales: Scales
    gap: float
    cycle: float

    @classmethod
    def of(cls, machine: Machine) -> Fence:
        """Return the fence of a machine: its travel, carriage width and stop limits."""
        scales = Scales.of(machine.drives)
        travel = machine.geometry.rail_half_length
        ends = np.sort(scales.increments(np.array([[-travel] * AXES, [travel] * AXES])), axis=0)
        way = machine.stop_limits.velocity * machine.drives.cycle * _STEP_RESERVE
        steps = np.abs(scales.increments(way)) + 1
        return cls(
            low=as_int_triple(ends[0]),
            high=as_int_triple(ends[1]),
            step=as_int_triple(steps),
            scales=scales,
            gap=machine.carriage_width,
            cycle=machine.drives.cycle,
        )

    def extend_to(self, carriages: FloatArray) -> Fence:
        """Return the fence moved out to where the carriages stand [mm], shape (3,)."""
        here = self.scales.triple(carriages)
        return replace(
            self,
            low=as_int_triple(np.minimum(self.low, here)),
            high=as_int_triple(np.maximum(self.high, here)),
            gap=min(self.gap, float(carriages[1] - carriages[0])),
        )

    def refuses(self, target: IntTriple, previous: IntTriple, cycles: int = 1) -> int:
        """Return the axis whose target breaks a rule, 1 to 3; 0 where none does.

        Args:
            target: Setpoint about to be sent [increments].
            previous: Setpoint sent last.
            cycles: How many cycles lie between them.
        """
        for axis in range(AXES):
            value = target[axis]
            if not self.low[axis] <= value <= self.high[axis]:
                return axis + 1
            if abs(value - previous[axis]) > self.step[axis] * cycles:
                return axis + 1
        first, second, _ = self.scales.mm(target)
        return 2 if second - first < self.gap - self.scales.resolution else 0


@dataclass(frozen=True, slots=True)
class Stretch:
    """The setpoints between two waits, on their own grid of whole cycles.

    Attributes:
        start: Path time [s].
        end: Path time [s].
        grid: Setpoints at ``start + k * cycle``, the last at ``end`` [increments], (n, 3).
        wait: What to wait for at ``end``; None at the end of the trajectory.
        margins: How far from its place each carriage may be at each of them [mm]; (n,) or none.
    """

    start: float
    end: float
    grid: tuple[IntTriple, ...]
    wait: WaitInput | None
    margins: tuple[float, ...] = ()

    def margin(self, place: float) -> float:
        """Return what is left for the carriages at a place of the grid, such as 7.5 [mm].

        Args:
            place: How many cycles after ``start``.
        """
        if not self.margins:
            return math.inf
        last = len(self.margins) - 1
        low = min(int(place), last)
        return min(self.margins[low], self.margins[min(low + 1, last)])


class TimedOutput(NamedTuple):
    """An output, and the path time [s] at which it is set."""

    time: float
    output: SetOutput


@dataclass(frozen=True, slots=True)
class PreparedSetpoints:
    """A trajectory with what the cycle needs to stream it.

    Attributes:
        number: Which of this streamer, from 1.
        phase: Approach or program.
        trajectory: For path times off the grid; it goes on to rest, whatever comes after it.
        stretches: In order.
        outputs: In order.
        fence: What no setpoint may leave.
        led: Where a drive may lead a stop; None for nowhere.
        after: Number of the setpoints that these go on from; 0: a run begins with them.
        seam: Path time at which the next ones may take over in motion [s]; None: where these have
            come to rest.
        lead_in: Path time that the ones before have made at the seam where these take over in
            motion [s]; 0: these begin at rest.
        pace: How the path rate may change, from ``lead_in`` before these begin up to their rest, so
            that a change may begin before the seam and end after it; None: as the trajectory says,
            which begins at rest.
        passing: Whether others are made where these come too late for their seam; else they are
            gone on with from the rest that the ones before have come to.
    """

    number: int
    phase: Phase
    trajectory: Trajectory
    stretches: tuple[Stretch, ...]
    outputs: tuple[TimedOutput, ...]
    fence: Fence
    led: LedStops | None = None
    after: int = 0
    seam: float | None = None
    lead_in: float = 0.0
    pace: StopBounds | None = None
    passing: bool = False

    @property
    def bounds(self) -> StopBounds:
        """How the path rate may change, from ``lead_in`` before the start on."""
        return self.pace or self.trajectory.stops

    @property
    def cycle(self) -> float:
        """Between two setpoints [s]."""
        return self.fence.cycle

    @property
    def first(self) -> IntTriple:
        """The setpoint at the start [increments]."""
        return self.stretches[0].grid[0]

    def at(self, u: float) -> IntTriple:
        """Return the setpoint at path time ``u`` [increments]."""
        return self.fence.scales.triple(self.trajectory.at(u).carriages)
