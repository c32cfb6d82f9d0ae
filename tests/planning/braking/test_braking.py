from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.kinematics.headroom.nearby import Patch, room_on
from duoglide.kinematics.headroom.room import Room
from duoglide.motion.audit import audit
from duoglide.planning.braking import certificate as braking
from duoglide.planning.braking.certificate import DriveStops, brake_report
from duoglide.planning.braking.make_safe import brake_caps, make_brake_safe

MACHINE = dg.Machine.default()
A, B = (-80.0, -100.0, 300.0), (40.0, 100.0, 290.0)
STEP = 1e-4
FAST = dg.transfer(MACHINE, A, B, brake_safe=False)


def simulate(machine: dg.Machine, q: np.ndarray, v: np.ndarray, coast: float) -> np.ndarray:
    """Brake three carriages in small steps; return where they are, (steps, 3)."""
    deceleration = np.array(machine.drives.quick_stop_deceleration)
    q, v, rows = q.copy(), v.copy(), [q.copy()]
    clock = 0.0
    while np.any(v != 0.0):
        braking = clock >= coast - 1e-12
        slower = np.sign(v) * np.maximum(np.abs(v) - deceleration * STEP, 0.0) if braking else v
        q = q + 0.5 * (v + slower) * STEP
        v = slower
        clock += STEP
        rows.append(q.copy())
    return np.array(rows)


def least_clearance(trajectory: dg.Trajectory, starts: int) -> float:
    """Find it the long way: through the public kinematics, -inf where the links come apart."""
    machine = trajectory.machine
    states = [trajectory.at(float(t)) for t in np.linspace(0.0, trajectory.duration, starts)]
    rows = np.concatenate(
        [
            simulate(machine, state.carriages, state.velocity, coast)
            for state in states
            for coast in (0.0, machine.drives.cycle)
        ]
    )
    try:
        positions = dg.forward(machine.geometry, rows)
    except (dg.UnreachableError, dg.SingularityError):
        return -np.inf
    assert np.abs(rows).max() < machine.geometry.rail_half_length
    assert np.diff(rows[:, :2]).min() > machine.carriage_width
    return float(dg.clearance(machine.geometry, positions).min())


def test_stops_follow_the_drives_ramp() -> None:
    q, v = np.array([-200.0, 150.0, 30.0]), np.array([1715.0, -2733.0, 0.0])
    for coast in (0.0, 0.002):
        rows = simulate(MACHINE, q, v, coast)
        stops = DriveStops(MACHINE, q[None], v[None], np.full(1, coast))
        assert stops.lasting[0] == pytest.approx(coast + 2733.0 / 60e3)
        np.testing.assert_allclose(stops.at(np.ones(1))[0], rows[-1], atol=1e-2)
        half = rows[round(0.5 * stops.lasting[0] / STEP)]
        np.testing.assert_allclose(stops.at(np.full(1, 0.5))[0], half, atol=0.3)


def test_the_motion_that_ends_past_legs_flat_is_caught() -> None:
    report = brake_report(FAST)
    assert not report.safe
    assert report.room == -np.inf
    assert 0.0 < report.time < FAST.duration
    assert least_clearance(FAST, 120) == -np.inf


def test_slowed_down_it_keeps_its_clearance_whenever_the_drives_brake() -> None:
    safe = make_brake_safe(FAST)
    assert safe.report.brake_safe
    assert safe.report.duration_before_braking == FAST.duration
    assert FAST.duration < safe.duration < 1.35 * FAST.duration
    found = least_clearance(safe, 120)
    assert found >= MACHINE.clearance
    assert safe.report.braking_clearance == pytest.approx(found, abs=0.3)
    assert audit(safe).worst <= 1.0005


def test_a_motion_along_the_rails_costs_nothing() -> None:
    along = dg.transfer(MACHINE, (-41, -150, 300), (-41, 150, 300), brake_safe=False)
    safe = make_brake_safe(along)
    assert safe.duration == along.duration
    assert safe.report.duration_before_braking == 0.0
    np.testing.assert_allclose(
        safe.report.braking_clearance,
        dg.clearance(MACHINE.geometry, (-41.0, 0.0, 300.0)),
        atol=1e-3,
    )


