"""Points that are dense for their tolerance become a curve; nearly double ones are one corner."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import duoglide as dg
from duoglide.arrays import FloatArray
from duoglide.motion.path.rounded import RoundedPath, round_corners

MACHINE = dg.Machine.default()
SQUARE = np.array(
    [[-40.0, -40.0, 320.0], [40.0, -40.0, 320.0], [40.0, 40.0, 320.0], [-40.0, 40.0, 320.0]]
)


def circle(count: int, radius: float = 40.0) -> FloatArray:
    angle = np.linspace(0.0, 1.5 * np.pi, count)
    return np.stack([radius * np.sin(angle), radius * np.cos(angle), 320.0 + 0.0 * angle], axis=1)


def ellipse_helix(count: int) -> FloatArray:
    u = np.linspace(0.0, 1.0, count)
    return np.stack(
        [22.0 * np.sin(7.0 * u), -25.0 + 50.0 * u, 320.0 + 9.0 * np.cos(7.0 * u)], axis=1
    )


def wave(count: int) -> FloatArray:
    u = np.linspace(0.0, 1.0, count)
    return np.stack(
        [30.0 * np.sin(3.0 * u + 1.0), 35.0 * np.sin(8.0 * u), 320.0 + 8.0 * np.sin(5.0 * u)],
        axis=1,
    )


def scattered(points: FloatArray, reach: float, seed: int) -> FloatArray:
    """Move all points but the ends by up to ``reach`` mm."""
    random = np.random.default_rng(seed)
    way = random.normal(size=points.shape)
    way *= reach * random.random((len(points), 1)) / np.linalg.norm(way, axis=1, keepdims=True)
    way[0] = way[-1] = 0.0
    return points + way


def bulge(curve: FloatArray, points: FloatArray) -> float:
    """Return how far a finely sampled curve leaves the lines between some of its points [mm]."""
    return float(distances_from_lines(curve, points).max())


def distances_from_lines(places: FloatArray, points: FloatArray) -> FloatArray:
    """Return the distance of places from a polyline by trying all of its lines."""
    start, way = points[:-1], np.diff(points, axis=0)
    size = np.maximum(np.sum(way * way, axis=1), 1e-300)
    least = np.full(len(places), np.inf)
    for a, w, s in zip(start, way, size, strict=True):
        share = np.clip((places - a) @ w / s, 0.0, 1.0)
        least = np.minimum(least, np.linalg.norm(places - a - share[:, None] * w, axis=1))
    return least


def duration(path: dg.Path) -> float:
    return dg.plan(MACHINE, path, brake_safe=False).duration


def require_kept(rounded: RoundedPath, points: FloatArray, tolerance: float) -> None:
    """Hold the curve against the points and the lines, by a search of its own."""
    curve = rounded.curve
    fine = curve.position(np.linspace(0.0, curve.end, 6001))
    assert distances_from_lines(fine, points).max() <= tolerance
    assert distances_from_lines(points, fine).max() <= tolerance + 1e-4
    assert (np.diff(rounded.waypoints) >= 0.0).all()
    missed = np.linalg.norm(curve.position(rounded.waypoints) - points, axis=1)
    assert missed.max() <= tolerance * (1.0 + 1e-9)


@pytest.mark.parametrize("shape", [circle, ellipse_helix, wave])
@pytest.mark.parametrize("count", [20, 100, 700])
@pytest.mark.parametrize("scatter", [0.0, 0.1])
def test_dense_points_take_no_longer_than_their_curve(
    shape: object, count: int, scatter: float
) -> None:
    assert callable(shape)
    points, fine = shape(count), shape(4000)
    tolerance = max(2.001 * bulge(fine, points), 0.05)
    given = scattered(points, scatter * tolerance, count)
    path = dg.Path.fitted(given, tolerance)
    rounded = round_corners(path)
    assert rounded.curve.rests == ()
    require_kept(rounded, given, tolerance)
    assert duration(path) <= 1.03 * duration(dg.Path.through(shape(150)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_curves(seed: int) -> None:
    random = np.random.default_rng(seed)
    size, pace, phase = random.uniform(5, 35, 3), random.uniform(1, 9, 3), random.uniform(0, 6, 3)
    size[2] *= 0.4

    def at(u: FloatArray) -> FloatArray:
        return np.array([0.0, 0.0, 320.0]) + size * np.sin(pace * u[:, None] + phase)

    count = int(np.exp(random.uniform(np.log(12), np.log(3000))))
    points, fine = at(np.linspace(0, 1, count)), at(np.linspace(0, 1, 4000))
    through = dg.Path.through(at(np.linspace(0, 1, 150)))
    try:
        dg.check_path(MACHINE, through)
    except dg.PathError:
        pytest.skip("the machine cannot follow this curve")
    tolerance = max(2.001 * bulge(fine, points), float(random.choice([0.02, 0.05, 0.5])))
    given = scattered(points, 0.1 * tolerance, seed)
    path = dg.Path.fitted(given, tolerance)
    require_kept(round_corners(path), given, tolerance)
    assert duration(path) <= 1.03 * duration(through)


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-6, 1e-5, 1e-3, 0.01, 0.1])
@pytest.mark.parametrize(("points", "tolerance"), [(SQUARE, 2.0), (circle(60), 0.5)])
def test_a_nearly_double_point_changes_next_to_nothing(
    points: FloatArray, tolerance: float, apart: float
) -> None:
    usual = duration(dg.Path.polyline(points, tolerance))
    way = np.random.default_rng(3).normal(size=3)
    for index in (1, len(points) // 2):
        double = points[index] + apart * way / np.linalg.norm(way)
        given = np.insert(points, index + 1, double, axis=0)
        path = dg.Path.polyline(given, tolerance)
        assert duration(path) == pytest.approx(usual, rel=0.01)
        if len(path.waypoints) == len(given):
            require_kept(round_corners(path), given, tolerance)


@pytest.mark.parametrize("count", [10, 1000])
def test_sides_told_by_many_points_keep_their_corners(count: int) -> None:
    share = np.linspace(0.0, 1.0, count, endpoint=False)[:, None]
    sides = [a + share * (b - a) for a, b in pairwise(SQUARE)]
    dense = np.concatenate([*sides, SQUARE[-1:]])
    assert duration(dg.Path.polyline(dense, 2.0)) == pytest.approx(
        duration(dg.Path.polyline(SQUARE, 2.0)), rel=1e-6
    )
    require_kept(round_corners(dg.Path.polyline(dense, 2.0)), dense, 2.0)


def test_a_curve_leaves_and_meets_long_lines_without_a_corner() -> None:
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 60)
    bend = np.stack([20.0 + 20.0 * np.cos(angle), 30.0 * np.sin(angle), 320.0 + 0.0 * angle], 1)
    points = np.concatenate([[[-40.0, -30.0, 320.0]], bend, [[-40.0, 30.0, 320.0]]])
    rounded = round_corners(dg.Path.polyline(points, 0.2))
    require_kept(rounded, points, 0.2)
    assert rounded.curve.rests == ()
    assert not rounded.shape.any()  # no blend: it is one curve


def test_actions_inside_of_a_fitted_curve_stay_at_their_points() -> None:
    points = circle(100)
    path = dg.Path.fitted(points, 0.5).at(50, dg.SetOutput(1, 1, True))
    trajectory = dg.plan(MACHINE, path, brake_safe=False)
    ((time, _),) = trajectory.actions
    offset = np.subtract(MACHINE.work_frame, MACHINE.tool_offset)
    assert np.linalg.norm(trajectory.position_at(time) - offset - points[50]) <= 0.5
    rests = dg.plan(MACHINE, dg.Path.fitted(points, 0.5).at(50, dg.Dwell(0.1)), brake_safe=False)
    assert np.linalg.norm(rests.position_at(rests.actions[0][0]) - offset - points[50]) < 1e-9


def test_a_fitted_plan_is_read_back_to_the_last_bit(tmp_path: object) -> None:
    trajectory = dg.plan(MACHINE, dg.Path.fitted(circle(100), 0.5))
    again = dg.Trajectory.from_document(trajectory.to_document())
    assert again.to_document() == trajectory.to_document()


def test_too_small_a_tolerance_is_explained() -> None:
    slow = dg.plan(MACHINE, dg.Path.polyline(circle(60)), brake_safe=False).audit()
    assert "Path.fitted" in slow.sampling
    assert slow.sampling in str(slow)
    quick = dg.plan(MACHINE, dg.Path.fitted(circle(60), 0.5), brake_safe=False).audit()
    assert not quick.sampling


@pytest.mark.parametrize("tolerance", [0.0, -1.0, float("nan")])
def test_a_fit_needs_a_tolerance(tolerance: float) -> None:
    with pytest.raises(dg.InputError, match="tolerance"):
        dg.Path.fitted(circle(20), tolerance)
