from __future__ import annotations

import numpy as np
import pytest

from duoglide.errors import InputError
from duoglide.motion.profile import Profile


def _random_profile(seed: int, count: int = 12) -> Profile:
    """Rest to rest, by integrating a jerk that is constant in each piece."""
    rng = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.001, 0.02, count))])
    speed = np.concatenate([[0.0], rng.uniform(50.0, 900.0, count - 1), [0.0]])
    rate = np.concatenate([[0.0], rng.uniform(-2e3, 2e3, count - 1), [0.0]])
    way = np.concatenate([[0.0], np.cumsum(np.diff(times) * 0.5 * (speed[1:] + speed[:-1]))])
    return Profile(np.column_stack([times, way, speed, rate]))


def _within_pieces(profile: Profile, points: int) -> np.ndarray:
    """Times (pieces, points), from the knot of each piece to the last time before the next."""
    knots = profile.knots[:, 0]
    return np.linspace(knots[:-1], np.nextafter(knots[1:], 0.0), points, axis=1)


@pytest.mark.parametrize("seed", range(5))
def test_sigma_and_two_derivatives_are_continuous_at_knots(seed: int) -> None:
    profile = _random_profile(seed)
    inside = profile.at(_within_pieces(profile, 3))
    scale = np.abs(inside).max(axis=(0, 1))
    jump = np.abs(inside[1:, 0, :3] - inside[:-1, -1, :3])
    assert (jump <= 1e-11 * scale[:3]).all()
    assert np.abs(inside[:, 0, :3] - profile.knots[:-1, 1:]).max() == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_derivatives_are_those_of_sigma(seed: int) -> None:
    profile = _random_profile(seed)
    times = _within_pieces(profile, 401)
    inside = profile.at(times)
    step = np.diff(times, axis=1)[:, :, None]
    for order in range(3):
        slope = np.diff(inside[..., order], axis=1) / step[..., 0]
        middle = 0.5 * (inside[:, 1:, order + 1] + inside[:, :-1, order + 1])
        assert slope == pytest.approx(middle, rel=1e-3, abs=1e-4 * np.abs(middle).max())


def test_one_time_and_many_agree_to_the_last_digit() -> None:
    profile = _random_profile(1)
    times = np.linspace(-0.01, profile.duration + 0.01, 333)
    one_by_one = np.array([profile.at_time(float(t)) for t in times])
    assert np.array_equal(one_by_one, profile.at(times))


def test_times_beyond_the_ends_are_clamped() -> None:
    profile = _random_profile(2)
    assert profile.at_time(-1.0) == profile.at_time(0.0)
    assert profile.at_time(1e9) == profile.at_time(profile.duration)


def test_time_at_finds_the_first_arrival() -> None:
    joined = Profile.join([_random_profile(3), Profile.rest(_random_profile(3).end, 0.5)])
    arrival = _random_profile(3).duration
    assert joined.time_at(joined.end) == arrival
    assert joined.duration == pytest.approx(arrival + 0.5, rel=1e-15)
    for t in np.linspace(0.001, arrival - 0.001, 17):
        assert joined.time_at(joined.at_time(float(t))[0]) == pytest.approx(t, abs=1e-12)


def test_stretching_divides_each_derivative() -> None:
    profile = _random_profile(4)
    times = np.linspace(0.0, profile.duration, 50)
    slow = profile.stretch(2.0).at(2.0 * times)
    assert slow == pytest.approx(profile.at(times) / [1.0, 2.0, 4.0, 8.0], rel=1e-8, abs=1e-6)


@pytest.mark.parametrize(
    "knots",
    [
        [[0.0, 0.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
        [[0.1, 0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]],
        [[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0, 0.0], [1.0, float("nan"), 0.0, 0.0]],
    ],
)
def test_knots_that_are_no_motion_are_refused(knots: list[list[float]]) -> None:
    with pytest.raises(InputError):
        Profile(knots)
