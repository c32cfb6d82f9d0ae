from __future__ import annotations

import json

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.actions import Dwell, SetOutput, WaitInput
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.rounding.blend import Blend

CORNERS = [(0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 20.0, 0.1)]


def every_kind() -> dg.Path:
    path = dg.Path.polyline(CORNERS, blends=[Blend(2.0, 3.0, 0.4)], speed=[120.0, None])
    path = path.then(dg.Path.arc((10, 20, 0.1), (15, 25, 0.1), (10, 30, 0.1), speed=50.0), 0.1)
    path = path.then(dg.Path.through([(10, 30, 0.1), (0, 31, 0.2), (-9, 20, 1 / 3)]), 0.2)
    path = path.at(0, SetOutput(1, 16, True)).at(-1, WaitInput(2, 0, False, 1.5), Dwell(0.25))
    return path.capped(300.0, 5000.0)


def test_a_path_survives_json_exactly() -> None:
    path = every_kind()
    again = dg.Path.from_dict(json.loads(json.dumps(path.to_dict())))
    assert again == path
    one, other = (round_corners(p).curve.to_dict() for p in (path, again))
    assert one == other


def test_then_keeps_corners_and_moves_actions_along() -> None:
    first = dg.Path.polyline(CORNERS, tolerance=0.5).at(-1, Dwell(1.0))
    second = dg.Path.line(CORNERS[-1], (0, 0, 5)).at(0, SetOutput(3, 1, False))
    path = first.then(second, 0.25)
    assert path.corners == (0.5, 0.25)
    assert [waypoint for waypoint, _ in path.actions] == [2, 2]
    assert path.waypoints == (*CORNERS, (0.0, 0.0, 5.0))


def test_then_refuses_a_gap_and_says_how_wide_it_is() -> None:
    with pytest.raises(dg.InputError, match=r"3 mm from the end \(10, 20, 0.1\)"):
        dg.Path.polyline(CORNERS).then(dg.Path.line((10, 23, 0.1), (0, 0, 0)))
    with pytest.raises(dg.InputError, match="tool_speed"):
        dg.Path.polyline(CORNERS).then(dg.Path.line(CORNERS[-1], (0, 0, 0)).capped(10.0))


def test_the_way_back_passes_the_same_points_and_blends() -> None:
    path = every_kind()
    there, back = round_corners(path), round_corners(path.reversed())
    assert path.reversed().reversed() == path
    np.testing.assert_allclose(back.before, there.after[::-1], atol=1e-6)
    far = there.curve.position(np.linspace(0.0, there.curve.end, 400))
    near = back.curve.position(np.linspace(0.0, back.curve.end, 4000))
    gaps = np.linalg.norm(far[:, None] - near[None], axis=-1).min(axis=1)
    assert gaps.max() < 0.02


def test_an_arch_rises_straight_and_reaches_its_height() -> None:
    path = dg.Path.arch((-41, -100, 295), (-41, 100, 290), lift=25.0, straight=6.0)
    curve = round_corners(path).curve
    track = curve.position(np.linspace(0.0, curve.end, 4001))
    assert track[:, 2].max() == pytest.approx(320.0)
    low = track[track[:, 2] < 296.0]
    assert set(np.round(low[:, 1], 9)) == {-100.0, 100.0}
    assert curve.rests == ()


def test_a_spline_passes_through_its_points_with_continuous_curvature() -> None:
    points = np.random.default_rng(5).normal(size=(7, 3)) * 20.0
    curve = round_corners(dg.Path.through(points)).curve
    np.testing.assert_allclose(curve.position(curve.breaks), points, atol=1e-12)
    inner = curve.breaks[1:-1]
    left, right = (curve.derivatives(inner, np.arange(5) + side) for side in (0, 1))
    np.testing.assert_allclose(left[:, :3], right[:, :3], atol=1e-11)
    np.testing.assert_allclose(curve.derivatives(curve.breaks[[0, -1]])[:, 2], 0.0, atol=1e-12)


def test_the_repr_is_short_and_has_units() -> None:
    assert repr(dg.Path.line((0, 0, 0), (1, 2, 3))) == "Path((0, 0, 0) to (1, 2, 3) mm, 1 segment)"


@pytest.mark.parametrize(
    ("points", "match"),
    [
        ([(0, 0, 0), (0, 0, 0)], "points 0 and 1 coincide"),
        ([(0, 0, 0), (1, 0, 0), (1, 0, 5e-7)], "points 1 and 2 coincide"),
        ([(0, 0, 0)], "at least 2"),
        ([(0, 0, float("nan")), (1, 0, 0)], "finite"),
        ([(0, 0), (1, 0)], r"shape"),
        ([("a", 0, 0), (1, 0, 0)], "real numbers"),
    ],
)
def test_points_that_make_no_path_are_refused(points: list[tuple[float, ...]], match: str) -> None:
    with pytest.raises(dg.InputError, match=match):
        dg.Path.polyline(points)


def test_a_spline_refuses_points_too_near_each_other_to_bend_between() -> None:
    with pytest.raises(dg.InputError, match="points 1 and 2 coincide"):
        dg.Path.through([(0, 0, 0), (1, 0, 0), (1, 5e-6, 0), (2, 0, 0)])
    assert dg.Path.through([(0, 0, 0), (5e-6, 0, 0)]).end == (5e-6, 0, 0)


@pytest.mark.parametrize(
    "points",
    [
        [(0, 0, 0), (1, 1, 1), (2, 2, 2)],
        [(0, 0, 0), (1, 0, 0), (0, 0, 0)],
        [(0, 0, 0), (0, 0, 0), (1, 0, 0)],
    ],
)
def test_an_arc_needs_three_points_that_are_not_on_one_line(
    points: list[tuple[float, float, float]],
) -> None:
    with pytest.raises(dg.InputError, match="arc"):
        dg.Path.arc(*points)


def test_caps_corners_and_actions_are_validated() -> None:
    with pytest.raises(dg.InputError, match="speed"):
        dg.Path.line((0, 0, 0), (1, 0, 0), speed=0.0)
    with pytest.raises(dg.InputError, match="tolerance"):
        dg.Path.polyline(CORNERS, tolerance=-1.0)
    with pytest.raises(dg.InputError, match="tolerance"):
        dg.Path.polyline(CORNERS, tolerance=float("nan"))
    with pytest.raises(dg.InputError, match="waypoint 3"):
        dg.Path.polyline(CORNERS).at(3, Dwell(1.0))
    with pytest.raises(dg.InputError, match="speeds"):
        dg.Path.polyline(CORNERS, speed=[1.0])
    with pytest.raises(dg.InputError, match="not a path"):
        dg.Path.from_dict({"segments": []})
    with pytest.raises(dg.InputError, match="lift"):
        dg.Path.arch((0, 0, 0), (10, 0, 0), lift=3.0, straight=5.0)
    with pytest.raises(dg.InputError, match="over each other"):
        dg.Path.arch((0, 0, 0), (0, 0, 9))
