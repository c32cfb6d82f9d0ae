"""A timing that is not the near-optimal one says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.audit import audit
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.timing_report import TimingMethod
from duoglide.planning.stops.certificate import certify_stops
from duoglide.planning.timing import interior_point
from duoglide.planning.timing.time_path import time_path

MOVE = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0, 4.0)


@pytest.fixture
def path(machine: dg.Machine) -> CarriagePath:
    return map_to_carriages(dg.check_path(machine, MOVE))


def _failing(monkeypatch: pytest.MonkeyPatch, after: int) -> list[bool]:
    """Let every solve after the first few fail; record which did."""
    failed: list[bool] = []
    solve = interior_point.solve

    def watched(rows: Any, goal: Any, x: np.ndarray[Any, Any], *how: float) -> Any:
        failed.append(len(failed) >= after)
        steps, converged = solve(rows, goal, x, *how)
        return steps, converged and not failed[-1]

    monkeypatch.setattr(interior_point, "solve", watched)
    return failed


def test_whichever_solve_is_the_first_to_fail_the_plan_keeps_every_limit_and_says_so(
    path: CarriagePath, monkeypatch: pytest.MonkeyPatch
) -> None:
    best = time_path(path)
    assert best.report.method is TimingMethod.NEAR_OPTIMAL
    methods = []
    for after in range(0, 60, 3):
        with monkeypatch.context() as patch:
            failed = _failing(patch, after)
            plan = time_path(path)
        assert audit(plan).worst <= 1.0005
        if not any(failed):
            break
        methods.append(plan.report.method)
        assert plan.report.reason
        assert plan.report.reason in str(audit(plan))
        assert plan.report.reason in repr(dg.Trajectory.of(plan, certify_stops(plan)))
        assert plan.duration > 0.999 * best.duration
    assert methods[0] is TimingMethod.CERTIFIED_SLOW
    assert methods[-1] is TimingMethod.IN_PART


def test_a_flagged_timing_is_flagged_in_its_file(
    path: CarriagePath, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _failing(monkeypatch, 0)
    motion = time_path(path)
    plan = dg.Trajectory.of(motion, certify_stops(motion))
    assert plan.report.method is TimingMethod.CERTIFIED_SLOW
    plan.save(tmp_path / "plan.mcap")
    again = dg.Trajectory.load(tmp_path / "plan.mcap")
    assert again.report.method is TimingMethod.CERTIFIED_SLOW
    assert again.audit().fallback == plan.report.reason != ""
