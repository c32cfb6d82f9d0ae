"""Tables 1 to 3 of [Shen2021]."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

import duoglide as dg
from duoglide.paper.topology import analyse, delta, duoglide_robot

TABLE_1 = {
    "rail_half_length": 360, "rail_half_spacing": 90, "platform_half_width": 45,
    "carriage_height": 70, "leg_length": 160, "coupler_length": 120, "riser_height": 0,
    "arm_length": 180, "arm_drop": 0, "strut_drop": 0, "strut_length": 300,
}  # fmt: skip
CARRIAGES = (-111.24, 244.70, 246.92)  # measured, Section 2.3.4
POSITION = (-80.39, 66.73, 307.23)  # measured; Tables 2 and 3 start from one of the two each
TABLE_2 = {
    (1, 1): (-80.3862, 66.7300, 307.2328),
    (1, -1): (194.7183, 66.7300, 78.1662),
    (-1, 1): (194.7183, 66.7300, 61.8338),
    (-1, -1): (-80.3862, 66.7300, -167.2328),
}
TABLE_3 = [
    (124.6992, 244.6992, 246.9229), (124.6992, 244.6992, -113.4629),
    (124.6992, 8.7608, 246.9229), (124.6992, 8.7608, -113.4629),
    (-111.2392, 244.6992, 246.9229), (-111.2392, 244.6992, -113.4629),
    (-111.2392, 8.7608, 246.9229), (-111.2392, 8.7608, -113.4629),
]  # fmt: skip
ROUNDED = 6e-5  # [mm]; the tables have four decimals


def test_table_1_is_the_default_geometry() -> None:
    assert asdict(dg.Geometry()) == TABLE_1


def test_table_2_lists_the_forward_solutions() -> None:
    found = dg.forward_all(dg.Geometry(), CARRIAGES)
    assert [(s.mode.m, s.mode.n) for s in found] == list(TABLE_2)
    for solution in found:
        expected = TABLE_2[solution.mode.m, solution.mode.n]
        assert solution.position == pytest.approx(expected, abs=ROUNDED)


def test_table_3_lists_the_inverse_solutions() -> None:
    found = dg.inverse_all(dg.Geometry(), POSITION)
    assert len(found) == 8  # v = -1 reaches nothing there
    assert np.array([s.carriages for s in found]) == pytest.approx(np.array(TABLE_3), abs=ROUNDED)


def test_six_columns_of_table_3_can_be_built_and_two_of_them_are_regular() -> None:
    found = dg.inverse_all(dg.Geometry(), POSITION)
    assert [i for i, s in enumerate(found, 1) if s.realisable] == [1, 2, 5, 6, 7, 8]
    assert [i for i, s in enumerate(found, 1) if s.realisable and s.singular] == [1, 2, 7, 8]


def test_the_starred_columns_are_the_machine_s_own_modes() -> None:
    assert dg.WorkingMode() == dg.inverse_all(dg.Geometry(), POSITION)[4].mode
    assert dg.AssemblyMode() == dg.forward_all(dg.Geometry(), CARRIAGES)[0].mode


def test_the_measured_values_agree_as_far_as_they_are_rounded() -> None:
    assert dg.forward(dg.Geometry(), CARRIAGES) == pytest.approx(POSITION, abs=0.005)
    assert dg.inverse(dg.Geometry(), POSITION) == pytest.approx(CARRIAGES, abs=0.005)


def test_topological_characteristics_of_section_2_2() -> None:
    topology = analyse(duoglide_robot())
    assert str(topology.poc) == "(t3, r0)"
    assert [soc.xi for soc in topology.decomposition.socs] == [3, 5]
    assert [soc.freedoms for soc in topology.decomposition.socs] == [6, 5]
    assert topology.dof == 3
    assert topology.decomposition.constraint_degrees == (1, -1)
    assert topology.coupling_degree == 1


def test_joint_counts_against_delta() -> None:
    assert (duoglide_robot().physical_joints, delta().physical_joints) == (17, 21)
    assert delta().physical_links == 17


def test_partial_decoupling_y_depends_on_carriages_1_and_2_alone() -> None:
    random = np.random.default_rng(3)
    start = dg.inverse(dg.Geometry(), (-41.0, 0.0, 302.0))
    moved = start + random.uniform(-5.0, 5.0, (200, 3)) * [0.0, 0.0, 1.0]
    positions = dg.forward(dg.Geometry(), moved)
    assert np.abs(positions[:, 1]).max() < 1e-12
    assert np.ptp(positions[:, [0, 2]], axis=0).min() > 1.0


def test_moving_all_carriages_together_moves_y_one_to_one() -> None:
    start = dg.inverse(dg.Geometry(), (-41.0, 0.0, 302.0))
    shift = np.linspace(-100.0, 100.0, 21)
    positions = dg.forward(dg.Geometry(), start + shift[:, None])
    assert positions[:, 1] == pytest.approx(shift, abs=1e-10)
    assert np.ptp(positions[:, [0, 2]], axis=0).max() < 1e-9
