from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
import ruckig

import duoglide as dg
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.carriage import map_to_carriages
from duoglide.motion.rounding.blend import Blend
from duoglide.planning.timing.span import Effort, time_span
from duoglide.planning.timing.time_path import time_path
from duoglide.planning.timing.timed_curve import TimedCurve

PICK, PLACE = (-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0)


def _one_dimension(length: float, limits: tuple[float, float, float]) -> float:
    """Return the duration of ruckig's optimum from rest to rest."""
    state = ruckig.InputParameter(1)
    state.target_position = [length]
    state.max_velocity, state.max_acceleration, state.max_jerk = ([value] for value in limits)
    result = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(state, result)
    return float(result.duration)


def _differences(trajectory: dg.Trajectory) -> float:
    """Return the worst use of a limit by differences at 20 kHz, independent of ``audit``."""
    step = 1.0 / 20_000.0
    times = np.arange(-3, int(trajectory.duration / step) + 4) * step
    values, limits = trajectory.at(times).carriages, trajectory.machine.limits
    worst = 0.0
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        values = np.diff(values, axis=0) / step
        worst = max(worst, float((np.abs(values) / limit).max()))
    return worst


def _random_move(seed: int) -> tuple[dg.Machine, dg.Path]:
    """Return a feasible move with limits of its own."""
    rng = np.random.default_rng(seed)
    while True:
        shape = 3 if rng.random() < 0.3 else None
        limits = dg.CarriageLimits(
            velocity=rng.uniform(1500, 6000, shape),
            acceleration=10 ** rng.uniform(4.0, 5.18, shape),
            jerk=10 ** rng.uniform(5.5, 7.3, shape),
        )
        machine = dg.Machine(limits=limits)
        low, high = [-90.0, -150.0, 255.0], [60.0, 150.0, 300.0]
        ends, lift = rng.uniform(low, high, (2, 3)), rng.uniform(10.0, 60.0)
        try:
            path = dg.pick_and_place(*ends, lift, float(rng.uniform(0.5, 10.0)))
            dg.check_path(machine, path)
        except dg.DuoglideError:
            continue
        return machine, path


def _keeps_path_and_limits(machine: dg.Machine, path: dg.Path) -> dg.Trajectory:
    """Plan a move, and require everything that a plan promises."""
    trajectory = dg.plan(machine, path, brake_safe=False)
    assert trajectory.report.reason == ""
    assert _differences(trajectory) <= 1.0005
    sigma = trajectory.profile.at(np.linspace(0.0, trajectory.duration, 200))[:, 0]
    exact = dg.inverse(machine.geometry, trajectory.path.curve.position(sigma))  # type: ignore[union-attr]
    sent = trajectory.at(np.linspace(0.0, trajectory.duration, 200)).carriages
    assert np.abs(sent - exact).max() < 1e-9
    assert (np.diff(sigma) >= 0.0).all()
    return trajectory


@pytest.mark.parametrize("seed", range(40))
def test_random_moves_keep_every_limit_on_the_positions_sent(seed: int) -> None:
    _keeps_path_and_limits(*_random_move(seed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1000, 3000))
def test_thousands_of_random_moves_keep_every_limit(seed: int) -> None:
    _keeps_path_and_limits(*_random_move(seed))


@pytest.mark.parametrize("length", [0.001, 1.0, 30.0, 305.0])
@pytest.mark.parametrize("jerk", [3e5, 3e6, 3e7])
def test_lines_along_the_rails_match_the_optimum_in_one_dimension(
    length: float, jerk: float
) -> None:
    limits = dg.CarriageLimits(velocity=2500.0, acceleration=60e3, jerk=jerk)
    path = dg.Path.line((-41, -0.5 * length, 300), (-41, 0.5 * length, 300))
    plan = dg.plan(dg.Machine(limits=limits), path, brake_safe=False)
    best = _one_dimension(length, (2500.0, 60e3, jerk))
    assert best * (1 - 1e-9) <= plan.duration <= best * 1.0005
    if length > 0.01:  # at 20 kHz a move of some samples says nothing
        assert _differences(plan) <= 1.0005


def test_retiming_finds_the_optimum_of_a_line_that_the_first_motion_misses() -> None:
    # the polyline's collinear points put breaks anywhere, so that the search has to find the phases
    points = [(-41, y, 300) for y in (-152.5, -97.0, -13.0, 60.0, 152.5)]
    plan = dg.plan(dg.Machine.default(), dg.Path.polyline(points, 1.0), brake_safe=False)
    assert plan.duration == pytest.approx(_one_dimension(305.0, (4000.0, 60e3, 3e6)), rel=2e-3)


