from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest

import duoglide as dg

CAD_POSE = (-80.39, 66.73, 307.23)  # Section 2.3.4: measured in the 3D model
CAD_CARRIAGES = (-111.24, 244.70, 246.92)
TABLE_3 = np.array(
    [
        [124.6992, 124.6992, 124.6992, 124.6992, -111.2392, -111.2392, -111.2392, -111.2392],
        [244.6992, 244.6992, 8.7608, 8.7608, 244.6992, 244.6992, 8.7608, 8.7608],
        [246.9229, -113.4629, 246.9229, -113.4629, 246.9229, -113.4629, 246.9229, -113.4629],
    ]
).T


def test_table_3_comes_out_to_the_printed_digits_and_in_its_order(geometry: dg.Geometry) -> None:
    found = dg.inverse_all(geometry, CAD_POSE)
    assert len(found) == 8
    np.testing.assert_allclose([s.carriages for s in found], TABLE_3, rtol=0, atol=0.5001e-4)
    assert found[4].mode == dg.WorkingMode()


def test_six_of_table_3_can_be_built_and_four_are_singular(geometry: dg.Geometry) -> None:
    found = dg.inverse_all(geometry, CAD_POSE)
    columns = {i for i, s in enumerate(found, start=1) if s.realisable}
    singular = {i for i, s in enumerate(found, start=1) if s.singular}
    assert columns == {1, 2, 5, 6, 7, 8}
    assert singular == {1, 2, 7, 8}
    assert columns - singular == {5, 6}  # Section 2.3.4, observation 2


def test_table_2_has_four_rows_two_of_them_with_the_arm_below_its_pivot(
    geometry: dg.Geometry,
) -> None:
    found = dg.forward_all(geometry, CAD_CARRIAGES)
    assert [(s.mode.m, s.mode.n) for s in found] == [(1, 1), (1, -1), (-1, 1), (-1, -1)]
    expected = [
        (-80.3862, 66.73, 307.2328),
        (194.7183, 66.73, 78.1662),
        (194.7183, 66.73, 61.8338),
        (-80.3862, 66.73, -167.2328),
    ]
    np.testing.assert_allclose([s.position for s in found], expected, rtol=0, atol=0.5001e-4)
    branches = [solution_branch(geometry, s.position, CAD_CARRIAGES) for s in found]
    assert branches == [1, -1, 1, -1]


def solution_branch(geometry: dg.Geometry, position: np.ndarray, carriages: Any) -> int:
    """Find the sign v of the inverse solution that returns these carriages."""
    (v,) = {
        s.mode.v
        for s in dg.inverse_all(geometry, position)
        if np.allclose(s.carriages, carriages, rtol=0, atol=1e-6)
    }
    return v


def test_every_inverse_solution_leads_back_through_some_forward_solution(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    seen = 0
    for geometry in geometries:
        for pose in poses(geometry, dg.WorkingMode(), 5):
            for solution in dg.inverse_all(geometry, pose):
                if dg.clearance(geometry, pose, solution.mode) < 1e-2:
                    continue
                back = [s.position for s in dg.forward_all(geometry, solution.carriages)]
                assert np.abs(np.array(back) - pose).max(axis=1).min() < 1e-7
                seen += 1
    assert seen > 400


def test_carriages_cross_exactly_where_the_legs_do(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    """A leg runs from its carriage to its end of the coupler; compare the two at equal height."""
    crossed = 0
    for geometry in geometries:
        half = 0.5 * geometry.coupler_length
        for pose in poses(geometry, dg.WorkingMode(), 5):
            for solution in dg.inverse_all(geometry, pose):
                share = np.linspace(0.0, 1.0, 21)
                first = solution.carriages[0] * (1 - share) + (pose[1] - half) * share
                second = solution.carriages[1] * (1 - share) + (pose[1] + half) * share
                assert solution.realisable == bool((first < second).all())
                crossed += not solution.realisable
    assert crossed > 25


def test_only_solutions_on_a_surface_are_singular(geometry: dg.Geometry) -> None:
    edge = dg.inverse_all(geometry, (-45.0, 0.0, 370.0))
    assert edge
    assert all(solution.singular for solution in edge)
    inside = dg.inverse_all(geometry, (-41.0, 0.0, 302.0))
    assert [s.singular for s in inside] == [s.mode.w1 == s.mode.w2 for s in inside]


def test_both_signs_of_sin_beta_are_listed_where_both_reach(geometry: dg.Geometry) -> None:
    low = dg.inverse_all(geometry, (150.0, 0.0, 70.0))
    assert len(low) == 16
    assert {s.mode for s in low} == {dg.WorkingMode(*signs) for signs in product((1, -1), repeat=4)}


def test_nothing_is_listed_beyond_reach(geometry: dg.Geometry) -> None:
    assert dg.inverse_all(geometry, (0.0, 0.0, 900.0)) == []
    assert dg.forward_all(geometry, (0.0, 900.0, 0.0)) == []


def test_solutions_that_are_not_isolated_are_refused(geometry: dg.Geometry) -> None:
    with pytest.raises(dg.SingularityError, match="parallel"):
        dg.forward_all(geometry, TABLE_3[0])
    with pytest.raises(dg.SingularityError, match="flat"):
        dg.forward_all(geometry, (-220.0, 220.0, 240.0))


@pytest.mark.parametrize("value", [[[0.0, 0.0, 300.0]], (0.0, 300.0), (0.0, np.nan, 300.0)])
def test_one_finite_triple_is_asked_for(geometry: dg.Geometry, value: Any) -> None:
    for function in (dg.inverse_all, dg.forward_all):
        with pytest.raises(dg.InputError):
            function(geometry, value)


def test_solutions_cannot_be_written_to(geometry: dg.Geometry) -> None:
    solution = dg.inverse_all(geometry, CAD_POSE)[0]
    with pytest.raises(ValueError, match="read-only"):
        solution.carriages[0] = 0.0
