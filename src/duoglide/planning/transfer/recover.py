"""Back out of where the machine must not stand: from a fault to a legal pose.

A carriage may have run past its travel, or the platform into the neighbourhood of a singularity.
The way out is found in carriage space, leg by leg, each straight from rest to rest at creep speed.
Travel and carriage order are concave along such a leg; clearance is looked at, and bounded between
the places where it is. What is too small gets no smaller than at the start of a leg, and what is
large enough stays so.
"""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import ruckig
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_number, as_triples
from duoglide.errors import InputError, PathError, SingularityError
from duoglide.kinematics.headroom.room import TOUCHING, locate, room
from duoglide.kinematics.home import home_carriages
from duoglide.kinematics.model import inverse, reachable
from duoglide.kinematics.singularity.margins import clearance_gradient
from duoglide.machine import CarriageLimits, Machine
from duoglide.motion.motion import Motion
from duoglide.motion.path.segments import show
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import Profile
from duoglide.motion.timing_report import TimingMethod, TimingReport
from duoglide.planning.compare import first_least
from duoglide.planning.stops.certificate import certify_stops
from duoglide.planning.trajectory import Trajectory
from duoglide.planning.transfer.certificate import keeps
from duoglide.planning.transfer.rest_to_rest import plan_rest_to_rest

CREEP = 20.0  # mm/s
RESERVE = 1.0  # mm that the way out ends beyond every bound, if there is so much


class _WayOut(NamedTuple):
    """How a way out is looked for.

    Attributes:
        samples: Places in which each leg of the way is looked at.
        legs: Of the way, at most.
        looks: Times that a direction is improved.
        steps: Straight away from a surface, tried in turn [mm].
        loss: Within which a clearance is known [mm].
        apart: What counts as the margin where the links do not close [mm].
        ramp: Time to creep speed, at the least [s].
    """

    samples: int = 400
    legs: int = 12
    looks: int = 3
    steps: tuple[float, ...] = (0.5, 2.0, 8.0, 32.0)
    loss: float = 2e-6
    apart: float = -1e6
    ramp: float = 0.2


_WAY = _WayOut()


def recover(machine: Machine, carriages: ArrayLike, speed: float = CREEP) -> Trajectory:
    """Plan the way from where the carriages stand to a pose that the machine may work from.

    Args:
        machine: The machine.
        carriages: Where the drives say that they are, at rest [mm], shape (3,).
        speed: Largest velocity of a carriage [mm/s].

    Returns:
        A motion at creep speed along which no margin that is too small decreases. Where nothing is
        wrong, it stays where it is.

    Raises:
        InputError: Not three finite numbers, or a speed that is not above zero.
        PathError: The links do not close there, so that where the platform is cannot be told; or
            no way out is found.
    """
    start = as_triples(carriages, "carriages", "(carriage 1, 2, 3)")
    if start.shape != (3,):
        raise InputError(f"carriages must have shape (3,), got {start.shape}")
    creep = as_number(speed, "speed")
    if creep <= 0.0:
        raise InputError(f"speed = {creep:g} mm/s: must be above zero")
    if not locate(machine, start[None])[1][0]:
        raise PathError(
            f"carriages at {show(start)} mm: on or beyond a singularity, where they do not tell"
            " where the platform is; move it by hand",
            quantity="reach",
        )
    corners = [start]
    while not _is_legal(machine, corners[-1]):
        if len(corners) > _WAY.legs:
            raise _refuse_way(machine, start)
        corners.append(_find_next_corner(machine, corners[-1]))
    return _join_corners(machine, corners, creep)


def _is_legal(machine: Machine, carriages: FloatArray) -> bool:
    return bool(room(machine, carriages[None]).least()[0] > TOUCHING)


def _find_next_corner(machine: Machine, here: FloatArray) -> FloatArray:
    """Return where the best leg from ``here`` ends: legal if one is, else as far as it is good."""
    best, gain = here, 0.0
    before = float(room(machine, here[None]).least()[0])
    for target in _list_targets(machine, here):
        end, margin = _find_way_toward(machine, here, target)
        better = margin > 0.0 >= before + gain or margin - before > gain + _WAY.loss
        if better and _is_certain(machine, here, end):
            best, gain = end, margin - before
            if margin > 0.0:
                break
    if gain <= _WAY.loss:
        raise _refuse_way(machine, here)
    return best


