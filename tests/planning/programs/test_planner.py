from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.rounded import RoundedPath, round_corners
from duoglide.motion.path_clock import ClockState, PathClock
from duoglide.motion.stop_bounds import StopBounds
from duoglide.motion.timing_report import TimingMethod
from duoglide.planning.braking.certificate import brake_report
from duoglide.planning.programs import joints as program_joints
from duoglide.planning.programs import planner as program_planner
from duoglide.planning.programs import windows as program_windows
from duoglide.planning.programs.windows import Seam
from duoglide.planning.timing import moving as timing_moving
from duoglide.planning.timing.base import plan_seven_phases
from duoglide.planning.timing.lead import Lead

STEP = 1.0 / 20_000.0


def _stations(count: int, asked: list[int]) -> Iterator[tuple[float, float, float]]:
    rng = np.random.default_rng(7)
    for k in range(count):
        asked.append(k)
        x, y = rng.uniform([-70.0, -60.0], [-10.0, 60.0])
        yield float(x), float(y), 290.0


def _winding(count: int) -> Iterator[dg.Path]:
    """Yield paths of two lines each, which meet at an angle."""
    k = np.arange(2 * count + 1)
    rows = (-41.0 + 25.0 * np.cos(0.9 * k), 95.0 * np.sin(0.7 * k), 285.0 + 15.0 * np.sin(1.3 * k))
    points = np.column_stack(rows)
    for i in range(count):
        yield dg.Path.polyline(points[2 * i : 2 * i + 3], 3.0)


def _brisk() -> dg.Machine:
    """Return a machine that is never so fast that it would look far ahead."""
    limits = dg.CarriageLimits(velocity=1500.0, acceleration=60e3, jerk=3e6)
    return replace(dg.Machine.default(), limits=limits)


@pytest.fixture(scope="module")
def moving() -> list[dg.Trajectory]:
    """A program whose corners between the paths are rounded too."""
    with pytest.MonkeyPatch.context() as patch:
        _fix_blends(patch)
        return list(dg.plan_program(_brisk(), _winding(5), tolerance=3.0))


def _fix_blends(patch: pytest.MonkeyPatch) -> None:
    """Round every corner alike: no search decides whether there is room for a seam."""

    def fixed(_: dg.Machine, path: dg.Path) -> RoundedPath:
        alike = [c if isinstance(c, dg.Blend) else dg.Blend(8.0, 8.0) for c in path.corners]
        return round_corners(replace(path, corners=tuple(alike)))

    patch.setattr(program_joints, "choose_blends", fixed)


def _setpoints(parts: list[dg.Trajectory]) -> np.ndarray:
    """Return the carriages every 50 us, and for three steps at both ends."""
    starts = np.cumsum([0.0, *(part.duration for part in parts)])
    times = np.arange(-3, int(starts[-1] / STEP) + 5) * STEP
    rows = []
    for part, start, end in zip(parts, starts[:-1], starts[1:], strict=True):
        last = part is parts[-1]
        first = part is parts[0]
        mine = ((times >= start) | first) & ((times < end) | last)
        rows.append(part.at(times[mine] - start).carriages)
    return np.concatenate(rows)


def _uses(carriages: np.ndarray, limits: dg.CarriageLimits) -> list[float]:
    """Return the worst use of velocity, acceleration and jerk limits by differences."""
    uses = []
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        carriages = np.diff(carriages, axis=0) / STEP
        uses.append(float((np.abs(carriages) / limit).max()))
    return uses


def test_the_motion_goes_through_where_one_trajectory_hands_over_to_the_next(
    moving: list[dg.Trajectory],
) -> None:
    assert len(moving) > 2
    for one, other in pairwise(moving):
        before, after = one.profile.knots[-1], other.profile.knots[0]
        assert tuple(after[2:]) == tuple(before[2:])  # to the last bit, along the path
        assert before[2] > 50.0
        end, start = one.at(one.duration), other.at(0.0)
        np.testing.assert_allclose(start.carriages, end.carriages, rtol=0.0, atol=1e-10)
        np.testing.assert_allclose(start.velocity, end.velocity, rtol=1e-10, atol=1e-8)
        np.testing.assert_allclose(start.acceleration, end.acceleration, rtol=1e-8, atol=1e-5)
    assert moving[0].starts_at_rest
    assert moving[-1].ends_at_rest
    assert moving[-1].whole is None


def test_no_limit_is_exceeded_on_either_side_of_a_seam_or_across_it(
    moving: list[dg.Trajectory],
) -> None:
    assert max(_uses(_setpoints(moving), moving[0].machine.limits)) <= 1.0005
    assert all(part.audit().worst <= 1.0005 for part in moving)


def test_what_hands_over_has_a_certified_way_to_rest(moving: list[dg.Trajectory]) -> None:
    for part in moving[:-1]:
        whole = part.whole
        assert whole is not None
        assert whole.ends_at_rest
        assert whole.duration > part.duration
        times = np.linspace(0.0, part.duration, 50)
        np.testing.assert_array_equal(whole.at(times).carriages, part.at(times).carriages)
        assert whole.audit().worst <= 1.0005
        assert brake_report(whole).safe


