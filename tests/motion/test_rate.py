from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.errors import InputError
from duoglide.motion.path_clock import ClockState, PathClock
from duoglide.motion.stop_bounds import RateTable, StopBounds, change_time

CYCLE = 0.002
BOUNDS = StopBounds.constant(2.0, slope=20.0, bend=2000.0)

commands = st.lists(
    st.tuples(
        st.integers(1, 60),
        st.sampled_from(["hold", "resume", "override", "stop"]),
        st.floats(0.0, 1.0),
    ),
    max_size=12,
)


def give(clock: PathClock, command: str, value: float) -> None:
    if command == "override":
        clock.set_override(value)
    else:
        getattr(clock, command)()


def test_full_rate_advances_exactly_by_the_cycle() -> None:
    clock = PathClock(BOUNDS, CYCLE)
    times = [clock.step(CYCLE)[0] for _ in range(900)]
    assert times == [k * CYCLE for k in range(1, 901)]


def test_two_clocks_with_the_same_commands_agree_to_the_last_bit() -> None:
    def run() -> list[float]:
        clock = PathClock(BOUNDS, CYCLE, override=0.3)
        times = []
        for k in range(800):
            if k % 97 == 13:
                clock.hold()
            if k % 97 == 51:
                clock.resume()
                clock.set_override((k % 10) / 10)
            times.append(clock.step(CYCLE)[0])
        return times

    assert run() == run()


def test_a_skipped_cycle_is_one_step_of_two_cycles() -> None:
    clock = PathClock(BOUNDS, CYCLE)
    clock.step(CYCLE)
    assert clock.step(2 * CYCLE)[0] == 3 * CYCLE


def test_the_end_is_the_duration_exactly_and_stays() -> None:
    bounds = StopBounds.constant(0.12345, 20.0, 2000.0)
    clock = PathClock(bounds, CYCLE)
    last = [clock.step(CYCLE) for _ in range(80)]
    assert last[-1] == (0.12345, 0.0)
    assert clock.state is ClockState.FINISHED
    clock.resume()
    assert clock.step(CYCLE) == (0.12345, 0.0)


def test_hold_comes_to_rest_in_the_certified_time_and_resume_goes_on() -> None:
    clock = PathClock(BOUNDS, CYCLE)
    for _ in range(100):
        clock.step(CYCLE)
    clock.hold()
    assert clock.state is ClockState.HOLDING
    for _ in range(int(BOUNDS.falling.change_times()[0] / CYCLE) + 2):
        held, rate = clock.step(CYCLE)
    assert clock.state is ClockState.HELD
    assert rate == 0.0
    assert clock.step(CYCLE) == (held, 0.0)
    clock.resume()
    for _ in range(200):
        _, rate = clock.step(CYCLE)
    assert (clock.state, rate) == (ClockState.RUNNING, 1.0)


def test_a_stop_is_latched() -> None:
    clock = PathClock(BOUNDS, CYCLE)
    clock.step(CYCLE)
    clock.stop()
    clock.resume()
    clock.set_override(1.0)
    for _ in range(200):
        clock.step(CYCLE)
    assert clock.state is ClockState.STOPPED
    assert clock.rate == 0.0


def test_a_change_that_the_bounds_do_not_cover_waits_until_they_do() -> None:
    slope, bend = np.array([50.0, 1.0]), np.array([5e3, 5e3])
    falling = RateTable(slope, bend, np.array([1.5, 2.0]))
    bounds = StopBounds(2.0, falling, falling)
    clock = PathClock(bounds, CYCLE, start=0.99, override=0.0)
    clock.set_override(1.0)
    while clock.path_time < 1.0001:  # rising at more than the second cell allows to begin with
        clock.step(CYCLE)
    clock.stop()
    rates = [clock.step(CYCLE)[1] for _ in range(1000)]
    assert max(rates) <= 1.0
    assert (clock.rate, clock.path_time) == (0.0, pytest.approx(1.5, abs=0.1))
    assert clock.state is ClockState.STOPPED


def test_a_stop_in_mid_rise_turns_at_once() -> None:
    clock = PathClock(BOUNDS, 1e-4, override=0.0)
    clock.set_override(1.0)
    while clock.rate < 0.5:
        clock.step(1e-4)
    clock.stop()
    rates = [clock.step(1e-4)[1] for _ in range(1500)]
    turn = BOUNDS.rising.slope[0] / BOUNDS.rising.bend[0]
    assert int(np.argmax(rates)) * 1e-4 == pytest.approx(turn, abs=2e-4)
    assert rates[-1] == 0.0


