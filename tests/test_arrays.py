from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.arrays import as_floats, as_number, as_triples, read_only


@pytest.mark.parametrize(
    "value", ["text", b"1", None, True, [True, False], 1j, [[1.0], [1.0, 2.0]], {}]
)
def test_what_is_not_real_numbers_is_refused_by_name(value: Any) -> None:
    with pytest.raises(dg.InputError, match="speed must be real numbers"):
        as_floats(value, "speed")


def test_the_first_entry_that_is_not_finite_is_named() -> None:
    with pytest.raises(dg.InputError, match=r"path\[1, 2\] is nan; every value must be finite"):
        as_triples([[0.0, 0.0, 0.0], [0.0, 0.0, float("nan")]], "path")
    with pytest.raises(dg.InputError, match="speed is -inf"):
        as_number(float("-inf"), "speed")


@pytest.mark.parametrize("value", [1.0, [1.0, 2.0], [[1.0, 2.0, 3.0, 4.0]], np.zeros((3, 2))])
def test_triples_have_three_in_the_last_axis(value: Any) -> None:
    with pytest.raises(dg.InputError, match=r"path must have shape \(\.\.\., 3\)"):
        as_triples(value, "path")


def test_one_number_has_no_axes() -> None:
    assert as_number(np.float32(2.0), "speed") == 2.0
    with pytest.raises(dg.InputError, match="speed must be one number"):
        as_number([2.0], "speed")


def test_a_float64_array_is_not_copied_and_a_read_only_one_is() -> None:
    array = np.zeros((2, 3))
    assert as_triples(array, "path") is array
    frozen = read_only(array)
    array[0, 0] = 1.0
    assert frozen[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        frozen[0, 0] = 1.0