@pytest.mark.parametrize(("tolerance", "most"), [(2.0, 0.262), (4.0, 0.249), (8.0, 0.234)])
def test_the_standard_move_is_as_quick_as_the_best_known(tolerance: float, most: float) -> None:
    path = dg.pick_and_place(PICK, PLACE, 25.0, tolerance)
    plan = dg.plan(dg.Machine.default(), path, brake_safe=False)
    assert plan.duration <= most
    assert plan.audit().worst <= 1.0005
    times = np.linspace(0.0, plan.duration, 20_001)
    corner = np.array([-41.0, -152.5, 320.0])
    gap = np.linalg.norm(plan.position_at(times) - corner, axis=1).min()
    assert gap <= tolerance + 1e-5  # of what the nearest sample may be beside the nearest place


def test_the_plan_is_near_a_fine_grid_reference() -> None:
    ratios = []
    for seed in range(100, 112):
        machine, path = _random_move(seed)
        carriages = map_to_carriages(dg.check_path(machine, path))
        fine = Effort(coarse=80, cells=500, per_piece=16, rounds=6, refine=1, tolerance=1e-6)
        ratios.append(time_path(carriages).duration / time_path(carriages, fine).duration)
    assert np.median(ratios) < 1.005
    assert max(ratios) < 1.03
    assert min(ratios) > 0.995


def test_caps_on_the_tool_hold() -> None:
    path = dg.pick_and_place(PICK, PLACE, 25.0, 4.0).capped(1500.0, 20e3)
    plan = dg.plan(dg.Machine.default(), path, brake_safe=False)
    step = plan.duration / 20_000
    points = plan.position_at(np.arange(20_001) * step)
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1).max() / step
    acceleration = np.linalg.norm(np.diff(points, 2, axis=0), axis=1).max() / step**2
    assert 1400.0 < speed <= 1500.0 * 1.0005
    assert 18e3 < acceleration <= 20e3 * 1.0005


def test_a_cap_on_one_segment_leaves_the_others_alone() -> None:
    points = [(-41, -100, 300), (-41, 0, 310), (-41, 100, 300)]
    path = dg.Path.polyline(points, 4.0, speed=[500.0, None])
    plan = dg.plan(dg.Machine.default(), path, brake_safe=False)
    times = np.linspace(0.0, plan.duration, 20_001)
    position = plan.position_at(times)
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / times[1]
    first = position[1:, 1] < -1.0
    assert speed[first].max() <= 500.0 * 1.0005
    assert speed[~first].max() > 1000.0


@pytest.mark.parametrize("carriage", [0, 1, 2])
@pytest.mark.parametrize("name", ["acceleration", "jerk"])
def test_limits_a_thousand_apart_hold(name: str, carriage: int) -> None:
    limits = {"velocity": 4000.0, "acceleration": 60e3, "jerk": 3e6}
    values = np.full(3, limits[name])
    values[carriage] *= 1e3
    machine = dg.Machine(limits=dg.CarriageLimits(**{**limits, name: values}))
    _keeps_path_and_limits(machine, dg.pick_and_place(PICK, PLACE, 25.0, 4.0))


def test_a_limit_of_jerk_a_million_times_higher_changes_nothing_but_the_time() -> None:
    path = dg.pick_and_place(PICK, PLACE, 25.0, 4.0)
    loose = dg.Machine(limits=dg.CarriageLimits(jerk=3e12))
    plan = _keeps_path_and_limits(loose, path)
    assert plan.lower_bound() <= plan.duration <= plan.lower_bound() * 1.05


def test_slow_limits_keep_the_speed_limit_all_along() -> None:
    limits = dg.CarriageLimits(velocity=40.0, acceleration=60e3, jerk=3e6)
    machine = dg.Machine(limits=limits)
    plan = dg.plan(machine, dg.pick_and_place(PICK, PLACE, 25.0, 4.0), brake_safe=False)
    sigma = np.linspace(0.0, plan.profile.end, 20_001)
    slopes = np.abs(plan.path.derivatives(sigma)[:, 1]).max(axis=1)
    ideal = float(np.mean(slopes) * plan.profile.end / 40.0)
    assert ideal < plan.duration < 1.01 * ideal


def test_ten_metres_work_on_a_machine_of_that_size() -> None:
    small, size = dg.Geometry(), 40.0
    scaled = {f.name: getattr(small, f.name) * size for f in fields(small)}
    machine = dg.Machine(geometry=dg.Geometry(**scaled))
    a, b = np.array([-41.0, -125.0, 295.0]) * size, np.array([-41.0, 125.0, 295.0]) * size
    _keeps_path_and_limits(machine, dg.pick_and_place(a, b, 25.0 * size, 2.0 * size))


