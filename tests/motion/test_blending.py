from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.motion.path.actions import Dwell, SetOutput
from duoglide.motion.path.rounded import RoundedPath, round_corners
from duoglide.motion.rounding.blend import Blend

SETTINGS = settings(max_examples=60, deadline=None, derandomize=True)


def distance_to(rounded: RoundedPath, point: np.ndarray) -> float:
    """Brute force, refined once."""
    curve = rounded.curve
    sigma = np.linspace(0.0, curve.end, 20001)
    best = sigma[np.linalg.norm(curve.position(sigma) - point, axis=1).argmin()]
    step = curve.end / 20000
    fine = np.linspace(best - step, best + step, 2001)
    return float(np.linalg.norm(curve.position(fine) - point, axis=1).min())


@SETTINGS
@given(
    seed=st.integers(0, 10**6),
    tolerance=st.floats(0.05, 5.0),
    degrees=st.floats(25.0, 165.0),
)
def test_a_corner_tolerance_is_used_exactly_where_there_is_room(
    seed: int, tolerance: float, degrees: float
) -> None:
    rng = np.random.default_rng(seed)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    corner = rng.normal(size=3) * 100.0
    turn = np.radians(degrees)
    before = corner - 400.0 * frame[0]
    after = corner + 300.0 * (np.cos(turn) * frame[0] + np.sin(turn) * frame[1])
    rounded = round_corners(dg.Path.polyline([before, corner, after], tolerance=tolerance))
    assert distance_to(rounded, corner) == pytest.approx(tolerance, rel=1e-6)
    assert rounded.deviation[1] == pytest.approx(tolerance, rel=1e-8)
    assert rounded.deviation[1] <= tolerance
    assert rounded.curve.rests == ()


@SETTINGS
@given(seed=st.integers(0, 10**6), tolerance=st.floats(0.1, 20.0), count=st.integers(3, 9))
def test_no_tolerance_makes_blends_overlap_or_leave_their_corner_too_far(
    seed: int, tolerance: float, count: int
) -> None:
    points = np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)) * 30.0, axis=0)
    rounded = round_corners(dg.Path.polyline(points, tolerance=tolerance))
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert (rounded.after[:-1] + rounded.before[1:] <= legs + 1e-9).all()
    assert (rounded.deviation <= tolerance).all()
    inner = rounded.curve.breaks[1:-1]
    rests = np.isin(inner, rounded.curve.rests)
    index = np.arange(inner.size)
    left = rounded.curve.derivatives(inner, index)
    right = rounded.curve.derivatives(inner, index + 1)
    np.testing.assert_allclose(left[:, 0], right[:, 0], atol=1e-9)
    np.testing.assert_allclose(left[~rests, 1:3], right[~rests, 1:3], atol=1e-8)


def test_a_corner_near_a_short_leg_takes_more_of_the_long_one() -> None:
    rounded = round_corners(
        dg.pick_and_place((-41, -152.5, 295), (-41, 152.5, 295), lift=25.0, tolerance=8.0)
    )
    assert rounded.before[1] == pytest.approx(25.0)
    assert 25.0 < rounded.after[1] < 75.0
    assert rounded.deviation[1] == pytest.approx(8.0, rel=1e-8)


def test_explicit_cut_backs_and_shape_are_kept() -> None:
    blend = Blend(18.0, 25.0, 0.47)
    path = dg.Path.polyline([(0, 0, 0), (0, 0, 40), (0, 60, 40)], blends=blend)
    rounded = round_corners(path)
    assert rounded.blend(0) == blend
    curve = rounded.curve
    np.testing.assert_allclose(curve.breaks[1], 22.0)
    np.testing.assert_allclose(curve.position(float(curve.breaks[1])), (0, 0, 22), atol=1e-12)
    np.testing.assert_allclose(curve.position(float(curve.breaks[2])), (0, 25, 40), atol=1e-12)
    assert curve.breaks[2] - curve.breaks[1] == pytest.approx(5.0 * 0.47 * 18.0)


def test_a_blend_up_to_half_its_cut_back_stays_in_the_corners_triangle() -> None:
    for shape in (0.2, 0.45, 0.5):
        path = dg.Path.polyline([(0, 0, 0), (50, 0, 0), (50, 90, 0)], blends=Blend(20, 60, shape))
        track = round_corners(path).curve.position(np.linspace(0.0, 200.0, 2000))
        assert track[:, 0].max() <= 50.0 + 1e-12
        assert track[:, 1].min() >= -1e-12


@pytest.mark.parametrize("rounding", [1e-10, 1e-9, 9e-7])
def test_blends_that_overlap_by_rounding_alone_are_shortened(rounding: float) -> None:
    points = [(-41, 0, 290), (-41, 30, 290), (-41, 30, 310), (-41, 60, 310)]
    fitting = dg.Path.polyline(points, blends=[Blend(10.0, 10.0), Blend(10.0, 10.0)])
    rounded = dg.Path.polyline(points, blends=[Blend(10.0, 10.0 + rounding), Blend(10.0, 10.0)])
    lengths = [round_corners(path).curve.end for path in (fitting, rounded)]
    assert lengths[0] == pytest.approx(lengths[1], abs=2.0 * rounding)
    too_long = dg.Path.polyline(points, blends=[Blend(10.0, 10.00001), Blend(10.0, 10.0)])
    with pytest.raises(dg.PathError, match=r"overlap by 1e-05 mm"):
        round_corners(too_long)


