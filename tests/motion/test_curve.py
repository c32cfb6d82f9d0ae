from __future__ import annotations

import json
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.motion.curve.bounds import bound_curve
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.rounded import round_corners

SETTINGS = settings(max_examples=20, deadline=None, derandomize=True)


def mixed_curve(seed: int) -> Curve:
    """Line, arc, spline and blends between them."""
    rng = np.random.default_rng(seed)
    a, b, c, d = np.cumsum(rng.normal(size=(4, 3)) * 20.0 + 5.0, axis=0)
    path = dg.Path.line(a, b, speed=100.0).then(dg.Path.arc(b, c, d), 0.7)
    knots = np.vstack([d, d + rng.normal(size=(4, 3)) * 30.0])
    path = path.then(dg.Path.through(knots), 0.4)
    return round_corners(path).curve


@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_scalar_and_array_evaluation_agree_to_the_last_bit(seed: int) -> None:
    curve = mixed_curve(seed)
    sigma = np.linspace(-1.0, curve.end + 1.0, 57)
    one_by_one = np.array([curve.derivatives(float(s)) for s in sigma])
    np.testing.assert_allclose(one_by_one, curve.derivatives(sigma), rtol=1e-15, atol=1e-13)


@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_position_and_two_derivatives_are_continuous_at_every_break(seed: int) -> None:
    curve = mixed_curve(seed)
    assert curve.rests == ()
    inner = curve.breaks[1:-1]
    left = curve.derivatives(inner, np.arange(inner.size))
    right = curve.derivatives(inner, np.arange(inner.size) + 1)
    np.testing.assert_allclose(left[:, 0], right[:, 0], atol=1e-11)
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=1e-11)
    np.testing.assert_allclose(left[:, 2], right[:, 2], atol=1e-10)


@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_derivatives_are_those_of_the_position(seed: int) -> None:
    curve = mixed_curve(seed)
    middle = 0.5 * (curve.breaks[:-1] + curve.breaks[1:])
    step = 1e-3 * curve.spans
    for order in range(3):
        ahead = curve.derivatives(middle + step)[:, order]
        behind = curve.derivatives(middle - step)[:, order]
        expected = (ahead - behind) / (2.0 * step[:, None])
        found = curve.derivatives(middle)[:, order + 1]
        scale = np.abs(expected).max() + 1.0
        np.testing.assert_allclose(found, expected, atol=1e-4 * scale)


@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_arc_length_is_the_length_of_a_fine_polygon(seed: int) -> None:
    curve = mixed_curve(seed)
    sigma = np.unique(np.concatenate([np.linspace(0.0, curve.end, 10001), curve.breaks]))
    chords = np.linalg.norm(np.diff(curve.position(sigma), axis=0), axis=1)
    lengths = np.concatenate([[0.0], np.cumsum(chords)])
    np.testing.assert_allclose(curve.arc_length(sigma[::250]), lengths[::250], atol=2e-3)
    assert curve.length == pytest.approx(lengths[-1], abs=2e-3)


@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_bounds_hold_everywhere_on_each_piece(seed: int) -> None:
    curve = mixed_curve(seed)
    bounds = bound_curve(curve)
    sigma = np.linspace(0.0, curve.end, 3001)
    piece = curve.piece_at(sigma)
    found = np.abs(curve.derivatives(sigma))
    for order, bound in ((1, bounds.first), (2, bounds.second), (3, bounds.third)):
        assert (found[:, order] <= bound[piece] * (1 + 1e-12) + 1e-15).all()


@SETTINGS
@given(seed=st.integers(0, 10**6))
def test_a_curve_survives_json_exactly(seed: int) -> None:
    mixed = mixed_curve(seed)
    curve = Curve(mixed.spans, mixed.rates, mixed.coefficients, (1.25,))
    again = Curve.from_dict(json.loads(json.dumps(curve.to_dict())))
    sigma = np.linspace(0.0, curve.end, 101)
    assert (curve.derivatives(sigma) == again.derivatives(sigma)).all()
    assert again.rests == curve.rests
    assert again.end == curve.end


def test_sigma_is_arc_length_on_lines_and_arcs() -> None:
    line = round_corners(dg.Path.line((0, 0, 0), (3, 4, 12))).curve
    assert line.end == pytest.approx(13.0, rel=1e-15)
    arc = round_corners(dg.Path.arc((10, 0, 0), (0, 10, 0), (0, -10, 0))).curve
    assert arc.end == pytest.approx(15.0 * pi, rel=1e-14)
    for curve in (line, arc):
        tangents = curve.derivatives(np.linspace(0.0, curve.end, 50))[:, 1]
        np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1.0, atol=1e-14)


def test_an_arc_passes_through_its_three_points_on_one_circle() -> None:
    points = np.array([[-41.0, -20.0, 300.0], [-35.0, 3.0, 311.0], [-30.0, 25.0, 299.0]])
    curve = round_corners(dg.Path.arc(*points)).curve
    sigma = np.linspace(0.0, curve.end, 5001)
    track = curve.position(sigma)
    for point in points:
        assert np.linalg.norm(track - point, axis=1).min() < 1e-2
    np.testing.assert_allclose(track[[0, -1]], points[[0, 2]], atol=1e-11)
    second = curve.derivatives(sigma)[:, 2]
    np.testing.assert_allclose(np.linalg.norm(second, axis=1), curve.rates[0], rtol=1e-12)


def test_ten_metres_and_one_micrometre_are_lines_like_any_other() -> None:
    for length in (1e-3, 1e4):
        curve = round_corners(dg.Path.line((300, -152.5, 300), (300, -152.5 + length, 300))).curve
        assert curve.end == pytest.approx(length, rel=1e-9)
        assert np.linalg.norm(curve.derivatives(curve.end)[1]) == pytest.approx(1.0, abs=1e-12)


def test_a_curve_refuses_what_is_no_curve() -> None:
    with pytest.raises(dg.InputError, match="spans"):
        Curve(np.ones(2), np.zeros(1), np.zeros((2, 3, 3)))
    with pytest.raises(dg.InputError, match="above 0"):
        Curve(np.zeros(1), np.zeros(1), np.zeros((1, 3, 3)))
    with pytest.raises(dg.InputError, match="not a curve"):
        Curve.from_dict({"spans": [1.0]})
