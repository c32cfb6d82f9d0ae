from __future__ import annotations

from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg

TABLE_1 = {
    "rail_half_length": 360.0,
    "rail_half_spacing": 90.0,
    "platform_half_width": 45.0,
    "carriage_height": 70.0,
    "leg_length": 160.0,
    "coupler_length": 120.0,
    "riser_height": 0.0,
    "arm_length": 180.0,
    "arm_drop": 0.0,
    "strut_drop": 0.0,
    "strut_length": 300.0,
}
SIGNED = {"riser_height", "arm_drop", "strut_drop", "carriage_height", "platform_half_width"}


def test_table_1_is_the_default() -> None:
    assert {f.name: getattr(dg.Geometry(), f.name) for f in fields(dg.Geometry)} == TABLE_1


@pytest.mark.parametrize("key", TABLE_1)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), "160", None, [160.0], True, 1j])
def test_a_length_that_is_no_finite_number_is_refused_by_name(key: str, value: Any) -> None:
    with pytest.raises(dg.ConfigError, match=rf"^{key} = .*must be one finite number \[mm\]$"):
        dg.Geometry(**{key: value})


@pytest.mark.parametrize("key", sorted(TABLE_1.keys() - SIGNED))
@pytest.mark.parametrize("value", [0.0, -5])
def test_a_link_has_a_length_above_zero(key: str, value: float) -> None:
    with pytest.raises(dg.ConfigError, match=rf"^{key} = {value:g}: must be above 0 \[mm\]$"):
        dg.Geometry(**{key: value})


@pytest.mark.parametrize("key", sorted(SIGNED))
def test_heights_and_drops_have_either_sign(key: str) -> None:
    assert getattr(dg.Geometry(**{key: -12}), key) == -12.0


def test_links_that_cannot_close_are_refused_with_the_length_that_would() -> None:
    with pytest.raises(dg.ConfigError, match=r"strut_length = 20: must be above .* mm") as caught:
        dg.Geometry(strut_length=20.0, arm_length=50.0)
    least = float(str(caught.value).split("above ")[1].split()[0])
    dg.Geometry(strut_length=least + 0.01, arm_length=50.0)
    with pytest.raises(dg.ConfigError, match="no pose of the platform closes the links"):
        dg.Geometry(strut_length=least - 0.01, arm_length=50.0)


@given(
    b=st.floats(10.0, 200.0),
    d=st.floats(-50.0, 200.0),
    l2=st.floats(20.0, 300.0),
    lift=st.floats(-200.0, 200.0),
    l6=st.floats(20.0, 400.0),
    l9=st.floats(1.0, 300.0),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_dimensions_are_refused_exactly_where_no_pose_exists(  # noqa: PLR0917
    b: float, d: float, l2: float, lift: float, l6: float, l9: float
) -> None:
    """C3 can be where the legs' lift and the arm's swing put it; look whether B3 is within l9."""
    alpha = np.linspace(-np.pi / 2, np.pi / 2, 401)[:, None]
    beta = np.linspace(-np.pi, np.pi, 801)[None, :]
    X, Z = 2.0 * (b - d) - l6 * np.cos(beta), lift + l2 * np.sin(alpha) + l6 * np.sin(beta)
    nearest = float(np.hypot(X, Z).min())
    slack = 0.01 * (l2 + l6)  # between the points of the grid
    try:
        dg.Geometry(
            rail_half_spacing=b,
            platform_half_width=d,
            leg_length=l2,
            riser_height=lift,
            arm_length=l6,
            strut_length=l9,
        )
    except dg.ConfigError:
        assert nearest > l9
    else:
        assert nearest <= l9 + slack


def test_a_geometry_is_a_value() -> None:
    longer = replace(dg.Geometry(), arm_length=181)
    assert longer != dg.Geometry()
    assert hash(longer) == hash(dg.Geometry(arm_length=181.0))
    with pytest.raises(FrozenInstanceError):
        longer.arm_length = 1.0  # type: ignore[misc]
    with pytest.raises(TypeError):
        dg.Geometry(360.0)  # type: ignore[misc]
