from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

import duoglide as dg
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.model import inverse_derivatives
from duoglide.kinematics.singularity.case2 import curve_of, plain_curve
from duoglide.kinematics.singularity.margins import FAMILIES, clearance_gradient
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.kinematics.singularity.nearest_pose import SURFACES, nearest_of_pose

STEP = 2e-3  # [mm], between the points of a surface drawn densely
BRANCHES = [dg.WorkingMode(v=v) for v in (1, -1)]


def joint_frame(geometry: dg.Geometry) -> tuple[float, float, float, float]:
    """Return F1 and lift, and the platform's coordinates at which C3 meets B3."""
    g = geometry
    return (
        2.0 * (g.rail_half_spacing - g.platform_half_width),
        g.riser_height + g.arm_drop - g.strut_drop,
        g.platform_half_width - g.rail_half_spacing,
        g.carriage_height + g.strut_drop,
    )


def drawn_surfaces(geometry: dg.Geometry, v: int, points: int) -> np.ndarray:
    """Draw every surface whole, within reach or not, from its definition in PAPER, shape (n, 2)."""
    F1, lift, xb, zb = joint_frame(geometry)
    l2, l6, l9 = geometry.leg_length, geometry.arm_length, geometry.strut_length
    beta = v * np.linspace(0.0, np.pi, points)
    x = F1 - l6 * np.cos(beta)
    drawn = [(x, lift + rise + l6 * np.sin(beta)) for rise in (-l2, 0.0, l2)]
    drawn.append((l9 * np.cos(2.0 * beta), l9 * np.sin(2.0 * beta)))
    drawn += [(np.full(points, F1 + end), np.linspace(-800, 800, points)) for end in (-l6, l6)]
    drawn.append((x, -x * np.tan(beta)))
    if F1 == 0.0:  # then cos(beta) = 0 solves case 2 as well
        drawn.append((np.zeros(points), np.linspace(-800, 800, points)))
    cloud = np.concatenate([np.stack(surface, axis=-1) for surface in drawn])
    return cloud[np.abs(cloud).max(axis=1) < 900.0] + (xb, zb)


