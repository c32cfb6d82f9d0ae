from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.transmission import transmission


def test_the_best_condition_is_where_the_paper_page_says(geometry: dg.Geometry) -> None:
    x, z = np.meshgrid(np.arange(-134.0, 225.0), np.arange(78.0, 370.0))
    grid = np.stack([x.ravel(), 0.0 * x.ravel(), z.ravel()], axis=-1)
    grid = grid[dg.reachable(geometry, grid)]
    grid = grid[dg.clearance(geometry, grid) > 0.01]
    best = 1.0 / transmission(geometry, grid).condition_number
    assert best.max() == pytest.approx(0.244, abs=5e-4)
    assert grid[best.argmax()].tolist() == [-70.0, 0.0, 331.0]


def test_ellipsoids_are_the_images_of_the_unit_sphere(geometry: dg.Geometry, poses: Any) -> None:
    position = poses(geometry, dg.WorkingMode(), 50)
    position = position[dg.clearance(geometry, position) > 0.5]
    shape = transmission(geometry, position)
    J = dg.jacobian(geometry, position)
    for i in range(3):
        velocity = shape.axes[:, i] * shape.velocity[:, i, None]
        force = shape.axes[:, i] * shape.force[:, i, None]
        speeds = np.einsum("nij,nj->ni", J, velocity)
        np.testing.assert_allclose(np.linalg.norm(speeds, axis=1), 1.0, rtol=1e-9)
        held = np.linalg.solve(np.swapaxes(J, 1, 2), force[..., None])[..., 0]
        np.testing.assert_allclose(np.linalg.norm(held, axis=1), 1.0, rtol=1e-9)
    np.testing.assert_allclose(
        shape.axes @ np.swapaxes(shape.axes, 1, 2), np.broadcast_to(np.eye(3), J.shape), atol=1e-12
    )


def test_manipulability_is_the_inverse_determinant(geometry: dg.Geometry, poses: Any) -> None:
    position = poses(geometry, dg.WorkingMode(), 50)
    position = position[dg.clearance(geometry, position) > 0.5]
    found = transmission(geometry, position).manipulability
    determinant = np.linalg.det(dg.jacobian(geometry, position))
    np.testing.assert_allclose(found, 1.0 / np.abs(determinant), rtol=1e-9)


def test_a_parallel_singularity_frees_the_platform(geometry: dg.Geometry) -> None:
    flat = transmission(geometry, (0.0, 0.0, 70.0 + np.sqrt(180.0**2 - 45.0**2)))
    assert flat.velocity[-1] > 1e12
    assert flat.condition_number > 1e12
    assert flat.manipulability > 1e12
    stiff = transmission(geometry, (0.0, 0.0, 300.0), dg.WorkingMode(w1=1, w2=1))
    assert stiff.force[-1] < 1e-12


def test_the_edge_of_reach_has_no_ellipsoid(geometry: dg.Geometry) -> None:
    with pytest.raises(dg.SingularityError):
        transmission(geometry, (225.0, 0.0, 150.0))
