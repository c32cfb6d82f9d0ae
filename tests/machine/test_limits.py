from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import duoglide as dg


def test_one_number_counts_for_all_three_carriages() -> None:
    limits = dg.CarriageLimits(velocity=1000, acceleration=[1e4, 2e4, 3e4], jerk=np.float64(1e6))
    assert limits.velocity.tolist() == [1000.0] * 3
    assert limits.acceleration.tolist() == [1e4, 2e4, 3e4]
    assert limits.jerk.tolist() == [1e6] * 3


def test_the_defaults_are_those_of_the_design() -> None:
    limits = dg.CarriageLimits()
    assert limits.velocity.tolist() == [4000.0] * 3
    assert limits.acceleration.tolist() == [60e3] * 3
    assert limits.jerk.tolist() == [3e6] * 3


@pytest.mark.parametrize("key", ["velocity", "acceleration", "jerk"])
@pytest.mark.parametrize(
    "value",
    [0.0, -1.0, float("nan"), -float("inf"), "fast", [1.0, 2.0], [1.0, 2.0, 0.0], True, None],
)
def test_a_limit_is_positive_and_finite(key: str, value: Any) -> None:
    with pytest.raises(dg.ConfigError, match=f"^{key} = "):
        dg.CarriageLimits(**{key: value})


def test_jerk_may_be_without_a_limit_for_all_carriages_or_for_some(tmp_path: Path) -> None:
    for key in ("velocity", "acceleration"):
        with pytest.raises(dg.ConfigError, match=f"^{key} = inf"):
            dg.CarriageLimits(**{key: np.inf})
    free = dg.CarriageLimits(jerk=np.inf)
    assert free.jerk.tolist() == [np.inf] * 3
    assert dg.CarriageLimits(jerk=[np.inf, 1e6, np.inf]).jerk.tolist() == [np.inf, 1e6, np.inf]
    for wrong in (-np.inf, [np.inf, 0.0, 1e6], [np.inf, np.nan, 1e6], [np.inf, 1e6]):
        with pytest.raises(dg.ConfigError, match=r"^jerk = "):
            dg.CarriageLimits(jerk=wrong)
    machine = dg.Machine(limits=free)
    assert machine.stop_limits.jerk.tolist() == [np.inf] * 3
    machine.save(tmp_path / "cell.toml")
    assert dg.Machine.load(tmp_path / "cell.toml") == machine
    assert dg.Machine.from_dict(json.loads(json.dumps(machine.to_dict()))) == machine
    (tmp_path / "short.toml").write_text("[limits]\njerk = inf\n")
    assert dg.Machine.load(tmp_path / "short.toml") == machine
    with pytest.raises(dg.ConfigError, match=r"stop_limits\.jerk"):
        dg.Machine(limits=free, stop_limits=dg.CarriageLimits(acceleration=1e5, jerk=1e9))


def test_limits_are_values_that_nobody_can_write_to() -> None:
    limits, same = dg.CarriageLimits(velocity=1.0), dg.CarriageLimits(velocity=[1.0, 1.0, 1.0])
    assert limits == same
    assert hash(limits) == hash(same)
    assert limits != dg.CarriageLimits(velocity=2.0)
    assert limits != "limits"
    assert pickle.loads(pickle.dumps(limits)) == limits
    with pytest.raises(ValueError, match="read-only"):
        limits.velocity[0] = 2.0


def test_limits_do_not_share_the_callers_array() -> None:
    given = np.array([1.0, 2.0, 3.0])
    limits = dg.CarriageLimits(velocity=given)
    given[0] = 99.0
    assert limits.velocity[0] == 1.0


def test_scaling_scales_every_derivative() -> None:
    half = dg.CarriageLimits().scaled(0.5)
    assert half == dg.CarriageLimits(velocity=2000.0, acceleration=30e3, jerk=1.5e6)
