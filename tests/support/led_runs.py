"""Runs along a path in which a drive fails, by a clock that is a counter, against plants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from cell_by_hand import CellByHand

import duoglide as dg
from duoglide.control.channel.events import Condition, Happening
from duoglide.control.host.run.prepare import margin_of
from duoglide.drives.simulation.faults import DeviceFault
from duoglide.drives.simulation.plant import PlantParameters
from duoglide.motion.led_stops import LedStops
from duoglide.planning.braking.led import led_stops

FIVE_LINES = (
    (0.0, -120.0, 300.0),
    (60.0, -60.0, 330.0),
    (-60.0, -10.0, 320.0),
    (-41.0, 60.0, 280.0),
    (50.0, 110.0, 340.0),
    (0.0, 150.0, 300.0),
)


def fail(cell: CellByHand, axis: int) -> None:
    """Let a drive report a fault, now, as real ones do: by a message at once."""
    DeviceFault(axis).apply(cell.rack.nodes[axis - 1])


@dataclass
class LedRuns:
    """Runs of one plan; each begins in a cell of its own.

    Attributes:
        plan: What runs.
        stops: Where a drive may lead the others; None: nowhere.
        plants: What hangs on the drives.
    """

    plan: dg.Trajectory
    stops: LedStops | None
    plants: Sequence[PlantParameters] | None = None

    @classmethod
    def of(cls, plan: dg.Trajectory) -> LedRuns:
        """Return the runs of a plan, with what it promises."""
        return cls(plan, led_stops(plan))

    def until(self, cycle: int, override: float = 1.0) -> CellByHand:
        """Return a cell in which the drives have come to this cycle of the plan."""
        cell = CellByHand(self.plan.machine, self.plan.start, self.plants).enable()
        margin_at = margin_of(self.plan, self.plan.machine)
        cell.run(self.plan, margin_at, override, self.stops)
        cell.cycles(cycle + 2)  # the newest setpoint is reached two cycles later
        return cell

    def promised(self, axis: int) -> list[int]:
        """Return the cycles in which a drive may fail with the platform within a millimetre."""
        assert self.stops is not None
        return [k for k, mask in enumerate(self.stops.promised) if mask >> (axis - 1) & 1]

    def allowed(self, axis: int) -> list[int]:
        """Return the cycles in which a drive may lead."""
        assert self.stops is not None
        return [k for k, mask in enumerate(self.stops.allowed) if mask >> (axis - 1) & 1]

    def off_path(
        self, cell: CellByHand, cycles: int = 90, each: Callable[[int], object] | None = None
    ) -> float:
        """Let time pass; return how far the platform leaves its path [mm], inf where links part.

        Args:
            cell: In which a drive has failed just now.
            cycles: Until all stand.
            each: Is called before each cycle with its number, from 0.
        """
        places = []
        for number in range(cycles):
            if each is not None:
                each(number)
            cell.cycles(1)
            places.append(cell.carriages)
        path = self.plan.position_at(np.linspace(0.0, self.plan.duration, 20_000))
        try:
            platform = dg.forward(self.plan.machine.geometry, np.array(places))
        except dg.UnreachableError:
            return float("inf")
        return max(float(np.linalg.norm(path - p, axis=1).min()) for p in platform)


def by_themselves(cell: CellByHand) -> bool:
    """Whether a run has ended with drives that brake each by itself."""
    (stopped,) = cell.happened(Happening.STOPPED)
    return bool(stopped.code)


def given_up(cell: CellByHand) -> bool:
    """Whether a drive led, and could not be followed any more."""
    return any(condition is Condition.UNLED for condition, _ in cell.tripped())