def _list_targets(machine: Machine, here: FloatArray) -> list[FloatArray]:
    """List where legs may lead: along the rails, straight away from the surface, home."""
    g = machine.geometry
    over = np.maximum(np.abs(here) + RESERVE - g.rail_half_length, 0.0) * np.sign(here)
    targets = [here - over.sum()] if np.any(over) else []
    position = locate(machine, here[None])[0][0]
    try:
        away = clearance_gradient(g, position)
    except SingularityError:
        return [*targets, home_carriages(machine)]
    points = position + np.array(_WAY.steps)[:, None] * away
    return [*targets, *inverse(g, points[reachable(g, points)]), home_carriages(machine)]


def _find_way_toward(
    machine: Machine, start: FloatArray, target: FloatArray
) -> tuple[FloatArray, float]:
    """Do what ``_measure_good_part`` does, ever more finely, until its answer stays."""
    end, margin = _measure_good_part(machine, start, target)
    for _ in range(_WAY.looks):
        before = end
        end, margin = _measure_good_part(machine, start, before)
        if np.array_equal(end, before):
            break
    return end, margin


def _measure_good_part(
    machine: Machine, start: FloatArray, target: FloatArray
) -> tuple[FloatArray, float]:
    """Return how far toward ``target`` one may go, and the least margin there.

    A leg is good as long as no margin falls that is too small, and none becomes too small. It ends
    as soon as everything has its reserve.
    """
    shares = np.linspace(0.0, 1.0, _WAY.samples + 1)[:, None]
    places = start + shares * (target - start)
    here = room(machine, places)
    margins = np.stack([getattr(here, field.name) for field in fields(here)])
    kept = np.clip(margins, _WAY.apart, RESERVE)
    lost = np.maximum.accumulate(kept, axis=1) - kept > _WAY.loss
    bad = np.any(lost & ((kept < kept[:, :1]) | (margins <= _WAY.loss)), axis=0)
    end = int(np.argmax(bad)) - 1 if bad.any() else _WAY.samples
    least = kept.min(axis=0)[: end + 1]
    full = np.flatnonzero(least >= RESERVE - _WAY.loss)
    stop = int(full[0]) if full.size else int(first_least(-least, within=_WAY.loss))
    return places[stop], float(least[stop])


def _is_certain(machine: Machine, start: FloatArray, end: FloatArray) -> bool:
    """Whether nothing between the samples of a leg is worse than its start, or too small."""
    here = room(machine, start[None])
    clear, apart, free = (
        min(float(value[0]), 0.0) - _WAY.loss
        for value in (here.clearance, here.keep_out, here.carriage_margin)
    )
    return keeps(machine, start, end, (clear, apart, free))


def _join_corners(machine: Machine, corners: list[FloatArray], speed: float) -> Trajectory:
    """Go from corner to corner, at rest in each."""
    limits = CarriageLimits(
        velocity=np.minimum(machine.limits.velocity, speed),
        acceleration=np.minimum(machine.limits.acceleration, speed / _WAY.ramp),
        jerk=np.minimum(machine.limits.jerk, 4.0 * speed / _WAY.ramp**2),
    )
    breaks, tables = [np.zeros(1)], []
    for start, end in pairwise(corners):
        times, table = plan_rest_to_rest(start, end, limits, ruckig.Synchronization.Phase)
        breaks.append(breaks[-1][-1] + times[1:])
        tables.append(table)
    if not tables:
        still = np.zeros((1, 4, 3))
        still[0, 0] = corners[0]
        breaks, tables = [np.array([0.0, machine.drives.cycle])], [still]
    least = float(room(machine, np.array(corners)).clearance.min()) + machine.clearance
    path = TransferPath(machine, np.concatenate(breaks), np.concatenate(tables), least)
    report = TimingReport(method=TimingMethod.TRANSFER, reason="recovery at creep speed")
    motion = Motion(path, Profile.steady(path.duration), report=report)
    return Trajectory.of(motion, certify_stops(motion))


def _refuse_way(machine: Machine, here: FloatArray) -> PathError:
    _, quantity, amount = room(machine, here[None]).worst()
    return PathError(
        f"no way out of carriages at {show(here)} mm on which {quantity}, {-amount:.6g} mm too"
        " small, does not get smaller; move it by hand",
        quantity=quantity,
        amount=-amount,
    )
