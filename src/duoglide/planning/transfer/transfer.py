"""Get from one rest pose to another: quickest in carriage space, checked as the path it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import ruckig
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_triples
from duoglide.errors import DuoglideError, InputError, LimitError, PathError, UnreachableError
from duoglide.kinematics.headroom.room import TOUCHING, locate, room
from duoglide.kinematics.home import home_position
from duoglide.kinematics.model import inverse
from duoglide.machine import Machine
from duoglide.motion.motion import Motion
from duoglide.motion.path.path import Path
from duoglide.motion.path.segments import show
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import Profile
from duoglide.motion.timing_report import TimingMethod, TimingReport
from duoglide.planning.braking.make_safe import Replan, make_brake_safe
from duoglide.planning.force_limits import slow_to_force
from duoglide.planning.stops.certificate import certify_stops
from duoglide.planning.tolerances import PICOMETRE
from duoglide.planning.trajectory import Trajectory
from duoglide.planning.transfer.certificate import certify
from duoglide.planning.transfer.rest_to_rest import plan_rest_to_rest

_SAME_POSE = 1e-5  # mm, between a position and what its own carriages give
_SPEEDS = 1001  # places at which the speeds of a transfer are looked at
_STILL = 1e-3  # of its limit: as slow as that a carriage may be that hardly moves
HOME_TOLERANCE = 10.0  # mm, at the deep pose on the way round


def transfer(
    machine: Machine, start: ArrayLike, goal: ArrayLike, *, brake_safe: bool = True
) -> Trajectory:
    """Move from rest to rest between two positions, by any way that is safe.

    First the quickest motion of the carriages (ruckig, straight in carriage space where the limits
    let it), checked as the path that the platform really takes; where that is not admissible, the
    straight line; then the way round by the home position.

    Args:
        machine: The machine; its ``limits`` bound the motion.
        start: Platform centre O' at the start, in the base frame [mm], shape (3,).
        goal: Platform centre O' at the end, in the base frame [mm], shape (3,).
        brake_safe: Slow the motion where drives that brake by themselves would leave reach or
            clearance.

    Raises:
        InputError: Not two positions.
        PathError: An end is not admissible, or none of the ways is; says why for each.
    """
    here, there = (
        _require_position(value, name) for value, name in ((start, "start"), (goal, "goal"))
    )
    carriages = _require_room(machine, here, "start"), _require_room(machine, there, "goal")
    try:
        return _go_direct(machine, *carriages, brake_safe)
    except (PathError, LimitError) as error:
        first = error
    refused = [f"through carriage space: {first}"]
    for way, path in _list_ways_round(machine, here, there):
        try:
            return _plan_round(machine, path, brake_safe)
        except DuoglideError as error:
            refused.append(f"{way}: {error}")
    reasons = "\n  ".join(refused)
    raise PathError(
        f"no safe transfer from {show(here)} to {show(there)} mm:\n  {reasons}",
        arc_length=getattr(first, "arc_length", float("nan")),
        position=getattr(first, "position", ()),
        quantity=getattr(first, "quantity", ""),
        amount=getattr(first, "amount", float("nan")),
    ) from first


def transfer_carriages(
    machine: Machine, start: FloatArray, goal: FloatArray, *, brake_safe: bool = True
) -> Trajectory:
    """Do what the first way of ``transfer`` does, from carriages to carriages [mm], (3,) each.

    Raises:
        PathError: The way is not admissible.
        LimitError: Ruckig finds no motion.
    """
    return _go_direct(machine, start, goal, brake_safe)


def _require_position(value: ArrayLike, name: str) -> FloatArray:
    position = as_triples(value, name)
    if position.shape != (3,):
        raise InputError(f"{name} must have shape (3,), got {position.shape}")
    return position


def _go_direct(
    machine: Machine, start: FloatArray, goal: FloatArray, brake_safe: bool
) -> Trajectory:
    """Go by the carriages' own motion, straight if possible, else as ruckig has it."""
    if np.abs(goal - start).max() <= PICOMETRE:
        return _stay(machine, start)
    first: PathError | None = None
    tried: FloatArray | None = None
    for sync in (ruckig.Synchronization.Phase, ruckig.Synchronization.Time):
        breaks, table = plan_rest_to_rest(start, goal, machine.limits, sync)
        if tried is not None and tried.shape == table.shape and np.allclose(tried, table):
            continue  # they are the same where the limits let nothing go straight
        tried = table
        try:
            least = certify(machine, TransferPath(machine, breaks, table, 0.0))
        except PathError as error:
            first = first or error
            continue
        draft = _time(TransferPath(machine, breaks, table, least))
        if brake_safe:
            draft = make_brake_safe(draft, replan=_slower(draft, (start, goal), sync))
        return Trajectory.of(draft, certify_stops(draft))
    assert first is not None
    raise first


