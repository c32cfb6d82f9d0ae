from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from duoglide.control.channel.events import Happening
from duoglide.control.channel.orders import Command, Power
from duoglide.control.streamer.clock import run_cycles
from duoglide.drives import pdo
from duoglide.drives.cia402 import State
from duoglide.motion.path.actions import SetOutput, WaitInput


def test_nothing_but_sync_and_heartbeat_is_sent_before_the_power_is_wanted(bench: Any) -> None:
    bench.step(100)
    assert {identifier for identifier, _ in bench.sent} == {pdo.SYNC, pdo.HEARTBEAT + 127}
    assert [i for i, _ in bench.sent].count(pdo.HEARTBEAT + 127) == 4


def test_enabling_leaves_the_carriages_where_they_are(bench: Any) -> None:
    bench.enable()
    assert all(drive.axis.state is State.OPERATION_ENABLED for drive in bench.drives)
    assert [drive.axis.actual for drive in bench.drives] == [-200_000, 100_000, -100_000]


def test_sync_is_first_in_every_cycle(bench: Any) -> None:
    bench.enable()
    bench.run(bench.straight())
    bench.sent.clear()
    bench.step(50)
    identifiers = [i for i, _ in bench.sent if i != pdo.HEARTBEAT + 127]
    assert identifiers == [pdo.SYNC, 0x201, 0x202, 0x203] * 50


def test_a_run_sends_every_setpoint_of_its_grid_once_and_in_order(bench: Any) -> None:
    bench.enable()
    prepared = bench.run(bench.straight())
    bench.sent.clear()
    bench.step(520)
    assert bench.happened(Happening.FINISHED)
    targets = [pdo.SETPOINT.unpack(data)[1] for i, data in bench.sent if i == 0x201]
    grid = [row[0] for row in prepared.stretches[0].grid]
    assert targets[: len(grid) - 1] == grid[1:]
    assert set(targets[len(grid) - 1 :]) == {grid[-1]}


def test_following_error_compares_the_setpoint_that_should_have_been_reached(bench: Any) -> None:
    bench.enable()
    bench.run(bench.straight())
    bench.step(510)
    worst = max(abs(e.following[0]) for e in bench.log)
    assert worst < 80  # one tick of 0.1 ms at 400 mm/s is 40 increments; a cycle would be 800


def test_hold_begins_within_two_cycles_and_resume_ends_at_the_same_place(bench: Any) -> None:
    bench.enable()
    prepared = bench.run(bench.straight())
    bench.step(200)
    bench.order(Command.HOLD)
    bench.step(3)
    rates = [e.rate for e in bench.log[-3:]]
    assert rates[-1] < 1.0
    bench.step(300)
    held = bench.setpoints()[-1]
    assert bench.log[-1].rate == 0.0
    assert np.all(bench.setpoints()[-50:] == held)
    bench.order(Command.RESUME)
    bench.step(600)
    assert tuple(bench.setpoints()[-1]) == prepared.stretches[-1].grid[-1]
    assert bench.happened(Happening.FINISHED)


def test_override_keeps_the_path_and_changes_the_pace(bench: Any) -> None:
    bench.enable()
    bench.run(bench.straight(), override=0.5)
    bench.step(700)
    assert not bench.happened(Happening.FINISHED)
    bench.step(400)
    assert bench.happened(Happening.FINISHED)
    sent = bench.setpoints()[5:]
    assert np.all(np.abs(np.diff(sent[:, 0] - sent[:, 1])) <= 1)


def test_stop_ends_the_run_on_the_path_and_keeps_the_power(bench: Any) -> None:
    bench.enable()
    bench.run(bench.straight())
    bench.step(200)
    bench.order(Command.STOP)
    bench.step(200)
    (stopped,) = bench.happened(Happening.STOPPED)
    assert 0.39 < stopped.value < 0.55
    assert all(drive.axis.state is State.OPERATION_ENABLED for drive in bench.drives)


def test_quick_stop_lets_the_drives_brake_and_stays_latched(bench: Any) -> None:
    bench.enable()
    bench.run(bench.straight())
    bench.step(250)
    bench.order(Command.QUICK_STOP)
    bench.step(2)
    assert all(drive.axis.state is State.QUICK_STOP_ACTIVE for drive in bench.drives)
    bench.step(50)
    bench.order(Command.POWER, Power.ON)
    bench.step(5)
    assert bench.happened(Happening.REFUSED)
    bench.order(Command.FORGET)
    bench.order(Command.POWER, Power.ON)
    bench.step(20)
    assert all(drive.axis.state is State.OPERATION_ENABLED for drive in bench.drives)


def test_a_quick_stop_does_not_keep_the_power_on_that_is_being_taken_off(bench: Any) -> None:
    bench.enable()
    bench.order(Command.POWER, Power.OFF)
    bench.order(Command.QUICK_STOP)
    bench.step(20)
    assert bench.log[-1].power is Power.OFF
    assert all(drive.axis.state is State.SWITCH_ON_DISABLED for drive in bench.drives)
    bench.order(Command.POWER, Power.ON)
    bench.step(5)
    assert bench.happened(Happening.REFUSED), "it is latched all the same"


