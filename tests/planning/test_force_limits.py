"""Limits in newtons: of plans, holds, stops, brakes and transfers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.forces import forward_rates
from duoglide.motion.path.carriage import map_to_carriages
from duoglide.motion.path_clock import ClockState, PathClock
from duoglide.planning.timing.span import Effort
from duoglide.planning.timing.time_path import time_path
from duoglide.playback.columns import columns_of
from duoglide.storage import read_log

PICK = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0, 4.0)
MASSES = dg.Masses(payload=0.3)
BEND = dg.Path.through([(-60.0, -80, 290), (-30.0, -20, 300), (-50.0, 40, 285), (-41.0, 90, 290)])


def limited(masses: dg.Masses = MASSES, **limits: Any) -> dg.Machine:
    return dg.Machine(limits=dg.CarriageLimits(**limits), masses=masses)


def quick(machine: dg.Machine, path: dg.Path = PICK, timing: str | None = None) -> dg.Trajectory:
    return dg.plan(machine, path, brake_safe=False, timing=timing)


@pytest.mark.parametrize("timing", ["near-optimal", "toppra", "ruckig"])
@pytest.mark.parametrize(
    ("path", "jerk", "masses"),
    [
        (PICK, 3e6, MASSES),
        (
            BEND,
            inf,
            replace(MASSES, gravity=(2000.0, 4000.0, 9000.0), coulomb_friction=(6.0, 1.0, 4.0)),
        ),
    ],
    ids=["standing", "hanging without a jerk limit"],
)
def test_every_timing_keeps_each_carriage_s_force(
    timing: str, path: dg.Path, jerk: float, masses: dg.Masses
) -> None:
    force = np.array([34.0, 45.0, 38.0])
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
    for force, path in ((22.0, PICK), (30.0, BEND)):
        machine = limited(force=force)
        carriages = map_to_carriages(dg.check_path(machine, path))
        usual = time_path(carriages)
        fine = time_path(carriages, Effort(cells=300, coarse=64, per_piece=12, refine=1))
        assert usual.report.reason == ""
        assert usual.duration < 1.01 * fine.duration


def test_more_force_never_takes_longer_and_enough_of_it_changes_nothing() -> None:
    free = quick(limited())
    last = inf
    for force in (20.0, 40.0, 62.0):
        plan = quick(limited(force=force))
        assert plan.duration <= 1.001 * last
        last = plan.duration
    assert last == pytest.approx(free.duration, rel=1e-3)
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
    line = dg.Path.line((-41.0, -30.0, 300.0), (-30.0, 30.0, 295.0))
    with pytest.raises(
        dg.LimitError,
        match=r"carriage \d would need .* N to brake by itself .* stop_limits\.force is 52\.5 N",
    ):
        dg.plan(limited(force=35.0), line)
    drives = dg.DriveSettings(quick_stop_deceleration=(12e3,) * 3)
    gentle = replace(limited(force=35.0), drives=drives)
    assert dg.plan(gentle, line).report.brake_safe


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


@pytest.mark.parametrize("jerk", [3e6, inf])
def test_what_is_picked_up_on_the_way_counts_from_there_on(jerk: float) -> None:
    corner = [(-60.0, -80, 290), (-20.0, 20, 300), (-50.0, 90, 285)]
    path = dg.Path.polyline(corner, 3.0)
    machine = limited(dg.Masses(), force=35.0, jerk=jerk)
    light, heavy = (
        quick(replace(machine, masses=dg.Masses(payload=kg)), path) for kg in (0.0, 0.8)
    )
    picks = quick(machine, path.at(1, dg.SetPayload(0.8)))
    assert light.duration < picks.duration - 0.02 < heavy.duration - 0.04
    times = np.linspace(0.0, picks.duration, 4001)
    carried = picks.payload_at(times)
    assert carried[0] == 0.0 and carried[-1] == 0.8 and np.all(np.diff(carried) >= 0.0)
    after = carried > 0.0
    loaded = replace(machine, masses=dg.Masses(payload=0.8))
    still = np.zeros(3)
    end = picks.position_at(picks.duration)
    assert picks.forces(picks.duration) == pytest.approx(
        dg.carriage_forces(loaded, end, still, still)
    )
    for part in (after, ~after):
        used = np.abs(picks.forces(times[part])).max() / 35.0
        assert 0.98 < used <= 1.0005
    assert picks.actions == ()  # there is nothing to do for it
    assert dg.Trajectory.from_document(picks.to_document()).duration == picks.duration
    with pytest.raises(dg.InputError, match="SetPayload by itself"):
        next(dg.plan_program(machine, [path.at(1, dg.SetPayload(0.8))]))


def test_the_table_of_a_plan_knows_what_is_carried(tmp_path: Path) -> None:
    picks = quick(limited(dg.Masses()), PICK.at(2, dg.SetPayload(0.7)))
    picks.save(tmp_path / "plan.mcap")
    table = columns_of(read_log(tmp_path / "plan.mcap"))
    found = np.stack([table[f"force_{axis}_N"] for axis in (1, 2, 3)], axis=-1)
    assert found == pytest.approx(picks.forces(table["path_time_s"]), rel=1e-6, abs=1e-6)


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
