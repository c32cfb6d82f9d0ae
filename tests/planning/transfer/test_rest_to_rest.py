from __future__ import annotations

import numpy as np
import pytest
import ruckig
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.motion.path.transfer import TransferPath
from duoglide.planning.transfer.rest_to_rest import plan_rest_to_rest

STRAIGHT, FREE = ruckig.Synchronization.Phase, ruckig.Synchronization.Time


def alone(distance: float, velocity: float, acceleration: float, jerk: float) -> float:
    """Ask ruckig how long one carriage takes."""
    question, answer = ruckig.InputParameter(1), ruckig.Trajectory(1)
    question.target_position = [distance]
    question.max_velocity, question.max_acceleration = [velocity], [acceleration]
    question.max_jerk = [jerk]
    ruckig.Ruckig(1).calculate(question, answer)
    return float(answer.duration)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_it_arrives_at_rest_within_limits_a_million_apart(seed: int, straight: bool) -> None:
    rng = np.random.default_rng(seed)
    start = rng.uniform(-300.0, 300.0, 3)
    goal = start + rng.uniform(-300.0, 300.0, 3) * 10.0 ** rng.uniform(-6.0, 0.0)
    limits = dg.CarriageLimits(
        velocity=10 ** rng.uniform(0, 6, 3),
        acceleration=10 ** rng.uniform(1, 7, 3),
        jerk=10 ** rng.uniform(2, 9, 3),
    )
    breaks, table = plan_rest_to_rest(start, goal, limits, STRAIGHT if straight else FREE)
    path = TransferPath(dg.Machine.default(), breaks, table, 1.0)
    states = path.derivatives(np.linspace(0.0, path.duration, 2001))
    reserve = 1.0 + 1e-6
    assert np.all(np.abs(states[:, 1]) <= limits.velocity * reserve)
    assert np.all(np.abs(states[:, 2]) <= limits.acceleration * reserve)
    assert np.all(np.abs(states[:, 3]) <= limits.jerk * reserve)
    np.testing.assert_array_equal(states[0, 0], start)
    np.testing.assert_allclose(states[-1, 0], goal, atol=1e-7)
    assert np.all(np.abs(states[-1, 1]) <= 1e-4 * limits.velocity)


def test_it_takes_as_long_as_the_slowest_carriage_alone() -> None:
    limits = dg.Machine.default().limits
    breaks, _ = plan_rest_to_rest(np.zeros(3), np.array([10.0, -305.0, 40.0]), limits, FREE)
    assert breaks[-1] == pytest.approx(alone(305.0, 4000.0, 60e3, 3e6), rel=1e-9)


def test_with_equal_limits_it_goes_straight() -> None:
    way = np.array([100.0, -200.0, 50.0])
    breaks, table = plan_rest_to_rest(np.zeros(3), way, dg.Machine.default().limits, STRAIGHT)
    path = TransferPath(dg.Machine.default(), breaks, table, 1.0)
    q = path.derivatives(np.linspace(0.0, path.duration, 500))[:, 0]
    np.testing.assert_allclose(q, q[:, :1] * way / way[0], atol=1e-9)