def test_overlapping_blends_are_refused_by_name_and_amount() -> None:
    points = [(0, 0, 0), (0, 0, 30), (0, 20, 30), (0, 20, 0)]
    with pytest.raises(dg.PathError, match=r"waypoints 1 and 2 overlap by 4 mm") as caught:
        round_corners(dg.Path.polyline(points, blends=Blend.radius(12.0)))
    assert caught.value.quantity == "blend"
    assert caught.value.amount == pytest.approx(4.0)
    assert caught.value.arc_length == pytest.approx(30.0)
    with pytest.raises(dg.PathError, match=r"waypoint 1 reaches past its segment by 5 mm"):
        round_corners(dg.Path.polyline(points, blends=[Blend(35.0, 5.0), 0.0]))


def test_blends_may_meet_and_use_up_a_segment() -> None:
    points = [(0, 0, 0), (0, 0, 20), (0, 20, 20), (0, 20, 0)]
    curve = round_corners(dg.Path.polyline(points, blends=[Blend(20, 8), Blend(12, 20)])).curve
    assert curve.count == 2
    assert curve.rests == ()
    np.testing.assert_allclose(curve.position(float(curve.breaks[1])), (0, 8, 20), atol=1e-12)


def test_an_exact_corner_and_a_reversal_are_rests() -> None:
    points = [(0, 0, 0), (10, 0, 0), (10, 10, 0), (10, 3, 0)]
    exact = round_corners(dg.Path.polyline(points)).curve
    np.testing.assert_allclose(exact.rests, [10.0, 20.0])
    rounded = round_corners(dg.Path.polyline(points, tolerance=0.5)).curve
    assert len(rounded.rests) == 1
    np.testing.assert_allclose(rounded.position(rounded.rests[0]), (10, 10, 0), atol=1e-12)
    with pytest.raises(dg.PathError, match="turns back by 180 degrees at waypoint 2"):
        round_corners(dg.Path.polyline(points, blends=Blend.radius(2.0)))


def test_a_straight_joint_needs_neither_blend_nor_rest() -> None:
    rounded = round_corners(dg.Path.polyline([(0, 0, 0), (1, 2, 3), (2, 4, 6)], tolerance=1.0))
    assert rounded.curve.rests == ()
    assert rounded.blend(0) is None


def test_a_tangent_joint_with_a_jump_of_curvature_is_rounded_or_a_rest() -> None:
    line = dg.Path.line((-20, 0, 0), (0, 0, 0))
    arc = dg.Path.arc((0, 0, 0), (10, 10, 0), (0, 20, 0))
    assert len(round_corners(line.then(arc)).curve.rests) == 1
    rounded = round_corners(line.then(arc, 0.1))
    assert rounded.curve.rests == ()
    assert 0.0 < rounded.deviation[1] <= 0.1


def test_an_action_that_needs_a_rest_makes_the_corner_exact() -> None:
    points = [(0, 0, 0), (10, 0, 0), (20, 0, 0), (20, 10, 0)]
    path = dg.Path.polyline(points, tolerance=1.0)
    passing = round_corners(path.at(2, SetOutput(1, 3, True)))
    assert passing.curve.rests == ()
    np.testing.assert_allclose(
        np.linalg.norm(passing.curve.position(float(passing.waypoints[2])) - (20, 0, 0)), 1.0
    )
    waiting = round_corners(path.at(1, Dwell(0.1)).at(2, Dwell(0.1)))
    np.testing.assert_allclose(waiting.curve.rests, [10.0, 20.0])


def test_ten_thousand_corners_are_rounded_together() -> None:
    points = np.cumsum(np.random.default_rng(3).normal(size=(10_001, 3)), axis=0)
    rounded = round_corners(dg.Path.polyline(points, tolerance=0.1))
    assert rounded.deviation.max() <= 0.1
    assert rounded.curve.count > 15_000


@pytest.mark.parametrize("bad", [(0, 1), (1, -2), (float("nan"), 1), (1, 2, 1.0)])
def test_a_blend_refuses_values_out_of_range(bad: tuple[float, ...]) -> None:
    with pytest.raises(dg.InputError, match="blend"):
        Blend(*bad)


@pytest.mark.parametrize("corner", [1e-6, Blend(1e-6, 1e-6), Blend(1e-6, 5.0)])
def test_a_corner_whose_blend_would_be_shorter_than_a_ten_thousandth_is_a_rest(
    corner: float | Blend,
) -> None:
    path = dg.Path.polyline([(0, 0, 0), (50, 0, 0), (50, 20, 0), (0, 20, 0)], blends=[corner, 2.0])
    rounded = round_corners(path)
    assert rounded.curve.rests == (50.0,)
    assert rounded.blend(0) is None
    assert rounded.blend(1) is not None
    np.testing.assert_array_equal(rounded.curve.position(50.0), (50, 0, 0))
