"""The methods of timing: what each promises, on moves, curves and machines of many kinds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

import duoglide as dg
from duoglide.cli import options
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.timing_report import TimingMethod
from duoglide.planning.timing import topp_ra
from duoglide.planning.timing.span import NO_START, Effort, Search
from duoglide.planning.timing.time_path import choose_timing, time_path
from duoglide.planning.timing.timed_curve import TimedCurve

STEP = 1.0 / 20_000.0
PICK = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0, 4.0)
FREE = dg.Machine(limits=dg.CarriageLimits(jerk=inf))


def _curves() -> list[dg.Path]:
    """Return paths with corners, arcs, a spline, caps and a dwell."""
    corner = [(-60.0, -80.0, 290.0), (-20.0, 20.0, 300.0), (-50.0, 90.0, 285.0)]
    rounded = dg.Path.polyline(corner, 3.0)
    return [
        rounded,
        dg.Path.polyline(corner),
        dg.Path.arc((-60.0, -40.0, 290.0), (-41.0, 0.0, 305.0), (-20.0, 40.0, 290.0)),
        dg.Path.through([(-60.0, -80, 290), (-30.0, -20, 300), (-50.0, 40, 285), (-41.0, 90, 290)]),
        rounded.capped(speed=400.0, acceleration=9000.0),
        dg.Path.polyline(corner, 3.0, speed=[700.0, None]).at(1, dg.SetOutput(1, 16, True)),
        dg.Path.polyline(corner).at(1, dg.Dwell(0.05)),
        dg.Path.arch((-41.0, -90.0, 290.0), (-41.0, 90.0, 290.0)),
    ]


def _moves(seed: int, count: int) -> list[tuple[dg.Machine, dg.Path]]:
    """Return picks with limits of their own, each carriage its own in one of three."""
    rng = np.random.default_rng(seed)
    found: list[tuple[dg.Machine, dg.Path]] = []
    while len(found) < count:
        shape = 3 if rng.random() < 0.3 else None
        limits = dg.CarriageLimits(
            velocity=rng.uniform(1500, 6000, shape),
            acceleration=10 ** rng.uniform(4.0, 5.18, shape),
            jerk=10 ** rng.uniform(5.5, 7.3, shape),
        )
        ends = rng.uniform([-90.0, -150.0, 255.0], [60.0, 150.0, 300.0], (2, 3))
        try:
            path = dg.pick_and_place(*ends, rng.uniform(10.0, 60.0), rng.uniform(0.5, 10.0))
            dg.check_path(dg.Machine(limits=limits), path)
        except dg.DuoglideError:
            continue
        found.append((dg.Machine(limits=limits), path))
    return found


def _differences(trajectory: dg.Trajectory) -> float:
    """Return the worst use of a limit by differences at 20 kHz, independent of ``audit``."""
    times = np.arange(-3, int(trajectory.duration / STEP) + 4) * STEP
    values, limits = trajectory.at(times).carriages, trajectory.machine.limits
    worst = 0.0
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        values = np.diff(values, axis=0) / STEP
        worst = max(worst, float((np.abs(values) / limit).max()))
    return worst


def _require_sound(trajectory: dg.Trajectory) -> None:
    assert trajectory.starts_at_rest
    assert trajectory.ends_at_rest
    assert np.all(np.diff(trajectory.profile.knots[:, 1]) >= 0.0)
    assert _differences(trajectory) <= 1.0005
    certified, uses = trajectory.certified_for(trajectory.machine)
    assert uses.max() <= 1.001
    assert certified.profile == trajectory.profile


def _without_jerk_limit(machine: dg.Machine) -> dg.Machine:
    limits = machine.limits
    return replace(
        machine,
        limits=dg.CarriageLimits(
            velocity=limits.velocity, acceleration=limits.acceleration, jerk=inf
        ),
    )


def _require_ordered(machine: dg.Machine, path: dg.Path, loose: float = 1.0) -> None:
    """Require limits, rests and the order of durations of all methods on the same curve."""
    carriages = map_to_carriages(dg.check_path(machine, path))
    free_path = CarriagePath(replace(carriages.checked, machine=_without_jerk_limit(machine)))
    plans = {
        timing: dg.plan(machine, replace(path, timing=timing), brake_safe=False)
        for timing in dg.Timing
    }
    for timing, trajectory in plans.items():
        _require_sound(trajectory)
        assert trajectory.report.method.value == timing.value
        assert trajectory.report.reason == ""
    same = {timing: time_path(carriages, Effort(timing=timing)).duration for timing in dg.Timing}
    free = time_path(free_path)
    assert free.report.method is TimingMethod.TOPPRA
    near = same[dg.Timing.NEAR_OPTIMAL]
    assert plans[dg.Timing.RUCKIG].lower_bound() <= plans[dg.Timing.RUCKIG].duration
    assert dg.plan(machine, path, brake_safe=False).lower_bound() <= near * loose
    assert free.duration <= 1.01 * near
    assert same[dg.Timing.TOPPRA] == pytest.approx(near, rel=0.02)
    assert near <= 1.005 * same[dg.Timing.RUCKIG]


@pytest.mark.parametrize("index", range(8))
def test_every_timing_keeps_the_limits_and_their_durations_are_ordered(index: int) -> None:
    _require_ordered(dg.Machine(), _curves()[index])


@pytest.mark.parametrize("move", _moves(3, 4))
def test_the_same_holds_for_picks_under_limits_of_many_sizes(
    move: tuple[dg.Machine, dg.Path],
) -> None:
    _require_ordered(*move)


@pytest.mark.slow
@pytest.mark.parametrize("move", _moves(4, 60))
def test_the_same_holds_for_many_picks(move: tuple[dg.Machine, dg.Path]) -> None:
    _require_ordered(*move)


@pytest.mark.parametrize("timing", list(dg.Timing))
@pytest.mark.parametrize("index", range(8))
def test_without_a_jerk_limit_every_timing_keeps_the_other_two(
    timing: dg.Timing, index: int
) -> None:
    path = _curves()[index]
    trajectory = dg.plan(FREE, path, brake_safe=False, timing=timing)
    _require_sound(trajectory)
    assert trajectory.audit().jerk.tolist() == [0.0, 0.0, 0.0]
    if timing is not dg.Timing.RUCKIG:
        if not trajectory.audit().feed_share:
            assert trajectory.duration < 1.02 * trajectory.lower_bound()
        assert trajectory.duration <= 1.01 * dg.plan(dg.Machine(), path, False).duration


def test_the_argument_wins_then_the_path_then_the_machine_then_the_jerk_limit() -> None:
    line = dg.Path.line((-41.0, -50.0, 290.0), (-41.0, 50.0, 290.0))
    of_machine = replace(dg.Machine(), timing="ruckig")

    def made(machine: dg.Machine, path: dg.Path, timing: Any = None) -> str:
        return dg.plan(machine, path, brake_safe=False, timing=timing).report.method.value

    assert made(dg.Machine(), line) == "near-optimal"
    assert made(FREE, line) == "toppra"
    assert made(of_machine, line) == "ruckig"
    assert made(of_machine, replace(line, timing="toppra")) == "toppra"
    assert made(of_machine, replace(line, timing="toppra"), "near-optimal") == "near-optimal"
    jerk = [inf, 3e6, inf]
    assert choose_timing(dg.Machine(limits=dg.CarriageLimits(jerk=jerk))) == "near-optimal"


@pytest.mark.parametrize("wrong", ["Toppra", "fast", 3, True, ""])
def test_a_timing_that_there_is_not_is_refused_with_those_that_there_are(wrong: Any) -> None:
    line = dg.Path.line((-41.0, -50.0, 290.0), (-41.0, 50.0, 290.0))
    words = 'must be one of "near-optimal", "toppra", "ruckig"'
    with pytest.raises(dg.InputError, match=words):
        dg.plan(dg.Machine(), line, timing=wrong)
    with pytest.raises(dg.InputError, match=words):
        list(dg.plan_program(dg.Machine(), [line], timing=wrong))
    with pytest.raises(dg.InputError, match=words):
        replace(line, timing=wrong)
    with pytest.raises(dg.ConfigError, match=words):
        dg.Machine(timing=wrong)


def test_the_command_line_knows_the_timings_that_there_are() -> None:
    literal = get_args(options.TimingWord)[0]
    words = [word for part in get_args(literal) for word in get_args(part)]
    assert words == [timing.value for timing in dg.Timing]


def test_a_program_says_how_it_is_timed(tmp_path: Path) -> None:
    file = tmp_path / "program.toml"
    text = 'start = [-41, -50, 290]\n{}[[moves]]\ntype = "line"\nto = [-41, 50, 290]\n'
    file.write_text(text.format('timing = "ruckig"\n'))
    path = dg.read_program(file)
    assert path.timing is dg.Timing.RUCKIG
    assert dg.plan(dg.Machine(), path).report.method is TimingMethod.RUCKIG
    assert dg.Path.from_dict(path.to_dict()) == path
    file.write_text(text.format('timing = "rukig"\n'))
    with pytest.raises(dg.InputError, match="timing = 'rukig': must be one of"):
        dg.read_program(file)


@pytest.mark.parametrize("timing", list(dg.Timing))
@pytest.mark.parametrize("machine", [dg.Machine(), FREE], ids=["jerk limit", "none"])
def test_a_plan_in_a_file_says_how_it_was_timed(
    timing: dg.Timing, machine: dg.Machine, tmp_path: Path
) -> None:
    plan = dg.plan(machine, PICK, timing=timing)
    plan.save(tmp_path / "plan.mcap")
    again = dg.Trajectory.load(tmp_path / "plan.mcap")
    assert again.report.method.value == timing.value
    assert again.profile == plan.profile
    assert again.machine == machine
    assert again.report.brake_safe


@pytest.mark.parametrize("timing", list(dg.Timing))
@pytest.mark.parametrize("jerk", [3e6, inf])
def test_a_program_in_motion_keeps_the_limits_whatever_its_timing(
    timing: dg.Timing, jerk: float
) -> None:
    limits = dg.CarriageLimits(velocity=1500.0, acceleration=60e3, jerk=jerk)
    machine = dg.Machine(limits=limits)
    k = np.arange(13)
    x, y = -41.0 + 25.0 * np.cos(0.9 * k), 95.0 * np.sin(0.7 * k)
    points = np.column_stack([x, y, 285.0 + 15.0 * np.sin(1.3 * k)])
    paths = [dg.Path.polyline(points[i : i + 3], 3.0) for i in range(0, 12, 2)]
    parts = list(dg.plan_program(machine, paths, False, tolerance=3.0, timing=timing))
    worst = 0.0
    for part in parts:
        times = np.arange(0.0, part.duration, STEP)
        state = part.at(times)
        for name in ("velocity", "acceleration", "jerk"):
            use = np.abs(getattr(state, name)) / getattr(limits, name)
            worst = max(worst, float(use.max()))
    assert worst <= 1.002
    assert any(part.whole is not None for part in parts)
    for one, other in pairwise(parts):
        before, after = one.at(one.duration), other.at(0.0)
        assert np.abs(before.carriages - after.carriages).max() < 1e-9
        assert np.abs(before.velocity - after.velocity).max() < 1e-5


def test_toppra_that_finds_nothing_is_told_and_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise dg.LimitError("toppra finds no motion: tired")

    monkeypatch.setattr(topp_ra.SpanRows, "find_speeds", fail)
    plan = dg.plan(dg.Machine(), PICK, brake_safe=False, timing="toppra")
    assert plan.report.reason == "toppra finds no motion: tired"
    assert _differences(plan) <= 1.0005
    with pytest.raises(dg.LimitError, match="tired"):
        dg.plan(FREE, PICK, brake_safe=False)


def test_a_retiming_of_toppra_that_does_not_converge_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    find = Search.find_quickest

    def fail(self: Search, effort: Effort, like: Any = None) -> Any:
        return None if like is not None else find(self, effort)

    monkeypatch.setattr(Search, "find_quickest", fail)
    plan = dg.plan(dg.Machine(), PICK, brake_safe=False, timing="toppra")
    assert plan.report.reason == NO_START


def test_toppra_is_asked_in_units_in_which_its_tolerances_do_not_count() -> None:
    """In mm, two of the first thirty moves of the benchmark failed."""
    for scale in (0.1, 1.0, 100.0):
        limits = dg.CarriageLimits(velocity=4e3 * scale, acceleration=60e3 * scale**2, jerk=inf)
        plan = dg.plan(dg.Machine(limits=limits), PICK, brake_safe=False)
        assert plan.report.reason == ""
        assert plan.duration * scale == pytest.approx(0.215, rel=0.01)


def test_nodes_of_a_span_are_apart_and_at_every_mark() -> None:
    for path in _curves():
        timed = TimedCurve.of(map_to_carriages(dg.check_path(FREE, path)))
        ends = [0.0, *timed.curve.rests, timed.curve.end]
        for start, end in pairwise(ends):
            grid = topp_ra.divide_span(timed, start, end)
            assert np.all(np.diff(grid) > 0.0)
            assert set(topp_ra.find_marks(timed, start, end)) <= set(grid)
