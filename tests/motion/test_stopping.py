from __future__ import annotations

import json

import numpy as np
import pytest

from duoglide.errors import InputError
from duoglide.motion.stopping import StopBounds, change_time


def test_the_document_brings_the_bounds_back_exactly() -> None:
    rng = np.random.default_rng(3)
    slope, bend = rng.uniform(5, 50, 17), rng.uniform(100, 1e5, 17)
    bounds = StopBounds(np.pi, slope, bend, np.full(17, np.pi))
    again = StopBounds.from_dict(json.loads(json.dumps(bounds.to_dict())))
    assert again == bounds
    assert hash(again) == hash(bounds)


def test_the_bounds_of_a_cell_hold_from_its_start_to_its_end() -> None:
    slope = np.array([1.0, 2.0, 3.0, 4.0])
    bounds = StopBounds(2.0, slope, 100 * slope, np.full(4, 2.0))
    assert [bounds.at(u).slope for u in (-1.0, 0.0, 0.49, 0.5, 1.99, 2.0, 9.0)] == [
        1.0, 1.0, 1.0, 2.0, 4.0, 4.0, 4.0,
    ]  # fmt: skip


def test_the_change_time_is_that_of_a_jerk_limited_ramp() -> None:
    slope, bend = np.array([20.0, 1000.0]), np.array([2000.0, 2000.0])
    np.testing.assert_allclose(change_time(slope, bend), [0.06, 2 / np.sqrt(2000.0)])


def test_impossible_bounds_are_refused() -> None:
    one = np.ones(2)
    with pytest.raises(InputError, match="above zero"):
        StopBounds(1.0, 0 * one, one, one)
    with pytest.raises(InputError, match="same shape"):
        StopBounds(1.0, one, np.ones(3), one)
    with pytest.raises(InputError, match=r"until\[1\]"):
        StopBounds(10.0, 10 * one, 100 * one, np.array([6.0, 4.0]))
    with pytest.raises(InputError, match="key"):
        StopBounds.from_dict({"duration": 1.0})
    with pytest.raises(InputError, match="negative"):
        StopBounds.constant(-1.0, 1.0, 1.0)
