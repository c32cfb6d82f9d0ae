"""What the page on decoupling says of one carriage alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import duoglide as dg

PAGE = Path(__file__).parents[2] / "docs" / "decoupling.md"
HOME = (-41.0, 0.0, 302.0)
ODD = dg.Geometry(riser_height=12.0, arm_drop=8.0, strut_drop=-6.0, arm_length=190.0)


@pytest.mark.parametrize("geometry", [dg.Geometry(), ODD], ids=["Table 1", "other dimensions"])
def test_y_is_the_mean_of_carriages_1_and_2_in_every_mode(geometry: dg.Geometry) -> None:
    random = np.random.default_rng(7)
    start = dg.inverse(geometry, HOME)
    for carriages in start + random.uniform(-10.0, 10.0, (20, 3)):
        for solution in dg.forward_all(geometry, carriages):
            assert solution.position[1] == pytest.approx(carriages[:2].mean(), abs=1e-10)


def test_carriage_3_alone_leads_the_platform_along_a_circle_of_the_arm() -> None:
    start = dg.inverse(dg.Geometry(), HOME)
    moved = np.tile(start, (41, 1))
    moved[:, 2] += np.linspace(-20.0, 20.0, 41)
    x, y, z = dg.forward(dg.Geometry(), moved).T
    assert np.ptp(y) == 0.0
    alpha = np.arccos((start[1] - start[0] - 120.0) / 320.0)
    foot = 70.0 + 160.0 * np.sin(alpha)  # height of D2
    assert np.hypot(x + 45.0 - 90.0, z - foot) == pytest.approx(180.0, abs=1e-9)
    assert np.ptp(x) > 50.0


def test_x_or_z_alone_moves_carriages_1_and_2_opposite_ways_and_y_all_alike() -> None:
    along_x, along_y, along_z = dg.jacobian(dg.Geometry(), HOME).T
    assert along_x[0] == pytest.approx(-along_x[1])
    assert along_z[0] == pytest.approx(-along_z[1])
    assert along_y == pytest.approx([1.0, 1.0, 1.0])


def test_the_table_of_errors_is_that_of_the_jacobian() -> None:
    rows = re.findall(r"^\| (?:carriage|all).*?\| (.+) \|$", PAGE.read_text("utf-8"), re.M)
    told = [[float(cell) for cell in row.split("|")] for row in rows if row[0] in "-0123456789"]
    moved = np.linalg.inv(dg.jacobian(dg.Geometry(), HOME)).T
    assert np.array(told) == pytest.approx(np.vstack([moved, moved.sum(axis=0)]), abs=6e-4)
