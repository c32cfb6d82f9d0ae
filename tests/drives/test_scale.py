from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.drives.scale import Scale
from duoglide.errors import LimitError
from duoglide.machine import DriveSettings

scales = st.floats(0.1, 1e5).flatmap(lambda s: st.sampled_from([Scale(s), Scale(-s)]))


@settings(max_examples=50, deadline=None)
@given(scales, st.floats(-1000.0, 1000.0))
def test_a_position_is_kept_to_half_an_increment(scale: Scale, mm: float) -> None:
    back = scale.to_mm(scale.to_increments(mm))
    assert abs(back - mm) <= 0.5000001 / abs(scale.increments_per_mm)


@settings(max_examples=50, deadline=None)
@given(scales, st.lists(st.floats(-1000.0, 1000.0), min_size=1))
def test_many_positions_are_rounded_as_one_is(scale: Scale, mm: list[float]) -> None:
    together = scale.to_increments_all(np.array(mm))
    assert together.tolist() == [scale.to_increments(value) for value in mm]


def test_a_drive_may_count_against_y() -> None:
    scale = Scale.of(DriveSettings(direction=(1, -1, 1)), 2)
    assert scale.to_increments(2.5) == -2500
    assert scale.to_mm(-2500) == 2.5
    assert scale.magnitude(2.5) == 2500


def test_a_position_that_no_drive_can_count_is_refused() -> None:
    with pytest.raises(LimitError, match="beyond what a drive can count"):
        Scale(1e6).to_increments(3000.0)
    with pytest.raises(LimitError, match="beyond what a drive can count"):
        Scale(1e6).to_increments_all(np.array([0.0, -3000.0]))


def test_a_deceleration_that_no_drive_can_be_told_is_refused() -> None:
    assert Scale(1e4).magnitude(60e3) == 600_000_000
    with pytest.raises(LimitError, match=r"42949\.7, at 100000 increments per mm"):
        Scale(1e5).magnitude(60e3)
