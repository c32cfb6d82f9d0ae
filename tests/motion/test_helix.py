from __future__ import annotations

import pathlib
from math import cos, hypot, pi, sin

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.curve.bounds import bound_curve
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.rounded import round_corners
from duoglide.motion.path.segments import (
    Helix,
    Line,
    describe_segment,
    read_segment,
    reverse_segment,
)
from duoglide.planning.timing.motion_kernel import point

Z = (0.0, 0.0, 1.0)
RISING = Helix((10.0, 0.0, 300.0), (-10.0, 0.0, 306.0), (0.0, 0.0, 300.0), Z, 3.0 * pi)
ROUGH = Helix((10.0, 0.0, 300.0), (0.0, 10.004, 300.0), (0.0, 0.0, 300.0), Z, 0.5 * pi)
FLAT = Helix((10.0, 0.0, 300.0), (10.0, 0.0, 300.0), (0.0, 0.0, 300.0), (0.0, 0.0, -1.0), 2.0 * pi)
HELICES = pytest.mark.parametrize("helix", [RISING, ROUGH, FLAT], ids=["rising", "rough", "flat"])


def curve_of(*segments: Helix | Line) -> Curve:
    return round_corners(dg.Path(segments, (1.0,) * (len(segments) - 1))).curve


def test_a_helix_is_the_circle_and_an_even_rise() -> None:
    curve = curve_of(RISING)
    share = np.linspace(0.0, 1.0, 40)
    angle = 3.0 * pi * share
    expected = np.stack([10 * np.cos(angle), 10 * np.sin(angle), 300 + 6 * share], axis=-1)
    np.testing.assert_allclose(curve.position(share * curve.end), expected, atol=1e-12)
    assert curve.end == pytest.approx(hypot(30.0 * pi, 6.0), abs=1e-12)
    assert curve.length == curve.end


@HELICES
def test_derivatives_are_those_of_the_positions_in_every_form(helix: Helix) -> None:
    curve = curve_of(helix)
    sigma = np.linspace(0.01, 0.99, 23) * curve.end
    states = curve.derivatives(sigma)
    step = 1e-4
    ahead, behind = (curve.derivatives(sigma + s)[:, :3] for s in (step, -step))
    np.testing.assert_allclose(states[:, 1:], (ahead - behind) / (2.0 * step), atol=1e-8)
    for s, state in zip(sigma.tolist(), states, strict=True):
        np.testing.assert_allclose(curve.derivatives(s), state, atol=1e-13)
        out = np.empty((4, 3))
        point.py_func(s, curve.end, float(curve.rates[0]), curve.coefficients[0], out)
        np.testing.assert_allclose(out, state, atol=1e-13)


@HELICES
def test_its_length_is_that_of_a_fine_polyline(helix: Helix) -> None:
    curve = curve_of(helix)
    points = curve.position(np.linspace(0.0, curve.end, 200_001))
    fine = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    assert curve.length == pytest.approx(fine, abs=2e-8)
    half = curve.arc_length(0.5 * curve.end)
    fine_half = float(np.linalg.norm(np.diff(points[:100_001], axis=0), axis=1).sum())
    assert half == pytest.approx(fine_half, abs=2e-8)


@HELICES
def test_it_ends_where_it_is_programmed_to_the_last_digits(helix: Helix) -> None:
    curve = curve_of(helix)
    np.testing.assert_allclose(curve.position(0.0), helix.start, atol=0.0)
    np.testing.assert_allclose(curve.position(curve.end), helix.end, atol=1e-12)


@HELICES
def test_bounds_hold_along_it(helix: Helix) -> None:
    curve = curve_of(helix)
    states = np.abs(curve.derivatives(np.linspace(0.0, curve.end, 5_000)))
    bounds = bound_curve(curve)
    for order, bound in enumerate((bounds.first, bounds.second, bounds.third), start=1):
        assert (states[:, order].max(axis=0) <= bound[0]).all()
        assert (bound[0] <= states[:, order].max(axis=0) * 1.01 + 1e-6).all()