def test_a_stop_that_begins_before_a_seam_ends_after_it_within_the_stop_limits(
    moving: list[dg.Trajectory],
) -> None:
    part = moving[1]
    whole = part.whole
    assert whole is not None
    for back in (1e-4, 0.003, 0.01):
        bounds = part.stops.falling_at(part.duration - back)
        assert bounds.until > part.duration
        flat = StopBounds.constant(whole.duration, bounds.slope, bounds.bend)
        clock = PathClock(flat, STEP, start=part.duration - back)
        clock.hold()
        times = [part.duration - back - k * STEP for k in (3, 2, 1, 0)]
        while clock.state is ClockState.HOLDING:
            times.append(clock.step(STEP)[0])
        assert clock.state is ClockState.HELD
        assert part.duration < times[-1] <= bounds.until
        carriages = whole.at(np.array([*times, *times[-1:] * 3])).carriages
        assert max(_uses(carriages, whole.machine.stop_limits)) <= 1.0005


def test_going_through_is_quicker_than_resting_and_about_as_quick_as_one_plan(
    moving: list[dg.Trajectory],
) -> None:
    machine = moving[0].machine
    total = sum(part.duration for part in moving)
    paths = list(_winding(5))
    whole = paths[0]
    for path in paths[1:]:
        whole = whole.then(path, 3.0)
    whole = replace(whole, corners=(dg.Blend(8.0, 8.0),) * len(whole.corners))
    assert total < 1.03 * dg.plan(machine, whole).duration
    assert total < 0.95 * sum(t.duration for t in dg.plan_program(machine, paths))


def test_the_lower_bound_of_a_part_counts_its_speed_at_both_ends(
    moving: list[dg.Trajectory],
) -> None:
    part = moving[1]
    assert 0.6 * part.duration < part.lower_bound() <= part.duration


def test_a_part_survives_its_file_with_its_way_to_rest(
    moving: list[dg.Trajectory], tmp_path: Path
) -> None:
    part = moving[1]
    part.save(tmp_path / "part.mcap")
    again = dg.Trajectory.load(tmp_path / "part.mcap")
    assert again.profile == part.profile
    assert again.stops == part.stops
    assert again.whole is not None
    assert part.whole is not None
    assert again.whole.profile == part.whole.profile
    assert again.to_document() == part.to_document()


def test_actions_happen_once_and_in_order_across_seams(monkeypatch: pytest.MonkeyPatch) -> None:
    _fix_blends(monkeypatch)
    marks = [dg.SetOutput(1, k, True) for k in range(6)]
    paths = [
        path.at(1, one).at(-1, other)
        for path, one, other in zip(_winding(3), marks[::2], marks[1::2], strict=True)
    ]
    parts = list(dg.plan_program(_brisk(), paths, brake_safe=False, tolerance=3.0))
    assert any(part.whole is not None for part in parts)
    assert [action for part in parts for _, action in part.actions] == marks


def test_a_cap_on_the_tool_holds_across_a_seam_that_is_passed_at_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _fix_blends(monkeypatch)
    points = [(-41, -100, 290), (-41, 60, 290), (-25, 100, 300), (-25, 20, 300)]
    paths = [
        dg.Path.polyline(points[:3], 3.0, speed=200.0),
        dg.Path.line(points[2], points[3], 200.0),
    ]
    machine = replace(
        _brisk(), limits=dg.CarriageLimits(velocity=250.0, acceleration=2e4, jerk=1e6)
    )
    first, second = dg.plan_program(machine, paths, brake_safe=False, tolerance=3.0)
    assert first.profile.knots[-1, 2] == pytest.approx(200.0, rel=0.01)
    for part in (first, second):
        places = part.position_at(np.arange(0.0, part.duration, 1e-3))
        speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 1e-3
        assert speeds.max() <= 200.0 * 1.0005


@pytest.mark.parametrize("tolerance", [0.0, 3.0])
def test_reversals_and_dwells_stay_rests(machine: dg.Machine, tolerance: float) -> None:
    up, on = dg.Path.line((-41, 0, 280), (-41, 0, 290)), dg.Path.line((-41, 0, 290), (-41, 0, 300))
    paused = up.at(-1, dg.Dwell(0.01))
    for one, other in ((up, up.reversed()), (paused, on), (up, on.at(0, dg.Dwell(0.01)))):
        first, second = dg.plan_program(machine, [one, other], tolerance=tolerance)
        assert first.ends_at_rest
        assert first.whole is None
        assert second.starts_at_rest


def test_each_pick_is_one_trajectory_from_rest_to_rest(machine: dg.Machine) -> None:
    asked: list[int] = []
    told: list[tuple[int, float]] = []
    end = None
    for trajectory in dg.plan_program(
        machine, dg.picks(_stations(4, asked), 20.0, 3.0), progress=lambda n, t: told.append((n, t))
    ):
        if end is not None:
            assert trajectory.start == pytest.approx(end, abs=1e-9)
        end = trajectory.end
        assert trajectory.starts_at_rest
        assert trajectory.ends_at_rest
    assert [n for n, _ in told] == [1, 2, 3]
    assert told[-1][1] > told[0][1] > 0.0