def test_clearance_is_the_distance_to_the_nearest_drawn_surface(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    """Pieces of a surface beyond the edge of reach are drawn too: they never are the nearest."""
    for geometry, mode in product(geometries[:6], BRANCHES):
        position = poses(geometry, mode, 300)
        found = dg.clearance(geometry, position, mode)
        tree = cKDTree(drawn_surfaces(geometry, mode.v, 20_000))
        drawn, _ = tree.query(position[:, [0, 2]])
        assert (found <= drawn + 1e-9).all()
        spacing = 0.12  # [mm], of the drawn points where a surface is not steep
        assert (found >= np.sqrt(np.maximum(drawn**2 - spacing**2, 0.0)) - 1e-6).all()


def test_clearance_is_exact_to_a_millionth_of_a_millimetre(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    """A surface redrawn about the nearest point with ever finer steps comes no nearer."""
    for geometry, mode in product(geometries[:8], BRANCHES):
        F1, _, xb, zb = joint_frame(geometry)
        position = poses(geometry, mode, 60)
        near = position - (
            clearance_gradient(geometry, position, mode)
            * dg.clearance(geometry, position, mode)[:, None]
        )
        sides = [surface_values(geometry, mode.v, point) for point in near]
        assert np.abs(sides).min(axis=1).max() < 1e-6
        assert np.isfinite((F1, xb, zb)).all()


def surface_values(geometry: dg.Geometry, v: int, point: np.ndarray) -> np.ndarray:
    """Evaluate what is zero on each surface, in mm, without clipping at the edge of reach."""
    F1, lift, xb, zb = joint_frame(geometry)
    l2, l6, l9 = geometry.leg_length, geometry.arm_length, geometry.strut_length
    X, Z = point[0] - xb, point[2] - zb
    u = X - F1
    arcs = [np.hypot(u, Z - lift - rise) - l6 for rise in (-l2, 0.0, l2)]
    A = v * np.sqrt(max(l6 * l6 - u * u, 0.0))
    return np.array([*arcs, abs(u) - l6, np.hypot(X, Z) - l9, (X * A - Z * u) / l6])


def test_clearance_of_one_pose_is_that_of_many(geometries: list[dg.Geometry], poses: Any) -> None:
    nearest = set()
    for geometry, mode in product(geometries, BRANCHES):
        position = poses(geometry, mode, 40)
        if not len(position):
            continue
        many = nearest_surface(geometry, mode.v, position)
        k, curve = pose_constants(geometry, mode), plain_curve(geometry, mode.v)
        alone = [nearest_of_pose(x, z, k, curve, np.inf) for x, _, z in position.tolist()]
        np.testing.assert_allclose([one[0] for one in alone], many.distance, rtol=0, atol=1e-9)
        same = np.array(SURFACES)[[one[3] for one in alone]] == many.family
        assert same.mean() > 0.95  # else two are equally near, as where they meet
        away = np.array([one[1:3] for one in alone])
        np.testing.assert_allclose(away[same], many.away[same][:, ::2], rtol=0, atol=1e-6)
        pose = tuple(position[0].tolist())
        assert dg.clearance(geometry, pose, mode) == alone[0][0]
        assert (clearance_gradient(geometry, pose, mode)[::2] == away[0]).all()
        nearest |= set(many.family)
    assert nearest == set(FAMILIES) - {"legs_parallel"}


def test_who_asks_up_to_a_distance_is_told_the_truth_up_to_it(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    for geometry, mode in product(geometries, BRANCHES):
        position = poses(geometry, mode, 40)
        whole = nearest_surface(geometry, mode.v, position).distance
        part = nearest_surface(geometry, mode.v, position, within=5.0).distance
        np.testing.assert_array_equal(part[whole < 5.0], whole[whole < 5.0])
        assert (part[whole >= 5.0] >= 5.0).all()


def test_of_one_pose_there_are_plain_numbers(geometry: dg.Geometry) -> None:
    for pose in ((-41.0, 0.0, 302.0), [-41, 0, 302], np.array([-41.0, 0.0, 302.0])):
        room, within = dg.clearance(geometry, pose), dg.reachable(geometry, pose)
        assert isinstance(room, float)
        assert isinstance(within, np.bool_)
        assert (round(room, 1), bool(within)) == (67.4, True)
        assert all(isinstance(m, float) for m in dg.margins(geometry, pose).by_family().values())


def test_no_surface_is_nearer_than_clearance_along_any_ray(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    """Inside the circle of that radius no margin changes sign and every pose is reached."""
    angles = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    ring = np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=-1)
    for geometry, mode in product(geometries, BRANCHES):
        position = poses(geometry, mode, 40)
        radius = dg.clearance(geometry, position, mode)[:, None, None] * (1.0 - 1e-9)
        around = position[:, None, :] + radius * ring
        assert dg.reachable(geometry, around, mode).all()
        here, there = dg.margins(geometry, position, mode), dg.margins(geometry, around, mode)
        for family in ("legs_flat", "arm_strut"):
            side = np.sign(getattr(here, family))[:, None]
            assert (side * getattr(there, family) >= -1e-9).all()


def test_clearance_does_not_jump_where_the_rails_come_as_near_as_the_platform_is_wide(
    poses: Any,
) -> None:
    """For b = d the pole of case 2 becomes a line; just beside it, the curve must follow that."""
    for spread, tolerance in ((1e-3, 0.5), (-1e-6, 1e-2), (1e-10, 1e-6)):
        exact = dg.Geometry(rail_half_spacing=60.0, platform_half_width=60.0, arm_drop=25.0)
        beside = replace(exact, rail_half_spacing=60.0 + spread)
        for mode in BRANCHES:
            position = poses(exact, mode, 200)
            position = position[dg.reachable(beside, position, mode)]
            jump = dg.clearance(beside, position, mode) - dg.clearance(exact, position, mode)
            assert np.abs(jump).max() < tolerance


def test_clearance_changes_no_faster_than_the_pose(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    for geometry, mode in product(geometries, BRANCHES):
        position = poses(geometry, mode, 100)
        if len(position) < 2:
            continue
        moved = position + poses.rng.normal(0.0, 1.0, position.shape)
        both = dg.reachable(geometry, moved, mode)
        change = dg.clearance(geometry, moved[both], mode) - dg.clearance(
            geometry, position[both], mode
        )
        way = np.linalg.norm((moved - position)[both], axis=1)
        assert (np.abs(change) <= way + 1e-9).all()


def test_the_gradient_points_straight_away_from_the_nearest_surface(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    checked = 0
    for geometry, mode in product(geometries, BRANCHES):
        position = poses(geometry, mode, 60)
        room = dg.clearance(geometry, position, mode)
        position = position[room > 0.01]
        away = clearance_gradient(geometry, position, mode)
        np.testing.assert_allclose(np.linalg.norm(away, axis=-1), 1.0, rtol=0, atol=1e-12)
        assert (away[:, 1] == 0.0).all()
        step = 1e-4
        slopes = [
            dg.clearance(geometry, position + step * sign * away, mode) for sign in (1.0, -1.0)
        ]
        rising = (slopes[0] - slopes[1]) / (2.0 * step)
        ridge = np.abs(slopes[0] - slopes[1]) < 1.9 * step  # two surfaces equally near
        assert ridge.mean() < 0.05
        np.testing.assert_allclose(rising[~ridge], 1.0, rtol=0, atol=1e-6)
        checked += (~ridge).sum()
    assert checked > 1500


def test_the_gradient_leads_back_into_reach_from_every_edge(geometry: dg.Geometry) -> None:
    for pose, inward in (
        ((225.0, 0.0, 150.0), (-1.0, 0.0, 0.0)),
        ((-45.0, 0.0, 370.0), (0.0, 0.0, -1.0)),
        ((45.0, 0.0, 90.0), (0.0, 0.0, 1.0)),
    ):
        assert dg.clearance(geometry, pose) == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(clearance_gradient(geometry, pose), inward, atol=1e-12)


def test_each_margin_is_zero_on_its_surface_and_only_there(geometry: dg.Geometry) -> None:
    on_surface = {
        "legs_vertical": (45.0, 5.0, 90.0),
        "strut": (-45.0, 5.0, 370.0),
        "legs_flat": (0.0, 5.0, 70.0 + np.sqrt(180.0**2 - 45.0**2)),
        "arm_flat": (225.0, 5.0, 150.0),
    }
    for family, pose in on_surface.items():
        sides = {
            key: abs(float(value)) for key, value in dg.margins(geometry, pose).by_family().items()
        }
        zero = {key for key, value in sides.items() if value < 1e-10}
        expected = {family, "legs_parallel"} if family == "legs_vertical" else {family}
        assert zero == expected
        assert dg.clearance(geometry, pose) == pytest.approx(0.0, abs=1e-10)
    assert tuple(sides) == FAMILIES


def test_case_2_is_within_reach_where_the_paper_says_it_does_not_exist(
    geometry: dg.Geometry,
) -> None:
    pose = (187.2797, 0.0, 250.0)
    np.testing.assert_allclose(
        dg.inverse(geometry, pose), (-203.9995, 203.9995, 60.3834), rtol=0, atol=2e-4
    )
    sides = dg.margins(geometry, pose)
    assert abs(sides.arm_strut) < 1e-4
    assert dg.clearance(geometry, pose) < 1e-4
    assert np.degrees(np.arccos((45.0 - 187.2797) / 180.0)) == pytest.approx(142.23, abs=0.005)
    piece = curve_of(geometry, 1).pieces[1]  # the other lies below legs flat, at x < -43
    x, z = piece.X - 45.0, piece.Z + 70.0
    assert (x.min(), x.max()) == pytest.approx((180.0, 225.0), abs=0.5)
    assert (z.min(), z.max()) == pytest.approx((80.0, 268.0), abs=12.0)


def test_legs_are_parallel_everywhere_where_both_lean_the_same_way(geometry: dg.Geometry) -> None:
    mode, pose = dg.WorkingMode(w1=1, w2=1), (-41.0, 0.0, 302.0)
    assert dg.margins(geometry, pose, mode).legs_parallel == 0.0
    assert dg.clearance(geometry, [pose, pose], mode).tolist() == [0.0, 0.0]
    with pytest.raises(dg.SingularityError) as caught:
        clearance_gradient(geometry, pose, mode)
    assert caught.value.family == "legs_parallel"


def test_legs_parallel_is_what_the_carriages_say(geometries: list[dg.Geometry], poses: Any) -> None:
    for geometry, mode in product(geometries, (dg.WorkingMode(), dg.WorkingMode(1, 1, -1, 1))):
        position = poses(geometry, mode, 20)
        carriages = dg.inverse(geometry, position, mode)
        B = carriages[:, 1] - carriages[:, 0] - geometry.coupler_length
        found = dg.margins(geometry, position, mode).legs_parallel
        np.testing.assert_allclose(found, np.abs(B), rtol=0, atol=1e-10)


def test_determinants_vanish_with_the_product_of_the_margins(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    """det J = det A / det B of Eq. 16, written with the margins: PAPER's two products."""
    for geometry, mode in product(geometries[:8], BRANCHES):
        position = poses(geometry, mode, 40)
        position = position[dg.clearance(geometry, position, mode) > 1e-3]
        sides = dg.margins(geometry, position, mode)
        x, _, z = position.T
        half_B = 0.5 * sides.legs_parallel
        _, _, xb, zb = joint_frame(geometry)
        q = np.sqrt(geometry.strut_length**2 - (x - xb) ** 2 - (z - zb) ** 2)
        u = x + xb
        sin_beta = np.sqrt(1.0 - (u / geometry.arm_length) ** 2)
        expected = np.abs(2.0 * sides.legs_flat * sides.arm_strut) / (half_B * q * sin_beta)
        found = np.abs(np.linalg.det(jacobians(geometry, position, mode)))
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9)


def jacobians(geometry: dg.Geometry, position: np.ndarray, mode: dg.WorkingMode) -> np.ndarray:
    """Differentiate along the axes, to be independent of the function under test."""
    columns = []
    for axis in np.eye(3):
        line = np.stack([position, np.broadcast_to(axis, position.shape)], axis=-2)
        columns.append(inverse_derivatives(geometry, line, mode)[:, 1])
    return np.stack(columns, axis=-1)


def test_the_deepest_point_and_its_depth_are_the_papers(geometry: dg.Geometry) -> None:
    x, z = np.meshgrid(np.linspace(-46.0, -36.0, 41), np.linspace(297.0, 307.0, 41))
    grid = np.stack([x, np.zeros_like(x), z], axis=-1)
    room = dg.clearance(geometry, grid)
    x, _, z = grid[np.unravel_index(room.argmax(), room.shape)]
    assert room.max() == pytest.approx(67.7, abs=0.05)
    assert (x, z) == pytest.approx((-41.0, 302.0), abs=0.5)


@pytest.mark.parametrize("function", [dg.margins, dg.clearance, clearance_gradient])
def test_beyond_reach_there_is_no_margin(geometry: dg.Geometry, function: Any) -> None:
    with pytest.raises(dg.UnreachableError):
        function(geometry, (0.0, 0.0, 900.0))


def test_least_is_the_least_of_all_six(geometry: dg.Geometry) -> None:
    sides = dg.margins(geometry, [(-41.0, 0.0, 302.0), (180.0, 0.0, 240.0)])
    expected = [min(abs(float(v[i])) for v in sides.by_family().values()) for i in range(2)]
    assert sides.least().tolist() == expected
