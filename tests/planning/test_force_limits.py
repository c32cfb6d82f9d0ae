"""Limits in newtons: of plans, holds, stops, brakes and transfers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, sqrt
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.forces import forward_rates
from duoglide.motion.path.carriage import map_to_carriages
from duoglide.motion.path_clock import ClockState, PathClock
from duoglide.planning.timing.span import Effort
from duoglide.planning.timing.time_path import time_path

PICK = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0, 4.0)
MASSES = dg.Masses(payload=0.3)
BEND = dg.Path.through([(-60.0, -80, 290), (-30.0, -20, 300), (-50.0, 40, 285), (-41.0, 90, 290)])


def limited(masses: dg.Masses = MASSES, **limits: Any) -> dg.Machine:
    return dg.Machine(limits=dg.CarriageLimits(**limits), masses=masses)


def quick(machine: dg.Machine, path: dg.Path = PICK, timing: str | None = None) -> dg.Trajectory:
    return dg.plan(machine, path, brake_safe=False, timing=timing)


@pytest.mark.parametrize("timing", ["near-optimal", "toppra", "ruckig"])
@pytest.mark.parametrize(
    ("jerk", "masses"),
    [
        (3e6, MASSES),
        (inf, replace(MASSES, gravity=(2000.0, 4000.0, 9000.0), coulomb_friction=(6.0, 1.0, 4.0))),
    ],
    ids=["standing", "hanging without a jerk limit"],
)
def test_every_timing_keeps_each_carriage_s_force(
    timing: str, jerk: float, masses: dg.Masses
) -> None:
    force = np.array([34.0, 45.0, 38.0])
    for path in (PICK, BEND):
        plan = quick(limited(masses, force=force, jerk=jerk), path, timing)
        used = np.abs(plan.forces(np.linspace(0.0, plan.duration, 30001))) / force
        audit = plan.audit()
        assert used.max() <= 1.0005
        assert audit.force == pytest.approx(used.max(axis=0), abs=2e-3)
        assert audit.worst <= 1.0005
        if timing != "ruckig":
            assert audit.force.max() > 0.995
            assert "force" in audit.explain()
            assert "force: worst use" in str(audit)


def test_a_line_along_the_rails_is_as_quick_as_its_forces_let_it_be() -> None:
    """All carriages move alike there: as quick as can be, then as slow, each with its own mass."""
    machine = limited(dg.Masses(payload=0.8, viscous_friction=(0.0,) * 3), force=25.0, jerk=inf)
    start = np.array([-41.0, -60.0, 300.0])
    along = np.array([0.0, 1.0, 0.0])
    bare = replace(machine, masses=replace(machine.masses, coulomb_friction=(0.0,) * 3))
    held = dg.carriage_forces(bare, start, 0.0 * along, 0.0 * along)
    mass = dg.carriage_forces(bare, start, 0.0 * along, along) - held  # N per mm/s^2
    dry = np.array(machine.masses.coulomb_friction)
    speeding = ((25.0 - held - dry) / mass).min()
    slowing = ((25.0 + held + dry) / mass).min()
    way = 120.0
    fastest = sqrt(2.0 * way * speeding * slowing / (speeding + slowing))
    expected = fastest / speeding + fastest / slowing
    assert fastest < machine.limits.velocity[0]
    plan = quick(machine, dg.Path.line(start, start + way * along))
    assert expected * (1.0 - 1e-6) < plan.duration < 1.002 * expected


def test_a_plan_is_within_a_hundredth_of_one_on_a_fine_grid() -> None:
    for force, path in ((40.0, PICK), (22.0, PICK), (30.0, BEND)):
        machine = limited(force=force)
        carriages = map_to_carriages(dg.check_path(machine, path))
        usual = time_path(carriages)
        fine = time_path(carriages, Effort(cells=300, coarse=64, per_piece=12, refine=1))
        assert usual.report.reason == ""
        assert usual.duration < 1.01 * fine.duration


def test_more_force_never_takes_longer_and_enough_of_it_changes_nothing() -> None:
    free = quick(limited())
    last = inf
    for force in (15.0, 25.0, 40.0, 62.0, 1e4):
        plan = quick(limited(force=force))
        assert plan.duration <= 1.001 * last
        last = plan.duration
    assert last == pytest.approx(free.duration, rel=1e-4)
    assert quick(limited(replace(MASSES, payload=1.0), force=40.0)).duration > 1.05 * free.duration


def test_a_pose_that_cannot_be_held_is_refused_with_the_force_that_would_do() -> None:
    machine = limited(force=6.0)
    ends = (-41.0, -100.0, 295.0), (-41.0, 100.0, 295.0)
    ways: list[Callable[[], Any]] = [lambda: quick(machine), lambda: dg.transfer(machine, *ends)]
    for asked in ways:
        with pytest.raises(
            dg.PathError, match=r"needs 7\.\d+ N to hold .* limits\.force is 6 N"
        ) as found:
            asked()
        assert found.value.quantity == "force"
    enough = float(str(found.value).rpartition(": ")[2].split(" N")[0])
    quick(limited(force=1.001 * enough))


@pytest.mark.parametrize("rms", [25.0, 10.0])
def test_the_rms_force_is_kept_and_used_up(rms: float) -> None:
    plan = quick(limited(rms_force=rms))
    used = plan.demand().rms_force.max() / rms
    assert 0.985 < used <= 1.0 + 1e-6
    rested = quick(limited(rms_force=rms), PICK.at(3, dg.Dwell(0.2)))
    assert rested.duration - 0.2 < 0.97 * plan.duration  # a rest cools the motors
    with pytest.raises(dg.PathError, match=r"holding the platform .* of limits\.rms_force"):
        quick(limited(rms_force=3.0))


def test_drives_without_the_force_to_brake_as_told_are_named() -> None:
    machine = limited(force=35.0)
    with pytest.raises(dg.LimitError, match=r"carriage \d would need .* N to brake by itself"):
        dg.plan(machine, PICK)
    gentle = replace(machine, drives=dg.DriveSettings(quick_stop_deceleration=(12e3,) * 3))
    plan = dg.plan(gentle, PICK)
    assert plan.report.brake_safe
    heavy = replace(gentle, masses=replace(MASSES, payload=0.9))
    with pytest.raises(dg.LimitError, match=r"stop_limits\.force is 52\.5 N"):
        dg.plan(replace(heavy, limits=dg.CarriageLimits(force=35.0)), PICK)


def forces_of(machine: dg.Machine, carriages: np.ndarray, step: float) -> np.ndarray:
    """Forces by differences of the positions that are sent."""
    velocity = (carriages[2:] - carriages[:-2]) / (2.0 * step)
    acceleration = np.diff(carriages, 2, axis=0) / step**2
    return dg.carriage_forces(
        machine, *forward_rates(machine.geometry, carriages[1:-1], velocity, acceleration)
    )


def test_holds_at_any_time_keep_the_force_that_stops_may_use() -> None:
    machine = limited(force=30.0)
    assert machine.stop_limits.force.tolist() == [45.0] * 3
    plan = quick(machine)
    step = plan.duration / 1500
    worst = 0.0
    for at in range(60, 1500, 120):
        clock = PathClock(plan.stops, step)
        times = [clock.step(step)[0] for _ in range(at)]
        clock.hold()
        times += [clock.step(step)[0] for _ in range(600)]
        clock.resume()
        while clock.state is not ClockState.FINISHED:
            times.append(clock.step(step)[0])
        forces = forces_of(machine, plan.at(np.array(times)).carriages, step)
        worst = max(worst, float(np.abs(forces).max()))
    assert 30.0 < worst < 1.002 * 45.0


def test_a_transfer_is_slowed_until_it_keeps_the_forces() -> None:
    ends = (-41.0, -100.0, 295.0), (0.0, 100.0, 280.0)
    free = dg.transfer(limited(), *ends, brake_safe=False)
    slow = dg.transfer(limited(force=30.0), *ends, brake_safe=False)
    assert free.demand().peak_force.max() > 40.0
    assert 0.5 < slow.audit().force.max() <= 1.0005
    assert slow.duration > free.duration


def test_a_plan_of_a_lighter_machine_is_refused_for_a_heavier_one() -> None:
    plan = quick(limited(force=35.0))
    again = dg.Trajectory.from_document(plan.to_document())
    assert again.duration == plan.duration
    heavy = limited(replace(MASSES, payload=0.6), force=35.0)
    with pytest.raises(dg.LimitError, match=r"carriage \d would need .* limits\.force"):
        plan.certified_for(heavy)