def test_nothing_is_planned_before_it_is_asked_for(machine: dg.Machine) -> None:
    asked: list[int] = []
    program = dg.plan_program(machine, dg.picks(_stations(1_000_000, asked), 20.0, 3.0))
    next(program)
    next(program)
    assert len(asked) <= 4


def test_a_refused_path_is_named(machine: dg.Machine) -> None:
    good = dg.Path.line((-41, 0, 300), (-41, 50, 300))
    bad = dg.Path.line((-41, 50, 300), (-41, 50, 400))
    with pytest.raises(dg.PathError, match="path 2"):
        list(dg.plan_program(machine, [good, bad]))
    with pytest.raises(dg.PathError, match="50 mm from where path 1 ends"):
        list(dg.plan_program(machine, [good, good]))
    with pytest.raises(dg.InputError, match="tolerance"):
        next(dg.plan_program(machine, [good], tolerance=-1.0))


def test_the_motion_rests_before_a_path_that_is_refused(machine: dg.Machine) -> None:
    points = [(-41, 0, 280), (-41, 60, 300), (-41, 100, 280), (-41, 100, 600)]
    lines = [dg.Path.line(a, b) for a, b in pairwise(points)]
    parts = []
    with pytest.raises(dg.PathError, match="path 3"):
        for part in dg.plan_program(machine, lines, brake_safe=False, tolerance=2.0):
            parts.append(part)  # noqa: PERF402  # what came before the error counts
    assert parts[-1].ends_at_rest
    assert parts[-1].position_at(parts[-1].duration) == pytest.approx((-41, 100, 280))


def test_a_timing_that_cannot_begin_in_motion_makes_the_seam_a_rest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def planned(*args: object) -> dg.Trajectory:
        lead = args[2]
        if isinstance(lead, Lead) and lead.way is not None:
            raise dg.LimitError("none was found")
        return plan_window(*args)  # type: ignore[arg-type]

    plan_window = program_windows.plan_window
    monkeypatch.setattr(program_planner, "plan_window", planned)
    parts = list(dg.plan_program(_brisk(), _winding(3), brake_safe=False, tolerance=3.0))
    assert all(part.starts_at_rest and part.ends_at_rest for part in parts)
    ends = np.array([(*part.start, *part.end) for part in parts])
    np.testing.assert_allclose(ends[1:, :3], ends[:-1, 3:], rtol=0.0, atol=1e-9)


def test_of_many_paths_a_few_are_held(machine: dg.Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    """With windows that are not planned: what is held does not depend on how they are."""

    def planned(_: dg.Machine, path: dg.Path, *__: object) -> Any:
        return SimpleNamespace(path=path, duration=0.1, whole=None)

    def cut(window: Any, sigma: float) -> Seam:
        y = window.path.start[1] + sigma
        ends = [segment.end[1] for segment in window.path.segments]
        way = plan_seven_phases(0.0, 9.0, (1.0, 1.0, 1.0))
        return Seam(window, int(np.searchsorted(ends, y)), (-41.0, y, 290.0), Lead(way))

    monkeypatch.setattr(program_planner, "plan_window", planned)
    monkeypatch.setattr(program_planner, "cut_at", cut)
    made: list[weakref.ref[dg.Path]] = []

    def lines() -> Iterator[dg.Path]:
        for k in range(250):
            path = dg.Path.line((-41.0, 200.0 * k, 290.0), (-41.0, 200.0 * (k + 1), 290.0))
            made.append(weakref.ref(path))
            yield path

    most = 0
    for _ in dg.plan_program(machine, lines()):
        most = max(most, sum(path() is not None for path in made))
    assert len(made) == 250
    assert most <= 6


def test_a_part_whose_refinement_fails_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every first refinement of a timing that begins in motion is said to have failed."""
    _fix_blends(monkeypatch)
    sound, begin, asked = timing_moving._is_sound, timing_moving._Moving.begin, []

    def beginning(*given: Any) -> Any:
        asked.clear()
        return begin(*given)

    def failing(*given: Any) -> bool:
        asked.append(given)
        return sound(*given) and len(asked) != 2  # the first is before any refinement

    monkeypatch.setattr(timing_moving._Moving, "begin", beginning)
    monkeypatch.setattr(timing_moving, "_is_sound", failing)
    parts = list(dg.plan_program(_brisk(), _winding(3), tolerance=3.0))
    flagged = [part.report for part in parts if not part.starts_at_rest]
    assert flagged
    assert {report.method for report in flagged} == {TimingMethod.IN_PART}
    assert all("refinement did not converge" in report.reason for report in flagged)
    assert max(_uses(_setpoints(parts), _brisk().limits)) < 1.0005