def test_tiny_segments_between_blends_are_no_trouble() -> None:
    points = [(-41, -100, 300), (-41, 0, 300), (-41, 0.001, 300.001), (-41, 100, 300.5)]
    _keeps_path_and_limits(dg.Machine.default(), dg.Path.polyline(points, 2.0))
    almost = Blend(25.0 - 2e-8, 40.0, 0.49)
    plan = _keeps_path_and_limits(
        dg.Machine.default(), dg.pick_and_place(PICK, PLACE, 25.0, almost)
    )
    assert plan.duration < 0.24


def test_arcs_splines_and_arches_keep_limits() -> None:
    machine = dg.Machine.default()
    _keeps_path_and_limits(machine, dg.Path.arc((-80, 0, 300), (-41, 39, 300), (-2, 0, 300)))
    through = [(-80, 0, 300), (-41, 39, 310), (-2, 0, 300), (20, -50, 290), (-40, -80, 310)]
    _keeps_path_and_limits(machine, dg.Path.through(through))
    _keeps_path_and_limits(machine, dg.Path.arch(PICK, PLACE, 25.0))


def test_progress_goes_from_nothing_to_all() -> None:
    told: list[float] = []
    path = dg.pick_and_place(PICK, PLACE, 25.0, 0.0)
    dg.plan(dg.Machine.default(), path, progress=told.append)
    assert told[-1] == 1.0
    assert told == sorted(told)


def test_compiled_motion_agrees_with_the_carriage_path() -> None:
    points = [(-80, 0, 300), (-41, 39, 310), (-2, 0, 300)]
    for path in (dg.Path.polyline(points, 3.0), dg.Path.arc(*points), dg.Path.through(points)):
        carriages = map_to_carriages(dg.check_path(dg.Machine.default(), path))
        timed = TimedCurve.of(carriages)
        sigma = np.linspace(0.0, carriages.curve.end, 50)
        motion = np.column_stack([sigma, np.full(50, 7.0), np.full(50, -30.0), np.full(50, 11.0)])
        found = timed.motion(motion, timed.pieces_of(sigma)) * timed.limits
        q = carriages.derivatives(sigma)
        expected = np.stack(
            [
                q[:, 1] * 7.0,
                q[:, 1] * -30.0 + q[:, 2] * 49.0,
                q[:, 1] * 11.0 + 3.0 * q[:, 2] * 7.0 * -30.0 + q[:, 3] * 343.0,
            ],
            axis=1,
        )
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("link", "end"), [("arm", (320, 0, 80)), ("legs", (-41, 0, 40)), ("strut", (-41, 0, 520))]
)
def test_compiled_motion_is_refused_from_where_a_link_is_too_short(
    link: str, end: tuple[float, float, float]
) -> None:
    longer = {"strut_length": 500.0, "leg_length": 250.0} if link == "arm" else {}
    geometry = dg.Geometry(**longer)
    machine = dg.Machine(geometry=geometry)
    start = np.array([-41.0, 0.0, 302.0])
    line = np.array([start, end - start, np.zeros(3)])
    curve = Curve([float(np.linalg.norm(line[1]))], [0.0], [line])
    sigma = np.linspace(0.0, curve.end, 301)
    beyond = sigma[~dg.reachable(geometry, curve.position(sigma))]
    with pytest.raises(dg.UnreachableError, match=f"the {link} "):
        dg.inverse(geometry, curve.position(beyond[:1]))
    motion = np.column_stack([sigma, np.ones((301, 3))])
    with pytest.raises(dg.UnreachableError, match=f"sigma = {beyond[0]:.6g} mm"):
        TimedCurve(machine, curve).motion(motion, np.zeros(301, dtype=np.intp))


def test_compiled_cells_are_the_profile_and_lie_in_one_piece_of_the_curve_each() -> None:
    points = [(-80, 0, 300), (-41, 39, 310), (-2, 0, 300), (-2, 30, 300)]
    path = dg.Path(dg.Path.polyline(points).segments, (3.0, 0.0))
    checked = dg.check_path(dg.Machine.default(), path)
    timed = TimedCurve.of(map_to_carriages(checked))
    rest = checked.curve.rests[0]
    for start, end in ((0.0, rest), (rest, checked.curve.end)):
        span = time_span(timed, start, end, Effort())
        motion, piece = timed.cell_states(span.profile, 5)
        knots = span.profile.knots[:, 0]
        times = np.linspace(knots[:-1], np.nextafter(knots[1:], 0.0), 5, axis=1)
        expected = span.profile.at(times)
        np.testing.assert_allclose(motion, expected, rtol=1e-9, atol=1e-9)
        assert (piece == piece[:, :1]).all()
        middle = span.profile.at(times[:, 2])[:, 0]
        np.testing.assert_array_equal(piece[:, 2], timed.pieces_of(middle))
