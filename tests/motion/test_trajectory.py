from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.actions import Dwell, SetOutput, WaitInput


@pytest.fixture(scope="module")
def move() -> dg.Trajectory:
    path = dg.pick_and_place((-41, -152.5, 295), (-41, 152.5, 295), 25, 4, dwell=0.02)
    return dg.plan(dg.Machine.default(), path, brake_safe=False)


def test_state_is_the_derivative_of_what_is_sent(move: dg.Trajectory) -> None:
    step = 1e-5
    times = np.arange(0.03, move.duration - 0.03, 0.0007)
    states = [move.at(times + k * step) for k in (-1, 0, 1)]
    for lower, upper in (("carriages", "velocity"), ("velocity", "acceleration")):
        before, after = getattr(states[0], lower), getattr(states[2], lower)
        slope = (after - before) / (2 * step)
        exact = getattr(states[1], upper)
        assert np.abs(slope - exact).max() < 2e-3 * np.abs(exact).max()


def test_carriages_hold_the_platform_where_position_at_says(move: dg.Trajectory) -> None:
    times = np.linspace(0.0, move.duration, 101)
    expected = dg.inverse(move.machine.geometry, move.position_at(times))
    assert np.abs(move.at(times).carriages - expected).max() < 1e-11


def test_one_time_and_many_agree(move: dg.Trajectory) -> None:
    times = np.linspace(0.0, move.duration, 57)
    many = move.at(times)
    for k, t in enumerate(times.tolist()):
        one = move.at(t)
        assert one.carriages == pytest.approx(many.carriages[k], abs=1e-11)
        assert one.jerk == pytest.approx(many.jerk[k], abs=1e-4)


def test_times_beyond_the_ends_are_clamped(move: dg.Trajectory) -> None:
    assert np.array_equal(move.at(-1.0).carriages, move.start)
    assert np.array_equal(move.at(move.duration + 1.0).carriages, move.end)
    assert np.array_equal(move.at([-1.0, 99.0]).velocity, np.zeros((2, 3)))


@pytest.mark.parametrize("t", [float("nan"), float("inf"), "now", None])
def test_a_time_that_is_no_number_is_refused(move: dg.Trajectory, t: object) -> None:
    with pytest.raises(dg.InputError):
        move.at(t)  # type: ignore[arg-type]


def test_sample_ends_with_the_end(move: dg.Trajectory) -> None:
    times, states = move.sample(0.002)
    assert times[0] == 0.0
    assert times[-1] == move.duration
    assert np.diff(times[:-1]) == pytest.approx(0.002, rel=1e-9)
    assert states.carriages.shape == (len(times), 3)
    with pytest.raises(dg.InputError, match="period"):
        move.sample(0.0)


@pytest.mark.parametrize("period", [1e-300, 5e-324, 1e-12])
def test_more_samples_than_memory_holds_are_refused(move: dg.Trajectory, period: float) -> None:
    with pytest.raises(dg.InputError, match="10000000 samples"):
        move.sample(period)


def test_a_saved_plan_comes_back_to_the_last_bit(move: dg.Trajectory, tmp_path: Path) -> None:
    move.save(tmp_path / "plan.mcap")
    again = dg.Trajectory.load(tmp_path / "plan.mcap")
    times = np.linspace(0.0, move.duration, 333)
    for name in ("carriages", "velocity", "acceleration", "jerk"):
        assert np.array_equal(getattr(again.at(times), name), getattr(move.at(times), name))
    assert again.actions == move.actions
    assert again.report == move.report or np.isnan(again.report.braking_clearance)
    assert again.stops == move.stops
    assert again.to_document() == move.to_document()


def test_a_file_without_a_plan_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.mcap").write_bytes(b"not a log")
    with pytest.raises(dg.LogError):
        dg.Trajectory.load(tmp_path / "no.mcap")
    with pytest.raises(dg.InputError):
        dg.Trajectory.from_document({"profile": []})


def test_the_audit_finds_a_broken_limit(move: dg.Trajectory) -> None:
    fast = dg.Trajectory(move.path, move.profile.stretch(0.9), move.stops)
    found = fast.audit()
    ratio = found.jerk.max() / move.audit().jerk.max()
    assert ratio == pytest.approx(0.9**-3, rel=1e-3)
    assert found.worst > 1.3


def test_the_audit_says_in_words_what_limits(move: dg.Trajectory) -> None:
    found = move.audit()
    assert found.shares[0].share >= found.shares[-1].share
    assert "carriage" in found.explain()
    assert "% of the time" in found.explain()
    assert " 0 % of the time" not in found.explain()
    assert f"{found.picks_per_minute:.1f} picks per minute" in str(found)
    assert found.least_clearance > move.machine.clearance
    assert found.times.shape == found.use.shape == found.limiting.shape


def test_actions_come_in_order_and_dwells_are_rests() -> None:
    points = [(-41, -100, 300), (-41, 0, 300), (-41, 100, 310)]
    actions = (SetOutput(1, 2, True), WaitInput(2, 1, True), Dwell(0.1), SetOutput(1, 2, False))
    path = dg.Path.polyline(points, 4.0).at(1, *actions)
    plan = dg.plan(dg.Machine.default(), path, brake_safe=False)
    assert tuple(action for _, action in plan.actions) == actions
    times = [t for t, _ in plan.actions]
    assert times[0] == times[1] == times[2] == pytest.approx(times[3] - 0.1, abs=1e-12)
    still = plan.at(np.linspace(times[2], times[3], 11))
    assert not still.velocity.any()
    assert np.ptp(still.carriages, axis=0).max() == 0.0


def test_the_lower_bound_is_below_and_near() -> None:
    path = dg.Path.line((-41, -152.5, 300), (-41, 152.5, 300))
    machine = dg.Machine(limits=dg.CarriageLimits(jerk=3e9))
    plan = dg.plan(machine, path, brake_safe=False)
    assert plan.lower_bound() == pytest.approx(plan.duration, rel=0.01)
    assert plan.lower_bound() <= plan.duration


def test_repr_is_short_and_has_units(move: dg.Trajectory) -> None:
    assert re.fullmatch(r"Trajectory\(0\.\d{4} s, \d+\.?\d* mm\)", repr(move))


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_the_audit_takes_no_rounding_for_jerk_whatever_the_machine_s_size(size: float) -> None:
    geometry = dg.Geometry(
        **{f.name: getattr(dg.Geometry(), f.name) * size for f in fields(dg.Geometry)}
    )
    limits = dg.CarriageLimits(velocity=1e3 * size, acceleration=1e4 * size, jerk=1e5)
    machine = dg.Machine(
        geometry=geometry,
        limits=limits,
        clearance=2.0 * size,
        carriage_margin=size,
        carriage_width=60.0 * size,
        drives=dg.DriveSettings(quick_stop_deceleration=6e4 * max(size, 1.0)),
    )
    ends = np.array([[-41.0, -100.0, 302.0], [-41.0, 100.0, 302.0]]) * size
    audit = dg.plan(machine, dg.Path.line(*ends), brake_safe=False).audit()
    assert 0.99 < audit.worst < 1.0002