def test_drives_that_brake_gently_run_off_the_rail_and_are_slowed() -> None:
    weak = replace(MACHINE.drives, quick_stop_deceleration=(2e4, 2e4, 2e4))
    machine = replace(MACHINE, drives=weak)
    draft = dg.transfer(machine, (-41, 0, 300), (-41, 150, 300), brake_safe=False)
    report = brake_report(draft)
    assert (report.safe, report.quantity) == (False, "travel")
    assert brake_report(make_brake_safe(draft)).safe


def test_the_cost_is_in_the_caps_where_the_brake_would_go_wrong() -> None:
    motion = FAST.profile.at(np.linspace(0.0, FAST.duration, 200)[1:-1])
    caps = brake_caps(FAST.path, motion[:, 0], motion[:, 1])
    assert 0.8 < (caps / motion[:, 1]).min() < 1.0
    assert np.mean(caps < motion[:, 1]) < 0.5
    unsafe = int(np.argmin(caps / motion[:, 1]))
    sigma = motion[unsafe : unsafe + 1, 0]
    states = FAST.path.derivatives(sigma)[0]
    for share, kept in ((0.999, True), (1.02, False)):
        rows = simulate(MACHINE, states[0], states[1] * caps[unsafe] * share, 0.002)
        try:
            positions = dg.forward(MACHINE.geometry, rows)
            clear = dg.clearance(MACHINE.geometry, positions).min() >= MACHINE.clearance
        except (dg.UnreachableError, dg.SingularityError):
            clear = False
        assert clear == kept


def test_a_retiming_under_caps_is_used_where_there_is_one() -> None:
    asked = []

    def retime(sigma: np.ndarray, cap: np.ndarray) -> dg.Trajectory:
        asked.append((sigma, cap))
        return replace(FAST, profile=FAST.profile.stretched(1.3))

    safe = make_brake_safe(FAST, retime)
    assert len(asked) == 1
    sigma, cap = asked[0]
    assert np.all(np.diff(sigma) > 0.0)
    assert np.isfinite(cap).all()
    assert safe.duration == pytest.approx(1.3 * FAST.duration)


def test_a_path_that_grazes_the_clearance_is_hardly_slowed() -> None:
    radius = MACHINE.geometry.arm_length + MACHINE.clearance + 2e-6  # along the edge of legs flat
    angles = np.array([1.9, 1.7, 1.5])
    arc = np.stack([45.0 + radius * np.cos(angles), 0.0 * angles, 70.0 + radius * np.sin(angles)])
    draft = dg.plan(MACHINE, dg.Path.arc(*arc.T), brake_safe=False)
    assert not brake_report(draft).safe
    safe = make_brake_safe(draft)
    assert 1.999 < safe.report.braking_clearance < 2.0
    assert safe.duration < 2.5 * draft.duration
    assert least_clearance(safe, 60) >= safe.report.braking_clearance - 2e-6


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


def count_cells(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that grows by how many cells are looked at each time."""
    counts: list[int] = []

    def counted(machine: dg.Machine, patch: Patch, enough: float) -> tuple[Room, Room]:
        counts.append(len(patch.middle))
        return room_on(machine, patch, enough)

    monkeypatch.setattr(braking, "room_on", counted)
    return counts


def test_a_larger_machine_takes_hardly_more_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = count_cells(monkeypatch)
    totals, durations = [], []
    for factor in (1.0, 50.0):
        start, goal = (factor * np.array(p) for p in (A, B))
        counts.clear()
        motion = dg.plan(enlarged(factor), dg.Path.line(start, goal))
        totals.append(sum(counts))
        durations.append(motion.duration)
    assert totals[1] < 4 * totals[0]
    assert durations[1] == pytest.approx(durations[0], rel=0.02)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_brake_safe_motions_are_safe_for_any_drives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    deceleration = tuple(rng.uniform(2e4, 1.2e5, 3).tolist())
    machine = replace(MACHINE, drives=replace(MACHINE.drives, quick_stop_deceleration=deceleration))
    box = np.array([[-90.0, -120.0, 275.0], [90.0, 120.0, 315.0]])
    safe = dg.transfer(machine, rng.uniform(*box), rng.uniform(*box))
    assert least_clearance(safe, 40) >= machine.clearance - 2e-3