def test_corners_of_a_helix_are_rounded_on_the_helix() -> None:
    before = Line((30.0, 0.0, 300.0), RISING.start)
    after = Line(RISING.end, (-40.0, 0.0, 306.0))
    rounded = round_corners(dg.Path((before, RISING, after), (0.5, 0.3)))
    assert rounded.deviation[1:3] == pytest.approx([0.5, 0.3], abs=1e-6)
    curve = rounded.curve
    assert curve.rests == ()
    one, other = curve.both_sides(0.0, 0.0, np.arange(curve.count - 1))
    np.testing.assert_allclose(one[:, :3], other[:, :3], atol=1e-9)
    middle = int(np.argmax(curve.rates))
    raw = curve_of(RISING)
    start = float(curve.breaks[middle])
    cut = float(rounded.after[1])
    along = np.linspace(0.0, float(curve.spans[middle]), 50)
    np.testing.assert_allclose(curve.position(start + along), raw.position(cut + along), atol=1e-11)


@HELICES
def test_the_way_back_goes_through_the_same_points(helix: Helix) -> None:
    there, back = curve_of(helix), curve_of(reverse_segment(helix))  # type: ignore[arg-type]
    share = np.linspace(0.0, 1.0, 33)
    np.testing.assert_allclose(
        back.position(share * back.end), there.position((1.0 - share) * there.end), atol=1e-10
    )
    again = reverse_segment(reverse_segment(helix))
    assert isinstance(again, Helix)
    np.testing.assert_allclose(again.centre, helix.centre, atol=1e-12)


@HELICES
def test_plain_values_give_the_very_same_helix(helix: Helix) -> None:
    assert read_segment(describe_segment(helix)) == helix


@pytest.mark.parametrize(
    ("values", "match"),
    [
        ({"sweep": 0.0}, "sweep of 0 rad"),
        ({"sweep": float("nan")}, "sweep of nan rad"),
        ({"sweep": 1e300}, r"sweep of 1e\+300 rad"),
        ({"axis": (0.0, 0.0, 2.0)}, "length 1"),
        ({"centre": (10.0, 0.0, 300.0)}, "is its start"),
        ({"centre": (0.0, 0.0, 301.0)}, "1 mm along the axis"),
        ({"end": (-10.1, 0.0, 306.0)}, "0.1 mm off the circle"),
    ],
)
def test_what_is_no_helix_is_refused(values: dict[str, object], match: str) -> None:
    good = {"start": RISING.start, "end": RISING.end, "centre": RISING.centre, "axis": Z}
    with pytest.raises(dg.InputError, match=match):
        Helix(**({**good, "sweep": 3.0 * pi} | values))  # type: ignore[arg-type]


@pytest.mark.parametrize("missing", ["centre", "axis", "sweep", "points"])
def test_a_plan_without_a_part_of_a_helix_is_refused(missing: str) -> None:
    table = describe_segment(RISING)
    del table[missing]
    with pytest.raises(dg.InputError):
        read_segment(table)


def test_a_helix_is_planned_within_limits_saved_and_loaded(tmp_path: pathlib.Path) -> None:
    centre = (-41.0, 0.0, 300.0)
    start = (-41.0 + 15.0, 0.0, 300.0)
    end = (-41.0 + 15.0 * cos(1.0), 15.0 * sin(1.0), 312.0)
    path = dg.Path((Helix(start, end, centre, Z, 2.0 * pi + 1.0, 400.0),))
    trajectory = dg.plan(dg.Machine.default(), path)
    audit = trajectory.audit()
    for use in (audit.velocity, audit.acceleration, audit.jerk):
        assert np.max(use) <= 1.0 + 1e-6
    np.testing.assert_allclose(trajectory.position_at(trajectory.duration), end, atol=1e-9)
    trajectory.save(tmp_path / "helix.mcap")
    again = dg.Trajectory.load(tmp_path / "helix.mcap")
    assert again.path.checked.path == path  # type: ignore[union-attr]
    times = np.linspace(0.0, trajectory.duration, 100)
    assert np.array_equal(again.at(times).carriages, trajectory.at(times).carriages)
