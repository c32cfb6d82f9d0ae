from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics import batch, constants, kernels


def test_where_nothing_can_be_cached_the_loops_are_compiled_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def njit(loop: Callable[..., int], **options: Any) -> Callable[..., int]:
        asked.append(options.get("cache", False))
        if options.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return loop

    monkeypatch.setattr(numba, "njit", njit)
    assert batch._compiled.__wrapped__(kernels.inverse_loop) is kernels.inverse_loop
    assert asked == [True, True, False]  # where numba likes it, beside temporary files, nowhere


def test_numba_is_loaded_once_numpy_has_answered_much(
    geometry: dg.Geometry, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = []

    @cache
    def load(loop: Callable[..., int]) -> Callable[..., int]:
        loaded.append(loop.__name__)
        return loop

    monkeypatch.setattr(batch, "_compiled", load)
    monkeypatch.setattr(batch._Answered, "poses", 0)
    monkeypatch.setattr(batch, "WORTH_LOADING", 2 * batch.WORTH_CALLING)
    some = np.tile([-41.0, 3.0, 302.0], (batch.WORTH_CALLING, 1))
    large = np.tile(some, (4, 1))
    expected = dg.inverse(geometry, large)  # at once, however large
    assert loaded == []
    assert batch._Answered.poses == len(large)
    np.testing.assert_array_equal(dg.inverse(geometry, some), expected[: len(some)])
    assert loaded == ["inverse_loop"]
    dg.margins(geometry, some[1:])  # too few to be worth a call
    assert loaded == ["inverse_loop"]


def test_the_loops_say_the_same_uncompiled(geometry: dg.Geometry) -> None:
    position = np.array([[-41.0, 3.0, 302.0], [20.0, -5.0, 300.0]])
    k = constants.pose_constants(geometry, dg.WorkingMode())
    carriages = np.empty(6)
    assert kernels.inverse_loop(position.ravel(), carriages, k) == 0
    np.testing.assert_array_equal(carriages.reshape(2, 3), dg.inverse(geometry, position))
    back = np.empty(6)
    assembly = constants.carriage_constants(geometry, dg.AssemblyMode())
    assert kernels.forward_loop(carriages, back, assembly) == 0
    np.testing.assert_allclose(back.reshape(2, 3), position, rtol=0, atol=1e-10)
    sides = np.empty(8)
    assert kernels.margins_loop(position.ravel(), sides, k) == 0
    found = dg.margins(geometry, position)
    legs = np.empty(4)
    assert kernels.legs_loop(sides[2:4], legs, k) == 0
    np.testing.assert_array_equal(legs.reshape(2, 2), [found.legs_vertical, found.legs_parallel])
    np.testing.assert_array_equal(
        sides.reshape(4, 2), [found.strut, found.legs_flat, found.arm_strut, found.arm_flat]
    )


@pytest.mark.parametrize("value", [(1.0, 2), [1.0, 2.0, np.float64(3.0)], (1, 2, 3), 5.0, None])
def test_only_three_plain_floats_take_the_short_way(value: Any) -> None:
    assert batch.as_pose(value) == ()
    assert batch.as_pose((1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    assert batch.as_pose(np.array([1.0, 2.0, 3.0])) == [1.0, 2.0, 3.0]
