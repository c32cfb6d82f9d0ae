from __future__ import annotations

import json

import numpy as np
import pytest

from duoglide.errors import InputError
from duoglide.motion.stop_bounds import RateTable, StopBounds, change_time


def table(slope: list[float], until: float) -> RateTable:
    values = np.array(slope)
    return RateTable(values, 100.0 * values, np.full(values.size, until))


def test_the_document_brings_the_bounds_back_exactly() -> None:
    rng = np.random.default_rng(3)
    down, up = (
        RateTable(rng.uniform(5, 50, 17), rng.uniform(100, 1e5, 17), np.full(17, np.pi))
        for _ in range(2)
    )
    bounds = StopBounds(np.pi, down, up)
    again = StopBounds.from_dict(json.loads(json.dumps(bounds.to_dict())))
    assert again == bounds
    assert hash(again) == hash(bounds)
    assert again != StopBounds(np.pi, up, down)


def test_the_bounds_of_a_cell_hold_from_its_start_to_its_end() -> None:
    bounds = StopBounds(2.0, table([1.0, 2.0, 3.0, 4.0], 2.0), table([5.0, 6.0, 7.0, 8.0], 2.0))
    times = (-1.0, 0.0, 0.49, 0.5, 1.99, 2.0, 9.0)
    assert [bounds.falling_at(u).slope for u in times] == [1.0, 1.0, 1.0, 2.0, 4.0, 4.0, 4.0]
    assert [bounds.rising_at(u).slope for u in times] == [5.0, 5.0, 5.0, 6.0, 8.0, 8.0, 8.0]


def test_the_change_time_is_that_of_a_jerk_limited_ramp() -> None:
    slope, bend = np.array([20.0, 1000.0]), np.array([2000.0, 2000.0])
    np.testing.assert_allclose(change_time(slope, bend), [0.06, 2 / np.sqrt(2000.0)])


def test_impossible_bounds_are_refused() -> None:
    one = np.ones(2)
    with pytest.raises(InputError, match="above zero"):
        RateTable(0 * one, one, one)
    with pytest.raises(InputError, match="same shape"):
        RateTable(one, np.ones(3), one)
    with pytest.raises(InputError, match="shape"):
        RateTable(np.ones(0), np.ones(0), np.ones(0))
    fine = RateTable(10 * one, 100 * one, 10 * one)
    with pytest.raises(InputError, match=r"falling.until\[0\]"):
        StopBounds(10.0, RateTable(10 * one, 100 * one, np.array([4.0, 10.0])), fine)
    with pytest.raises(InputError, match="as many cells"):
        StopBounds(10.0, fine, table([1.0], 10.0))
    with pytest.raises(InputError, match="key"):
        StopBounds.from_dict({"duration": 1.0})
    with pytest.raises(InputError, match="negative"):
        StopBounds.constant(-1.0, 1.0, 1.0)
