"""Long spans are timed window by window."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
import duoglide.planning.plan as whole_plan
from duoglide.motion.audit import audit
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.timing_report import TimingMethod
from duoglide.planning.timing import interior_point, solver
from duoglide.planning.timing.span import Effort, time_span
from duoglide.planning.timing.time_path import time_path
from duoglide.planning.timing.timed_curve import TimedCurve

QUICK = Effort(per_piece=2, rounds=2, refine=0, corrections=1)


def _winding(machine: dg.Machine, points: int) -> CarriagePath:
    """Return a path of many short segments without a rest."""
    turn = 0.06 * np.arange(points + 1)
    x, y, z = 50.0 * np.sin(1.7 * turn + 0.3), 110.0 * np.sin(turn), 15.0 * np.sin(2.3 * turn)
    rough = np.random.default_rng(1).uniform(-1.5, 1.5, (2, points + 1))
    path = dg.Path.polyline(np.column_stack([x - 25.0 + rough[0], y + rough[1], z + 280.0]), 2.0)
    machine = replace(machine, carriage_margin=0.0)  # it grazes legs flat here and there
    carriages = map_to_carriages(dg.check_path(machine, path))
    assert carriages.curve.rests == ()
    return carriages


def _watched(monkeypatch: pytest.MonkeyPatch, fail_every: int = 0) -> list[tuple[int, int]]:
    """Record cells and steps of each solve; some of them are made to fail."""
    solves: list[tuple[int, int]] = []
    solve = interior_point.solve

    def watched(rows: Any, goal: Any, x: np.ndarray[Any, Any], *how: float) -> Any:
        steps, converged = solve(rows, goal, x, *how)
        solves.append((x.size // 2 - 1, steps))
        if fail_every and len(solves) % fail_every == 0:
            x[:] = np.nan
            return steps, False
        return steps, converged

    monkeypatch.setattr(interior_point, "solve", watched)
    return solves


def _by_windows(monkeypatch: pytest.MonkeyPatch, cells: int) -> None:
    monkeypatch.setattr(solver, "WINDOW", cells)
    monkeypatch.setattr(solver, "LONG", cells + cells // 2)


def test_windows_cost_hardly_any_time_of_the_motion_and_keep_every_limit(
    machine: dg.Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _winding(machine, 100)
    monkeypatch.setattr(solver, "LONG", 10**9)
    whole = time_path(path)
    _by_windows(monkeypatch, 120)
    solves = _watched(monkeypatch)
    windowed = time_path(path)
    assert len(solves) > 20
    assert windowed.duration <= 1.01 * whole.duration
    assert audit(windowed).worst <= 1.0005
    assert not windowed.report.reason


def test_position_speed_and_acceleration_are_continuous_where_windows_meet(
    machine: dg.Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    _by_windows(monkeypatch, 100)
    windowed = time_path(_winding(machine, 80), QUICK)
    knots = windowed.profile.knots[1:-1, 0]
    before, after = windowed.at(knots - 1e-9), windowed.at(knots + 1e-9)
    limits = windowed.machine.limits
    for name, most in (("carriages", limits.velocity), ("velocity", limits.acceleration)):
        step = np.abs(getattr(after, name) - getattr(before, name))
        assert np.all(step <= 2.1e-9 * most + 1e-10)
    assert np.all(np.abs(after.acceleration - before.acceleration) <= 2.1e-9 * limits.jerk + 1e-6)
    assert windowed.profile.knots[1:-1, 2].min() > 0.0  # no window ends at rest


def test_work_grows_with_the_number_of_points_and_each_solve_stays_small(
    machine: dg.Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = []
    for points in (250, 750):
        path = _winding(machine, points)
        timed = TimedCurve.of(path)
        solves = _watched(monkeypatch)
        time_span(timed, 0.0, path.curve.end, QUICK)
        assert max(cells for cells, _ in solves) < solver.LONG
        work.append(sum(cells * steps for cells, steps in solves) / points)
        monkeypatch.undo()
    assert work[1] <= 1.5 * work[0]


def test_a_window_that_does_not_converge_keeps_what_it_had(
    machine: dg.Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    _by_windows(monkeypatch, 60)
    solves = _watched(monkeypatch, fail_every=3)
    windowed = time_path(_winding(machine, 80), QUICK)
    assert len(solves) > 20
    assert audit(windowed).worst <= 1.0005
    assert windowed.report.method is TimingMethod.IN_PART
    assert "windows" in audit(windowed).fallback


def test_a_long_path_has_few_knots_and_is_as_quick(
    machine: dg.Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    turn = 0.02 * np.arange(141)
    points = np.column_stack([-41.0 + 20.0 * np.cos(turn), 40.0 * np.sin(turn), 290.0 + turn])
    path = dg.Path.through(points)
    few = dg.plan(machine, path, brake_safe=False)
    monkeypatch.setattr(whole_plan, "_MANY", 10**9)
    many = dg.plan(machine, path, brake_safe=False)
    assert few.path.length == many.path.length
    assert len(few.profile.knots) < 0.6 * len(many.profile.knots)
    assert few.duration <= 1.002 * many.duration
    assert few.audit().worst <= 1.0005
