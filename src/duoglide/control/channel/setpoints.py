"""A trajectory made ready to stream: every setpoint of the nominal grid computed and validated.

Done once, outside the cycle, by the process that wants the motion. What reaches the streamer has
passed every rule; the streamer applies the same ``Fence`` again to each setpoint that it sends,
because an override takes path times that no grid foresaw.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import AXES, FloatArray
from duoglide.control.channel.scale import IntTriple, Scales
from duoglide.errors import LimitError
from duoglide.motion.actions import SetOutput, WaitInput
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from duoglide.machine import Machine
    from duoglide.motion.stopping import StopBounds
    from duoglide.motion.trajectory import Trajectory

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
            low=_triple(ends[0]),
            high=_triple(ends[1]),
            step=_triple(steps),
            scales=scales,
            gap=machine.carriage_width,
            cycle=machine.drives.cycle,
        )

    def reaching(self, carriages: FloatArray) -> Fence:
        """Return the fence moved out to where the carriages stand [mm], shape (3,)."""
        here = self.scales.triple(carriages)
        return replace(
            self,
            low=_triple(np.minimum(self.low, here)),
            high=_triple(np.maximum(self.high, here)),
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
class Leg:
    """A part of a program between two waits, on its own grid of whole cycles.

    Attributes:
        start: Path time [s].
        end: Path time [s].
        grid: Setpoints at ``start + k * cycle``, the last at ``end`` [increments], (n, 3).
        wait: What to wait for at ``end``; None at the end of the program.
    """

    start: float
    end: float
    grid: tuple[IntTriple, ...]
    wait: WaitInput | None


@dataclass(frozen=True, slots=True)
class Program:
    """A validated trajectory with what the cycle needs to run it.

    Attributes:
        number: Which run of this streamer, from 1.
        phase: Approach or program.
        trajectory: For path times off the grid.
        bounds: How the path rate may change.
        legs: In order.
        outputs: Path time [s] and what to switch there, in order.
        fence: What no setpoint may leave.
    """

    number: int
    phase: Phase
    trajectory: Trajectory
    bounds: StopBounds
    legs: tuple[Leg, ...]
    outputs: tuple[tuple[float, SetOutput], ...]
    fence: Fence

    @property
    def cycle(self) -> float:
        """Between two setpoints [s]."""
        return self.fence.cycle

    @property
    def first(self) -> IntTriple:
        """The setpoint at the start [increments]."""
        return self.legs[0].grid[0]

    def setpoint(self, u: float) -> IntTriple:
        """Return the setpoint at path time ``u`` [increments]."""
        return self.fence.scales.triple(self.trajectory.at(u).carriages)


def prepare(trajectory: Trajectory, fence: Fence, number: int, phase: Phase) -> Program:
    """Compute and validate every setpoint of the nominal grid.

    Raises:
        LimitError: A setpoint leaves the travel, brings carriages 1 and 2 too close, or is too far
            from the one before; names the axis and the path time.
    """
    waits = [(t, a) for t, a in trajectory.actions if isinstance(a, WaitInput)]
    outputs = tuple((t, a) for t, a in trajectory.actions if isinstance(a, SetOutput))
    ends: list[tuple[float, WaitInput | None]] = [*waits, (trajectory.duration, None)]
    starts = [0.0, *(t for t, _ in waits)]
    cycle = fence.cycle
    legs = []
    for start, (end, wait) in zip(starts, ends, strict=True):
        times = grid_times(start, end, cycle)
        grid = fence.scales.increments(trajectory.at(times).carriages)
        _validate(grid, times, fence)
        legs.append(Leg(start, end, tuple(map(_triple, grid)), wait))
    for before, after in pairwise(legs):
        _validate(np.array([before.grid[-1], after.grid[0]]), np.array([before.end] * 2), fence)
    return Program(number, phase, trajectory, trajectory.stops, tuple(legs), outputs, fence)


def grid_times(start: float, end: float, cycle: float) -> FloatArray:
    """Return ``start + k * cycle`` up to ``end``, which is the last; at least one time."""
    count = max(int(np.ceil((end - start) / cycle * (1.0 - 1e-12))), 0)
    times: FloatArray = np.minimum(start + np.arange(count + 1) * cycle, end)
    times[-1] = end
    return times


def _validate(grid: NDArray[np.int64], times: FloatArray, fence: Fence) -> None:
    previous = _triple(grid[0])
    for row, time in zip(grid, times, strict=True):
        target = _triple(row)
        axis = fence.refuses(target, previous)
        if axis:
            mm = [round(value, 4) for value in fence.scales.mm(target)]
            before = fence.scales.mm(previous)[axis - 1]
            raise LimitError(
                f"setpoint of carriage {axis} at {time:.4f} s is refused: carriages {mm} mm, the"
                f" setpoint before it {before:.4f} mm; travel, the carriages' distance of"
                f" {fence.gap:g} mm, or the greatest step in one cycle is broken"
            )
        previous = target


def _triple(row: NDArray[np.int64]) -> IntTriple:
    first, second, third = row.tolist()
    return first, second, third
