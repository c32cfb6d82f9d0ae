from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.machine import rules


def test_numbers_of_numpy_are_numbers() -> None:
    assert rules.number("key", np.float32(2.5)) == 2.5
    assert rules.whole("key", np.int64(3), 0, 5) == 3
    assert rules.triple("key", np.arange(3)) == (0.0, 1.0, 2.0)
    assert rules.per_carriage("key", np.array(4.0), "mm") == (4.0, 4.0, 4.0)


@pytest.mark.parametrize("value", [[1.0, [2.0], 3.0], [[1.0], 2.0], "123", [], {"a": 1.0}])
def test_what_is_no_number_for_each_carriage_is_refused(value: object) -> None:
    with pytest.raises(dg.ConfigError, match="key = "):
        rules.per_carriage("key", value, "mm")


def test_zero_is_not_negative() -> None:
    assert rules.not_negative("key", 0) == 0.0
    with pytest.raises(dg.ConfigError, match=r"key = -0\.1: must be 0 or above"):
        rules.not_negative("key", -0.1)


def test_an_unknown_key_names_the_nearest_one_or_all() -> None:
    with pytest.raises(
        dg.ConfigError,
        match=r"geometry\.arm_lenght: no such key; did you mean "
        r"geometry\.arm_length\?",
    ):
        rules.build(dg.Geometry, {"arm_lenght": 1.0}, "geometry")
    with pytest.raises(dg.ConfigError, match="no such key; known: low, high, name"):
        rules.build(dg.Box, {"zzz": 1.0}, "keep_out[0]")


def test_what_is_not_a_table_is_refused() -> None:
    with pytest.raises(dg.ConfigError, match="limits = 5: must be a table"):
        rules.build(dg.CarriageLimits, 5, "limits")


def test_a_key_without_default_must_be_there() -> None:
    with pytest.raises(dg.ConfigError, match=r"keep_out\[0\]\.high: missing"):
        rules.build(dg.Box, {"low": [0, 0, 0]}, "keep_out[0]")