def test_outputs_switch_at_their_path_time(bench: Any) -> None:
    bench.enable()
    actions = ((0.2, SetOutput(2, 16, True)), (0.6, SetOutput(2, 16, False)))
    bench.run(bench.straight(actions=actions))
    bench.step(520)
    on, off = bench.happened(Happening.OUTPUT)
    start = bench.happened(Happening.STARTED)[0].cycle
    assert (on.cycle - start, off.cycle - start) == (99, 299)
    assert (on.code, off.code) == (1 << 16, 0)
    assert bench.drives[1].axis.outputs == 0


def test_a_wait_stands_still_until_its_input_comes(bench: Any) -> None:
    bench.enable()
    bench.run(bench.straight(actions=((0.0, WaitInput(1, 3, True, 1.0)),)))
    bench.step(60)
    still = bench.setpoints()[-50:]
    assert np.all(still == still[0])
    bench._queue.append((pdo.TPDO2 + 1, pdo.INPUTS.pack(1 << 3, 8)))
    bench.step(505)
    assert bench.happened(Happening.INPUT) and bench.happened(Happening.FINISHED)


def test_a_wait_that_lasts_too_long_ends_the_run(bench: Any) -> None:
    bench.enable()
    bench.run(bench.straight(actions=((0.0, WaitInput(1, 3, True, 0.1)),)))
    bench.step(60)
    assert bench.happened(Happening.INPUT_TIMEOUT) and bench.happened(Happening.STOPPED)


def test_a_run_that_starts_elsewhere_is_refused(bench: Any) -> None:
    bench.enable()
    trajectory = bench.straight()
    trajectory.start = trajectory.start + np.array([0.0, 0.0, 50.0])
    bench.run(trajectory)
    bench.step(5)
    (refused,) = bench.happened(Happening.REFUSED)
    assert refused.axis == 3
    assert not bench.happened(Happening.STARTED)


class Clock:
    """A clock that is late by a little, always."""

    def __init__(self) -> None:
        self.time = 0

    def now(self) -> int:
        return self.time

    def sleep_until(self, deadline: int) -> None:
        self.time = max(self.time, deadline) + 7


class Recording:
    """Eight cycles; the third takes longer than it may."""

    done = False
    standstill = 0

    def __init__(self, clock: Clock, third: int) -> None:
        self.clock, self.third = clock, third
        self.calls: list[tuple[int, int, int]] = []

    def cycle(self, number: int, time: int, lateness: int, skipped: int) -> None:
        self.calls.append((number, time // 1000, skipped))
        if number == 3:
            self.clock.time += self.third
        self.done = number >= 8


def test_late_cycles_are_skipped_to_the_schedule_and_never_burst() -> None:
    clock = Clock()
    streamer = Recording(clock, third=2500)
    run_cycles(streamer, clock, 1000)
    numbers = [number for number, _, _ in streamer.calls]
    assert numbers == [1, 2, 3, 5, 6, 7, 8]
    assert [skipped for _, _, skipped in streamer.calls] == [0, 0, 0, 1, 0, 0, 0]
    periods = [time for _, time, _ in streamer.calls]
    assert periods == numbers


@pytest.mark.parametrize(("third", "numbers"), [(5900, list(range(1, 9))), (7100, [1, 2, 3, 10])])
def test_where_all_stands_still_together_the_schedule_is_moved_up_to_a_limit(
    third: int, numbers: list[int]
) -> None:
    clock = Clock()
    streamer = Recording(clock, third)
    streamer.standstill = 5000
    run_cycles(streamer, clock, 1000)
    assert [number for number, _, _ in streamer.calls] == numbers
    times = [time for _, time, _ in streamer.calls]
    assert all(later > earlier for earlier, later in pairwise(times))


@pytest.mark.parametrize("skipped", [1, 2])
def test_the_path_time_bridges_a_skipped_cycle_and_leaps_over_no_gap(
    bench: Any, skipped: int
) -> None:
    bench.enable()
    bench.run(bench.straight())
    bench.step(250)
    bench.step(1, skipped=skipped)
    bench.step(50)
    assert not bench.tripped()
    times = np.array([e.path_time for e in bench.log if e.phase == 2])
    assert np.max(np.diff(times)) == pytest.approx(0.004, abs=1e-12)


def test_a_million_cycles_lose_no_setpoint(make_bench: Callable[..., Any]) -> None:
    """The short form; tests/benchmarks/stream.py does the million."""
    bench = make_bench().enable()
    cycles = len(bench.log)
    bench.step(2000)
    numbers = [e.cycle for e in bench.log]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert len(bench.log) == cycles + 2000


def test_a_streamer_that_is_closed_in_motion_stops_on_the_path_and_takes_the_power_off(
    bench: Any,
) -> None:
    bench.enable()
    bench.run(bench.straight())
    bench.step(200)
    bench.order(Command.CLOSE)
    bench.step(1)
    assert not bench.streamer.done
    bench.step(300)
    (stopped,) = bench.happened(Happening.STOPPED)
    assert 0.39 < stopped.value < 0.55 and not stopped.code
    assert bench.streamer.done
    assert all(drive.axis.state is State.SWITCH_ON_DISABLED for drive in bench.drives)


def test_a_streamer_that_is_closed_without_power_ends_at_once(bench: Any) -> None:
    bench.enable()
    bench.order(Command.POWER, Power.OFF)
    bench.step(20)
    bench.order(Command.CLOSE)
    bench.step(1)
    assert bench.streamer.done
