"""Blends, segments and bends that are tiny beside the path they stand in."""

from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.planning.limit_use import require_limits

A, B, C = (-41.0, 0.0, 300.0), (-41.0, 50.0, 300.0), (-41.0, 50.0, 320.0)
STEP = 1.0 / 20_000.0


def _differences(trajectory: dg.Trajectory) -> float:
    """Return the worst use of a limit by differences at 20 kHz, independent of ``audit``."""
    times = np.arange(-3, int(trajectory.duration / STEP) + 4) * STEP
    values, limits = trajectory.at(times).carriages, trajectory.machine.limits
    worst = 0.0
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        values = np.diff(values, axis=0) / STEP
        worst = max(worst, float((np.abs(values) / limit).max()))
    return worst


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-5, 1e-6, 1e-9])
def test_a_tiny_corner_tolerance_keeps_the_limits(tolerance: float) -> None:
    machine = dg.Machine.default()
    exact = dg.plan(machine, dg.Path.polyline([A, B, C]), brake_safe=False)
    trajectory = dg.plan(machine, dg.Path.polyline([A, B, C], tolerance), brake_safe=False)
    assert _differences(trajectory) <= 1.0005
    assert trajectory.duration <= 1.05 * exact.duration


@pytest.mark.parametrize("blend", [dg.Blend(1e-6, 1e-6), dg.Blend(1e-6, 10.0)])
def test_a_tiny_blend_keeps_the_limits(blend: dg.Blend) -> None:
    path = dg.Path.polyline([A, B, C], blends=blend)
    assert _differences(dg.plan(dg.Machine.default(), path, brake_safe=False)) <= 1.0005


@pytest.mark.parametrize("gap", [5e-6, 5e-5, 5e-4])
def test_a_tiny_segment_that_turns_keeps_the_limits(gap: float) -> None:
    points = [A, B, (-41.0, 50.0, 300.0 + gap), (-41.0, 0.0, 300.1)]
    path = dg.Path.polyline(points, tolerance=1.0)
    assert _differences(dg.plan(dg.Machine.default(), path, brake_safe=False)) <= 1.0005


def test_what_is_left_of_a_line_between_two_blends_keeps_the_limits() -> None:
    """Passed in microseconds: cells of it were so short that rounding used up the jerk limit."""
    rng = np.random.default_rng(1)
    angles = 0.9 * np.arange(9) + rng.uniform(-0.1, 0.1, 9)
    places = np.column_stack([-41 + 22 * np.cos(angles), 95 * np.sin(angles), np.full(9, 300.0)])
    below = 0.5 * (places[:-1] + places[1:]) - np.array([0.0, 0.0, 15.0])
    rows = zip(places, below, places[1:], strict=False)
    paths = [dg.Path.polyline(list(three), 3.0) for three in rows]
    machine = dg.Machine.default()
    for part in dg.plan_program(machine, paths, tolerance=3.0):
        require_limits(part, machine.limits)


def test_a_point_beside_another_on_a_line_costs_no_time() -> None:
    machine, end = dg.Machine.default(), (-41.0, 100.0, 300.0)
    near = [A, B, (-41.0, 50.00005, 300.0), end]
    plain = dg.plan(machine, dg.Path.line(A, end), brake_safe=False)
    marked = dg.plan(machine, dg.Path.polyline(near, tolerance=0.1), brake_safe=False)
    assert marked.duration == pytest.approx(plain.duration, rel=2e-3)
    assert _differences(marked) <= 1.0005


def test_a_cap_begins_at_a_point_on_a_line() -> None:
    path = dg.Path.polyline([A, B, (-41.0, 100.0, 300.0)], speed=[None, 200.0])
    trajectory = dg.plan(dg.Machine.default(), path, brake_safe=False)
    times = np.linspace(0.0, trajectory.duration, 4001)
    capped = trajectory.position_at(times)[:, 1] > 50.0
    speed = np.abs(trajectory.at(times).velocity[:, 0])
    assert speed[capped].max() <= 200.0 * 1.001
    assert speed[~capped].max() > 1000.0


@pytest.mark.parametrize("bulge", [1e-3, 1e-5, 1e-7, 2e-9])
def test_a_nearly_straight_arc_is_as_quiet_as_a_line(bulge: float) -> None:
    end = (-41.0, 100.0, 310.0)
    arc = dg.Path.arc((-41.0, 0.0, 310.0), (-41.0, 50.0, 310.0 + bulge), end)
    trajectory = dg.plan(dg.Machine.default(), arc, brake_safe=False)
    assert _differences(trajectory) <= 1.0005
    np.testing.assert_allclose(trajectory.position_at(trajectory.duration), end, atol=1e-9)