@settings(max_examples=100, deadline=None, derandomize=True)
@given(commands, st.floats(0.5, 60.0), st.floats(20.0, 5e4))
def test_any_commands_keep_the_rate_and_its_two_derivatives_in_bounds(
    sequence: list[tuple[int, str, float]], slope: float, bend: float
) -> None:
    bounds = StopBounds.constant(50.0, slope, bend)
    fine = 1e-4
    clock = PathClock(bounds, fine)
    path_times, rates = [0.0], [1.0]
    for steps, command, value in sequence:
        give(clock, command, value)
        for _ in range(20 * steps):
            u, rate = clock.step(fine)
            path_times.append(u)
            rates.append(rate)
    r = np.array(rates)
    assert r.min() >= 0.0
    assert r.max() <= 1.0
    assert np.all(np.diff(path_times) >= 0.0)
    assert np.all(np.diff(path_times) <= fine * (1 + 1e-9))
    assert np.abs(np.diff(r)).max(initial=0.0) <= slope * fine * (1 + 1e-6) + 1e-12
    if r.size > 2:
        assert np.abs(np.diff(r, 2)).max() <= bend * fine**2 * (1 + 1e-6) + 1e-12


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_bounds_that_change_from_cell_to_cell_leave_no_jump(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells, step = 40, 2e-4
    tables = []
    for _ in range(2):
        slope, bend = rng.uniform(5.0, 60.0, cells), 10 ** rng.uniform(2.5, 4.5, cells)
        until = (np.arange(cells) + 1.0) * 0.05 + change_time(slope, bend)
        tables.append(RateTable(slope, bend, np.minimum(until, 2.0)))
    clock = PathClock(StopBounds(2.0, *tables), step)
    rates = [1.0]
    for _ in range(40):
        give(clock, ["hold", "resume", "override"][rng.integers(3)], float(rng.uniform()))
        rates += [clock.step(step)[1] for _ in range(int(rng.integers(1, 150)))]
        if clock.state is ClockState.FINISHED:
            break
    moving = np.array(rates[:-1] if clock.state is ClockState.FINISHED else rates)
    moving = moving[: np.flatnonzero(moving > 0.0)[-1] + 1]
    steepest = max(table.slope.max() for table in tables)
    sharpest = max(table.bend.max() for table in tables)
    assert np.abs(np.diff(moving)).max(initial=0.0) <= steepest * step * (1 + 1e-6)
    assert np.abs(np.diff(moving, 2)).max(initial=0.0) <= sharpest * step**2 * (1 + 1e-6) + 1e-9


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_beyond_its_horizon_no_quick_change_goes_on(seed: int) -> None:
    rng = np.random.default_rng(seed)
    slope, bend = np.array([40.0, 2.0]), np.array([4e3, 50.0])
    table = RateTable(slope, bend, np.array([2.02, 4.0]))
    step = 2e-4
    clock = PathClock(StopBounds(4.0, table, table), step, start=1.9)
    seen = [(1.9, 1.0)]
    while seen[-1][0] < 2.05 and len(seen) < 5000:
        give(clock, ["hold", "resume", "override"][rng.integers(3)], float(rng.uniform()))
        seen += [clock.step(step) for _ in range(int(rng.integers(1, 60)))]
    path_times, rates = np.array(seen).T
    beyond = path_times[:-1] > 2.02
    assert np.abs(np.diff(rates))[beyond].max(initial=0.0) <= 2.0 * step * (1 + 1e-6)


def test_bad_arguments_are_named() -> None:
    with pytest.raises(InputError, match="override"):
        PathClock(BOUNDS, CYCLE, override=1.5)
    with pytest.raises(InputError, match="cycle"):
        PathClock(BOUNDS, 0.0)
    with pytest.raises(InputError, match="start"):
        PathClock(BOUNDS, CYCLE, start=3.0)
    with pytest.raises(InputError, match="override"):
        PathClock(BOUNDS, CYCLE).set_override(float("nan"))


def test_a_step_is_quick() -> None:
    clock = PathClock(StopBounds.constant(1e6, 20.0, 2000.0), CYCLE)
    best = np.inf
    for _ in range(20):
        clock.hold()
        begin = time.process_time()
        for _ in range(20):
            clock.step(CYCLE)
        best = min(best, (time.process_time() - begin) / 20)
        clock.resume()
        for _ in range(60):
            clock.step(CYCLE)
    assert best < 30e-6


@pytest.mark.parametrize("target", [0.05, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("begin", range(10, 90, 7))
def test_an_override_is_reached_from_anywhere_whatever_one_cell_certifies(
    target: float, begin: int
) -> None:
    """A change to half the rate travels farther than the stop that a cell's bounds reach for."""
    cells = 400
    slope, bend = np.full(cells, 200.0), 1500.0 + 900.0 * np.cos(np.arange(cells))
    ends = 2.0 * np.arange(1, cells + 1) / cells
    until = np.minimum(ends + 0.5 * change_time(slope, bend), 2.0)  # just enough for a stop
    table = RateTable(slope, bend, until)
    clock = PathClock(StopBounds(2.0, table, table), CYCLE)
    for _ in range(begin):
        clock.step(CYCLE)
    clock.set_override(target)
    rates = [clock.step(CYCLE)[1] for _ in range(150)]
    assert rates[-1] == pytest.approx(target, abs=1e-12)
