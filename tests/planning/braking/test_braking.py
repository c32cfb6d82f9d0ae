from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drive_stops import closes, least_clearance, random_stops
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.motion.audit import audit
from duoglide.planning.braking.certificate import brake_report
from duoglide.planning.braking.make_safe import brake_caps, make_brake_safe

MACHINE = dg.Machine.default()
A, B = (-80.0, -100.0, 300.0), (40.0, 100.0, 290.0)
FAST = dg.transfer(MACHINE, A, B, brake_safe=False)
SHARES = np.linspace(0.0, 1.0, 50)


def worst(motion: dg.Trajectory, stops: int = 300, seed: int = 1) -> float:
    """Return the least clearance of random stops, -inf where the links come apart."""
    drawn = random_stops(motion, stops, np.random.default_rng(seed))
    return least_clearance(motion, drawn.at(motion, SHARES))


@pytest.mark.parametrize("seed", range(4))
def test_no_plan_comes_apart_whichever_drive_brakes_and_whenever_the_others_follow(
    seed: int,
) -> None:
    rng, seen = np.random.default_rng(seed), 0
    while seen < 2:
        points = rng.uniform([-90.0, -150.0, 270.0], [90.0, 150.0, 320.0], (4, 3))
        if not (dg.reachable(MACHINE.geometry, points).all()):
            continue
        try:
            motion = dg.plan(MACHINE, dg.Path.polyline(points, tolerance=4.0))
        except dg.PathError:
            continue
        seen += 1
        assert worst(motion, seed=seed) >= motion.report.braking_clearance - 1e-6
        assert motion.report.braking_clearance >= MACHINE.clearance - 1e-3


def test_an_ordinary_draft_comes_apart_so_that_the_attack_can_fail() -> None:
    assert worst(FAST) == -np.inf


def test_the_loops_closed_by_hand_close_where_the_kinematics_close() -> None:
    carriages = np.random.default_rng(2).uniform(-350.0, 350.0, (4000, 3))
    here = closes(MACHINE.geometry, carriages)
    assert 20 < here.sum() < 3980
    dg.forward(MACHINE.geometry, carriages[here])


def test_a_pick_is_brake_safe_as_it_is() -> None:
    pick = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), lift=25.0)
    motion = dg.plan(MACHINE, pick)
    assert motion.report.duration_before_braking == 0.0
    assert motion.report.braking_clearance > 10.0


def test_the_longer_the_reaction_the_less_is_left() -> None:
    left = []
    for cycles in (0, 1, 3):
        machine = replace(MACHINE, reaction_cycles=cycles)
        moved = dg.transfer(machine, (-41, -40, 300), (-41, 40, 300), brake_safe=False)
        left.append(brake_report(moved).clearance)
    assert left[0] > left[1] > left[2] > 0.0


def test_the_motion_that_ends_past_legs_flat_is_caught() -> None:
    report = brake_report(FAST)
    assert not report.safe
    assert report.room == -np.inf
    assert 0.0 < report.time < FAST.duration
    assert worst(FAST) == -np.inf


def test_slowed_down_it_keeps_its_clearance_whenever_the_drives_brake() -> None:
    safe = make_brake_safe(FAST)
    assert safe.report.brake_safe
    assert safe.report.duration_before_braking == FAST.duration
    assert FAST.duration < safe.duration < 3.0 * FAST.duration
    found = worst(safe)
    assert found >= MACHINE.clearance
    assert MACHINE.clearance - 1e-3 <= safe.report.braking_clearance <= found + 1e-6
    assert audit(safe).worst <= 1.0005


def test_a_slow_motion_along_the_rails_costs_nothing() -> None:
    along = dg.transfer(MACHINE, (-41, -20, 300), (-41, 20, 300), brake_safe=False)
    safe = make_brake_safe(along)
    assert safe.duration == along.duration
    assert safe.report.duration_before_braking == 0.0


def test_drives_that_brake_gently_are_slowed() -> None:
    weak = replace(MACHINE.drives, quick_stop_deceleration=(2e4, 2e4, 2e4))
    machine = replace(MACHINE, drives=weak)
    draft = dg.transfer(machine, (-41, 0, 300), (-41, 150, 300), brake_safe=False)
    report = brake_report(draft)
    assert not report.safe
    assert brake_report(make_brake_safe(draft)).safe


def test_caps_are_only_where_the_brake_would_go_wrong() -> None:
    report = brake_report(FAST)
    sigma, caps = brake_caps(FAST, report.unsafe)
    capped = sigma[caps < 1e6]
    first, last = FAST.profile.at(report.unsafe[[0, -1], [0, 1]])[:, 0]
    assert np.all(np.diff(sigma) > 0.0)
    assert first - 20.0 < capped.min() <= capped.max() < last + 20.0


def test_a_retiming_under_caps_is_used_where_there_is_one() -> None:
    asked = []

    def retime(sigma: np.ndarray, cap: np.ndarray) -> dg.Trajectory:
        asked.append((sigma, cap))
        return replace(FAST, profile=FAST.profile.stretch(3.0))

    safe = make_brake_safe(FAST, retime)
    assert len(asked) == 1
    sigma, cap = asked[0]
    assert np.all(np.diff(sigma) > 0.0)
    assert np.isfinite(cap).all()
    assert safe.duration == pytest.approx(3.0 * FAST.duration)


def test_the_audit_tells_what_braking_costs_and_leaves() -> None:
    safe, unasked = audit(make_brake_safe(FAST)), FAST.audit()
    assert safe.braking_clearance >= MACHINE.clearance - 1e-3
    assert safe.braking_cost == pytest.approx(safe.duration - unasked.duration)
    assert f"at least {safe.braking_clearance:.3f} mm" in str(safe)
    assert np.isnan(unasked.braking_clearance)
    assert "brake" not in str(unasked)


def enlarged(factor: float) -> dg.Machine:
    """Return the default machine, all of its lengths ``factor`` times as large."""
    lengths = {name: factor * value for name, value in MACHINE.to_dict()["geometry"].items()}
    drives = MACHINE.drives
    one, two, three = (factor * d for d in drives.quick_stop_deceleration)
    return replace(
        MACHINE,
        geometry=dg.Geometry(**lengths),
        limits=dg.CarriageLimits(
            velocity=factor * MACHINE.limits.velocity,
            acceleration=factor * MACHINE.limits.acceleration,
            jerk=factor * MACHINE.limits.jerk,
        ),
        clearance=factor * MACHINE.clearance,
        carriage_width=factor * MACHINE.carriage_width,
        drives=replace(drives, quick_stop_deceleration=(one, two, three)),
    )


def test_a_larger_machine_is_as_safe() -> None:
    durations, left = [], []
    for factor in (1.0, 50.0):
        start, goal = (factor * np.array(p) for p in ((-41, -100, 300), (-41, 100, 305)))
        motion = dg.plan(enlarged(factor), dg.Path.line(start, goal))
        durations.append(motion.duration)
        left.append(motion.report.braking_clearance / factor)
    assert durations[1] == pytest.approx(durations[0], rel=0.02)
    assert left[1] == pytest.approx(left[0], rel=0.02)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_brake_safe_motions_are_safe_for_any_drives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    deceleration = tuple(rng.uniform(2e4, 1.2e5, 3).tolist())
    machine = replace(MACHINE, drives=replace(MACHINE.drives, quick_stop_deceleration=deceleration))
    box = np.array([[-90.0, -120.0, 275.0], [90.0, 120.0, 315.0]])
    safe = dg.transfer(machine, rng.uniform(*box), rng.uniform(*box))
    assert worst(safe, 200, seed) >= machine.clearance - 2e-3
