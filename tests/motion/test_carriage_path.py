from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages


@pytest.fixture(scope="module")
def carriage_path() -> CarriagePath:
    geometry = dg.Geometry(riser_height=7.0, arm_drop=-4.0, strut_drop=11.0)
    path = dg.pick_and_place((-41, -100, 295), (-30, 100, 290), tolerance=4.0)
    path = path.then(dg.Path.arc((-30, 100, 290), (-35, 60, 310), (-30, 20, 300)), 1.0)
    return map_to_carriages(dg.check_path(dg.Machine(geometry=geometry), path))


def test_one_point_in_floats_agrees_with_the_arrays(carriage_path: CarriagePath) -> None:
    sigma = np.linspace(0.0, carriage_path.curve.end, 101)
    many = carriage_path.derivatives(sigma)
    for s, expected in zip(sigma.tolist(), many, strict=True):
        np.testing.assert_allclose(carriage_path.derivatives(s), expected, rtol=1e-12, atol=1e-13)


def test_carriages_are_the_inverse_of_the_curve(carriage_path: CarriagePath) -> None:
    sigma = np.linspace(0.0, carriage_path.curve.end, 101)
    expected = dg.inverse(carriage_path.machine.geometry, carriage_path.curve.position(sigma))
    np.testing.assert_allclose(carriage_path.derivatives(sigma)[:, 0], expected, atol=1e-11)


def test_derivatives_are_those_of_the_carriages(carriage_path: CarriagePath) -> None:
    breaks = carriage_path.curve.breaks
    middle = 0.5 * (breaks[:-1] + breaks[1:])
    step = 1e-3
    for order in range(3):
        ahead = carriage_path.derivatives(middle + step)[:, order]
        behind = carriage_path.derivatives(middle - step)[:, order]
        found = carriage_path.derivatives(middle)[:, order + 1]
        np.testing.assert_allclose(found, (ahead - behind) / (2.0 * step), atol=1e-6)


def test_a_piece_names_the_side_of_a_break(carriage_path: CarriagePath) -> None:
    at = carriage_path.curve.breaks[1:2]
    left, right = (carriage_path.derivatives(at, np.array([side]))[0] for side in (0, 1))
    np.testing.assert_allclose(left[:3], right[:3], atol=1e-10)
    assert np.abs(left[3] - right[3]).max() > 1e-6
