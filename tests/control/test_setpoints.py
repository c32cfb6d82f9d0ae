from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.control.channel.events import RunState
from duoglide.control.channel.setpoints import Fence
from duoglide.control.host.run.prepare import divide_into_cycles, prepare
from duoglide.control.streamer.follower import Follower
from duoglide.motion.path.actions import WaitInput
from duoglide.storage.records import Phase


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.floats(0.0, 5.0), st.floats(0.0, 3.0), st.sampled_from([0.0005, 0.001, 0.002, 0.01]))
def test_grid_times_are_whole_cycles_and_end_at_the_end(
    start: float, length: float, cycle: float
) -> None:
    end = start + length
    times = divide_into_cycles(start, end, cycle)
    assert times[0] == start or length == 0.0
    assert times[-1] == end
    assert np.all(np.diff(times) >= 0.0) and np.all(np.diff(times) <= cycle * (1.0 + 1e-9))
    assert np.array_equal(times[:-1], start + np.arange(len(times) - 1) * cycle)


def test_a_setpoint_beyond_the_rails_is_refused_before_anything_is_sent(
    bench: Any, machine: dg.Machine
) -> None:
    with pytest.raises(dg.LimitError, match=r"carriage 2 at 0\.\d+ s is refused"):
        prepare(bench.straight(length=300.0), Fence.of(machine), 1, Phase.PROGRAM)


def test_a_step_that_no_stop_limit_allows_is_refused(bench: Any, machine: dg.Machine) -> None:
    with pytest.raises(dg.LimitError, match="greatest step"):
        prepare(bench.straight(length=200.0, duration=0.01), Fence.of(machine), 1, Phase.PROGRAM)


@pytest.mark.parametrize("direction", [(1, 1, 1), (-1, 1, -1)])
def test_the_fence_knows_which_way_a_drive_counts(
    machine: dg.Machine, direction: tuple[int, int, int]
) -> None:
    drives = replace(machine.drives, direction=direction)
    fence = Fence.of(replace(machine, drives=drives))
    inside = fence.scales.triple(np.array([-100.0, 100.0, 50.0]))
    close = fence.scales.triple(np.array([-20.0, 39.9, 50.0]))
    beyond = fence.scales.triple(np.array([-100.0, 100.0, 360.01]))
    assert fence.refuses(inside, inside) == 0
    assert fence.refuses(close, close) == 2
    assert fence.refuses(beyond, beyond) == 3


def test_setpoints_with_a_wait_have_a_grid_for_each_stretch(
    bench: Any, machine: dg.Machine
) -> None:
    wait = WaitInput(1, 3, True)
    prepared = prepare(
        bench.straight(actions=((0.5031, wait),)), Fence.of(machine), 1, Phase.PROGRAM
    )
    first, second = prepared.stretches
    assert (first.end, second.start, first.wait, second.wait) == (0.5031, 0.5031, wait, None)
    assert first.grid[-1] == second.grid[0]


@cache
def there() -> dg.Trajectory:
    return dg.transfer(dg.Machine.default(), (-41.0, -60.0, 302.0), (-41.0, 60.0, 302.0))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(st.integers(1, 80), st.sampled_from(["hold", "resume", 0.0, 0.3, 0.7, 1.0])),
        max_size=6,
    )
)
def test_whatever_the_operator_does_setpoints_stay_on_the_path_and_in_the_fence(
    commands: list[tuple[int, str | float]],
) -> None:
    machine = dg.Machine.default()
    prepared = prepare(there(), Fence.of(machine), 1, Phase.PROGRAM)
    follower = Follower(prepared, 1.0)
    follower.last = prepared.number
    previous, u = prepared.first, 0.0
    for cycles, command in [*commands, (1, "resume"), (400, 1.0)]:
        if command == "hold":
            follower.hold()
        elif command == "resume":
            follower.resume()
        else:
            follower.set_override(float(command))
        for _ in range(cycles):
            target = follower.advance()
            assert not prepared.fence.refuses(target, previous)
            assert follower.path_time >= u
            assert target == prepared.at(follower.path_time)
            previous, u = target, follower.path_time
    assert follower.state is RunState.FINISHED
    assert previous == prepared.stretches[-1].grid[-1]
