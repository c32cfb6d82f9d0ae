"""From a trajectory to what is streamed: the way to its start, and every setpoint beforehand."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from duoglide.control.channel.scale import as_int_triple
from duoglide.control.channel.setpoints import Fence, PreparedSetpoints, Stretch, TimedOutput
from duoglide.errors import LimitError, PathError
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.model import forward
from duoglide.motion.path.actions import SetOutput, WaitInput
from duoglide.planning.braking.led import led_stops
from duoglide.planning.stops.certificate import Handover, certify_stops
from duoglide.storage.records import Phase

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from duoglide.arrays import FloatArray
    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory

LEAST_DEVIATION = 0.2  # [mm] of a carriage from where its drive's model expects it
START_TOLERANCE = 0.05  # [mm] that a carriage may be away from the start of a run


def plan_approach(
    machine: Machine, held: FloatArray, trajectory: Trajectory, allowed: bool
) -> Trajectory | None:
    """Plan the approach to a trajectory's start; None where the machine is there.

    Args:
        machine: Which stands still.
        held: Where its setpoints hold the carriages [mm], shape (3,).
        trajectory: That shall run.
        allowed: Whether an approach was asked for.

    Raises:
        PathError: The machine is elsewhere and no approach was asked for, or there is no safe way.
    """
    away = np.abs(held - trajectory.at(0.0).carriages)
    if away.max() <= START_TOLERANCE:
        return None
    start = trajectory.position_at(0.0)
    here = forward(machine.geometry, held)
    if not allowed:
        axis = int(np.argmax(away)) + 1
        where, there = (", ".join(f"{v:.3f}" for v in place) for place in (here, start))
        raise PathError(
            f"the machine is not at the start: carriage {axis} is {away.max():.3f} mm away;"
            f" the platform is at ({where}), the start at ({there}) mm;"
            " ask for an approach (approach=True, --approach)",
            position=tuple(here.tolist()),
            quantity="start",
            amount=float(away.max()),
        )
    from duoglide.planning.transfer.transfer import transfer

    return transfer(machine, here, start)


def prepare(
    trajectory: Trajectory,
    fence: Fence,
    number: int,
    phase: Phase,
    margin_at: Callable[[FloatArray], FloatArray] | None = None,
) -> PreparedSetpoints:
    """Compute and validate every setpoint of the nominal grid.

    Args:
        trajectory: What to stream, to rest.
        fence: What no setpoint may leave.
        number: Of the setpoints, from 1.
        phase: Approach or program.
        margin_at: Returns what is left for the carriages at path times [s], shape (n,) [mm]; None
            where that does not bound how far they may be from their setpoints.

    Raises:
        LimitError: A setpoint leaves the travel, brings carriages 1 and 2 too close, or is too far
            from the one before; names the axis and the path time.
    """
    waits = [(t, a) for t, a in trajectory.actions if isinstance(a, WaitInput)]
    outputs = tuple(TimedOutput(t, a) for t, a in trajectory.actions if isinstance(a, SetOutput))
    ends: list[tuple[float, WaitInput | None]] = [*waits, (trajectory.duration, None)]
    starts = [0.0, *(t for t, _ in waits)]
    cycle = fence.cycle
    stretches = []
    for start, (end, wait) in zip(starts, ends, strict=True):
        times = divide_into_cycles(start, end, cycle)
        grid = fence.scales.increments(trajectory.at(times).carriages)
        _validate(grid, times, fence)
        margins = () if margin_at is None else tuple(margin_at(times).tolist())
        stretches.append(Stretch(start, end, tuple(map(as_int_triple, grid)), wait, margins))
    for before, after in pairwise(stretches):
        _validate(np.array([before.grid[-1], after.grid[0]]), np.array([before.end] * 2), fence)
    return PreparedSetpoints(number, phase, trajectory, tuple(stretches), outputs, fence)


def prepare_part(
    part: Trajectory, fence: Fence, number: int, before: Trajectory | None = None
) -> PreparedSetpoints:
    """Prepare what a run is made of: a trajectory to rest, or one part of a program.

    What is streamed is the way to rest, ``part.whole`` where it has one; the next part takes over
    where ``part`` ends.

    Args:
        part: What to stream, certified for the machine.
        fence: What no setpoint may leave.
        number: Of the setpoints, from 1.
        before: The part that it goes on from; None: it begins a run.

    Raises:
        LimitError: See ``prepare``.
        PathError: See ``margin_of``.
    """
    whole = part.whole or part
    prepared = prepare(whole, fence, number, Phase.PROGRAM, margin_of(whole, whole.machine))
    prepared = replace(
        prepared,
        led=led_stops(whole),
        after=number - 1 if before is not None else 0,
        seam=None if part.whole is None else part.duration,
    )
    if before is None or before.whole is None:
        return prepared
    pace = certify_stops(Handover(before, whole))
    return replace(prepared, lead_in=before.duration, pace=pace)


def margin_of(trajectory: Trajectory, machine: Machine) -> Callable[[FloatArray], FloatArray]:
    """Return what a trajectory leaves its carriages, by path time: what ``prepare`` takes.

    Raises:
        PathError: It leaves them less than a drive's model can tell, so that a carriage might get
            farther than that without being noticed.
    """
    least = trajectory.path.carriage_margin
    if least < LEAST_DEVIATION:
        raise PathError(
            f"the plan leaves the carriages {least:.4g} mm before links may part, and what drives"
            f" do can be told no better than to {LEAST_DEVIATION:g} mm; plan it for a machine"
            f" with carriage_margin = {LEAST_DEVIATION:g} or more",
            quantity="carriage_margin",
            amount=LEAST_DEVIATION - least,
        )

    def at(times: FloatArray) -> FloatArray:
        return carriage_margin(machine.geometry, trajectory.position_at(times))

    return at


def divide_into_cycles(start: float, end: float, cycle: float) -> FloatArray:
    """Return ``start + k * cycle`` up to ``end``, which is the last; at least one time."""
    count = max(int(np.ceil((end - start) / cycle * (1.0 - 1e-12))), 0)
    times: FloatArray = np.minimum(start + np.arange(count + 1) * cycle, end)
    times[-1] = end
    return times


def _validate(grid: NDArray[np.int64], times: FloatArray, fence: Fence) -> None:
    previous = as_int_triple(grid[0])
    for row, time in zip(grid, times, strict=True):
        target = as_int_triple(row)
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