def _stay(machine: Machine, carriages: FloatArray) -> Trajectory:
    """Return a motion that goes nowhere, for one cycle."""
    table = np.zeros((1, 4, 3))
    table[0, 0] = carriages
    cycle = machine.drives.cycle
    clearance = float(room(machine, carriages[None]).clearance[0]) + machine.clearance
    motion = _time(TransferPath(machine, np.array([0.0, cycle]), table, clearance))
    return Trajectory.of(motion, certify_stops(motion))


def _time(path: TransferPath) -> Motion:
    """Return the motion that a transfer is, with its own time where there is the force for it."""
    report = TimingReport(method=TimingMethod.TRANSFER)
    return slow_to_force(Motion(path, Profile.steady(path.duration), report=report))


def _slower(
    draft: Motion, ends: tuple[FloatArray, FloatArray], sync: ruckig.Synchronization
) -> Replan:
    """Return what plans a transfer again at a share of its speeds."""
    machine = draft.machine
    speeds = np.abs(draft.at(np.linspace(0.0, draft.duration, _SPEEDS)).velocity).max(axis=0)

    def replan(share: float) -> Motion:
        most = np.maximum(share * speeds, share * _STILL * machine.limits.velocity)
        limits = replace(machine.limits, velocity=np.minimum(machine.limits.velocity, most))
        breaks, table = plan_rest_to_rest(*ends, limits, sync)
        least = certify(machine, TransferPath(machine, breaks, table, 0.0))
        return _time(TransferPath(machine, breaks, table, least))

    return replan


def _plan_round(machine: Machine, path: Path, brake_safe: bool) -> Trajectory:
    from duoglide.planning.plan import plan

    return plan(machine, path, brake_safe=brake_safe)


def _list_ways_round(
    machine: Machine, start: FloatArray, goal: FloatArray
) -> list[tuple[str, Path]]:
    """List the ways to try along programmed paths, which lie in the work frame."""
    shift = np.array(machine.tool_offset) - np.array(machine.work_frame)
    a, b = start + shift, goal + shift
    ways = [("straight", Path.line(a, b))]
    home = home_position(machine)
    if min(np.linalg.norm(home - start), np.linalg.norm(home - goal)) > 1.0:
        way = Path.polyline([a, home + shift, b], tolerance=HOME_TOLERANCE)
        ways.append(("by the home position", way))
    return ways


def _require_room(machine: Machine, position: FloatArray, name: str) -> FloatArray:
    """Return the carriages of an admissible position, or say why it is none."""
    try:
        carriages = inverse(machine.geometry, position)
    except UnreachableError as error:
        raise PathError(
            f"{name}: {error}", position=position.tolist(), quantity="reach", amount=error.shortfall
        ) from error
    found, closed = locate(machine, carriages[None])
    here = room(machine, carriages[None])
    _, quantity, amount = here.worst()
    problem = ""
    if not closed[0] or np.linalg.norm(found[0] - position) > _SAME_POSE:
        problem = "it lies on or beyond a singularity, in another assembly mode"
        quantity, amount = "clearance", -machine.clearance
    elif amount <= TOUCHING:
        problem = f"{quantity} is {-amount:.6g} mm too small"
    if problem:
        raise PathError(
            f"{name} {show(position)} mm is not admissible: {problem}",
            arc_length=0.0,
            position=position.tolist(),
            quantity=quantity,
            amount=-amount,
        )
    return carriages
