from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.motion.path_clock import ClockState, PathClock
from duoglide.motion.stop_bounds import StopBounds
from duoglide.planning.stops.certificate import certify_stops
from duoglide.planning.stops.kernel import find_largest_slopes, find_windows

STEPS = 1400  # of a clock in the time of a trajectory
MACHINE = dg.Machine.default()
POINTS = [(-80, -100, 300), (40, 100, 290), (-41, 0, 302), (10, -150, 310), (-60, 120, 280)]


def moved(machine: dg.Machine, start: int = 0, goal: int = 1) -> dg.Trajectory:
    return dg.transfer(machine, POINTS[start], POINTS[goal], brake_safe=False)


def limits_used(trajectory: dg.Trajectory, times: np.ndarray, step: float) -> np.ndarray:
    """Worst use of stop_limits by finite differences of the carriages at these path times."""
    limits = trajectory.machine.stop_limits
    rows = trajectory.at(times).carriages
    uses = []
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        rows = np.diff(rows, axis=0) / step
        uses.append((np.abs(rows) / limit).max(initial=0.0))
    return np.array(uses)


def run(trajectory: dg.Trajectory, commands: list[tuple[int, str, float]]) -> np.ndarray:
    """Run a clock through commands and a stop at the end; return the path times."""
    step = trajectory.duration / STEPS
    clock = PathClock(trajectory.stops, step)
    times = [0.0]
    for steps, command, value in [*commands, (0, "stop", 0.0)]:
        times += [clock.step(step)[0] for _ in range(steps)]
        if command == "override":
            clock.set_override(value)
        else:
            getattr(clock, command)()
    while clock.state not in (ClockState.FINISHED, ClockState.STOPPED):
        times.append(clock.step(step)[0])
        assert len(times) < 20 * STEPS
    return np.array(times + [times[-1]] * 4)


def many_runs(trajectory: dg.Trajectory, rng: np.random.Generator, runs: int) -> np.ndarray:
    worst = np.zeros(3)
    names = ["hold", "resume", "override", "override", "resume", "stop"]
    for _ in range(runs):
        commands = [
            (int(rng.integers(1, STEPS // 4)), names[rng.integers(6)], float(rng.uniform()))
            for _ in range(rng.integers(1, 7))
        ]
        times = run(trajectory, commands)
        worst = np.maximum(worst, limits_used(trajectory, times, trajectory.duration / STEPS))
    return worst


@pytest.mark.parametrize(("start", "goal"), [(0, 1), (2, 3), (3, 4)])
def test_whatever_is_commanded_the_carriages_keep_their_stop_limits(start: int, goal: int) -> None:
    trajectory = moved(MACHINE, start, goal)
    worst = many_runs(trajectory, np.random.default_rng(start), 100)
    assert worst.max() <= 1.0 + 1e-3
    assert worst[2] > 0.6  # a change of rate makes use of the jerk that it is given


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(500.0, 6000.0),
    st.floats(5e3, 1.5e5),
    st.floats(1e5, 2e7),
    st.floats(1.05, 3.0),
)
def test_stop_limits_hold_for_any_limits(
    seed: int, velocity: float, acceleration: float, jerk: float, reserve: float
) -> None:
    limits = dg.CarriageLimits(velocity=velocity, acceleration=acceleration, jerk=jerk)
    stop = dg.CarriageLimits(
        velocity=velocity, acceleration=acceleration * reserve, jerk=jerk * reserve
    )
    machine = replace(MACHINE, limits=limits, stop_limits=stop)
    rng = np.random.default_rng(seed)
    start, goal = rng.permutation(len(POINTS))[:2]
    worst = many_runs(moved(machine, int(start), int(goal)), rng, 5)
    assert worst.max() <= 1.0 + 1e-3


def test_the_path_is_never_left() -> None:
    trajectory = moved(MACHINE)
    times = run(trajectory, [(300, "hold", 0.0), (800, "resume", 0.0), (200, "override", 0.3)])
    assert np.all(np.diff(times) >= 0.0)
    assert 0.0 <= times[0] <= times[-1] <= trajectory.duration
    # a setpoint is the trajectory's own at a path time: there is nothing else to be sent


def test_stops_come_near_to_what_no_stop_can_beat() -> None:
    """One carriage alone, at its speed, needs this long under its stop limits."""
    trajectory = moved(MACHINE)
    stop = trajectory.machine.stop_limits
    bounds = trajectory.stops
    cells = bounds.falling.slope.size
    state = trajectory.at((np.arange(cells) + 0.5) / cells * trajectory.duration)
    v, a, j = np.abs(state.velocity), stop.acceleration, stop.jerk
    least = np.where(v * j > a * a, v / a + a / j, 2.0 * np.sqrt(v / j)).max(axis=-1)
    fast = least > 0.5 * least.max()
    ratio = bounds.falling.change_times()[fast] / least[fast]
    assert np.median(ratio) < 2.4
    assert ratio.min() >= 1.0


def test_a_plan_that_leaves_no_reserve_can_still_be_stopped() -> None:
    machine = replace(MACHINE, stop_limits=MACHINE.limits)
    trajectory = moved(machine)
    worst = many_runs(trajectory, np.random.default_rng(5), 5)
    assert worst.max() <= 1.05
    assert np.isfinite(trajectory.stops.falling.change_times()).all()


def test_a_motion_that_goes_nowhere_has_bounds() -> None:
    still = dg.transfer(MACHINE, POINTS[0], POINTS[0])
    assert still.stops.duration == still.duration
    empty = SimpleNamespace(machine=MACHINE, duration=0.0, at=still.at)
    assert certify_stops(empty) == StopBounds.constant(0.0, 250.0, 62500.0)


@pytest.mark.parametrize("seed", range(8))
def test_the_largest_slope_uses_some_limit_fully_and_breaks_none(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rho, cells = float(rng.choice([1.0, 0.5, 0.2])), 20
    peaks = rng.uniform(0.0, np.array([4e3, 50e3, 2e6])[:, None, None], (2, 3, cells, 3))
    limits = np.array([np.full(3, 60e3), np.full(3, 3e6)])
    r = np.linspace(0.5, 1.0, 200)
    share = np.minimum(1.0, np.sqrt(2.0 * (1.0 - r) / rho))  # r' there, over R1
    found = np.full((2, cells), 1e9)
    find_largest_slopes(peaks, (limits, 0.0 * limits), (r, share), rho, found)
    speed, r, share = peaks[:, 0].max(axis=0)[:, None], r[:, None], share[:, None]
    for way, slopes in zip((-1, 1), found, strict=True):
        for factor, kept in ((1.0, True), (1.01, False)):
            slope, worst = factor * slopes[:, None, None], np.zeros(cells)
            for own, added in zip(peaks, peaks[::way], strict=True):
                v, a = added[0][:, None], added[1][:, None]
                acceleration = own[1][:, None] * r**2 + v * share * slope
                jerk = own[2][:, None] * r**3 + 3.0 * a * r * share * slope + speed * slope**2 / rho
                for limit, use in zip(limits, (acceleration, jerk), strict=True):
                    worst = np.maximum(worst, (use / limit).max(axis=(1, 2)))
            assert np.all((worst <= 1.0 + 1e-9) == kept)


def test_a_window_is_as_long_as_a_stop_with_the_least_slope_in_it() -> None:
    largest = np.random.default_rng(3).uniform(10.0, 100.0, 400)
    slope, last = find_windows(largest, 900.0)
    for k in range(400):
        assert slope[k] == largest[k : last[k] + 1].min()
        assert last[k] == 399 or last[k] - k >= 900.0 / slope[k]
