from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.viewer.surfaces import singular_curves

FAMILIES = {
    "legs flat": "legs_flat",
    "legs vertical": "legs_vertical",
    "strut": "strut",
    "arm in line with strut": "arm_strut",
    "arm flat": "arm_flat",
}


@pytest.mark.parametrize(
    "geometry", [dg.Geometry(), dg.Geometry(riser_height=15.0, arm_drop=-6.0, strut_drop=11.0)]
)
def test_every_point_drawn_is_singular_in_its_family(geometry: dg.Geometry) -> None:
    curves = singular_curves(geometry)
    assert set(curves) == set(FAMILIES)
    for family, lines in curves.items():
        assert lines, family
        for line in lines:
            points = np.stack([line[:, 0], np.zeros(len(line)), line[:, 1]], axis=-1)
            inside = points[dg.reachable(geometry, points)]
            if len(inside):
                margin = getattr(dg.margins(geometry, inside), FAMILIES[family])
                # arm flat and legs vertical meet the surface as a square root: rounding shows
                np.testing.assert_allclose(margin, 0.0, atol=1e-4)


def test_case_2_is_drawn_where_the_paper_did_not_look(geometry: dg.Geometry) -> None:
    points = np.concatenate(singular_curves(geometry)["arm in line with strut"])
    assert np.hypot(points[:, 0] - 187.2797, points[:, 1] - 250.0).min() < 2.0
