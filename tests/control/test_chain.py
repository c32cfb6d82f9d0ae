"""Parts of a program that hand over in motion, through the streamer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.channel.events import Happening, RunState
from duoglide.control.channel.orders import Command
from duoglide.control.channel.setpoints import Fence, PreparedSetpoints
from duoglide.control.host.run.prepare import prepare_part
from duoglide.control.streamer.follower import Follower
from duoglide.motion.path.actions import SetOutput
from duoglide.motion.stop_bounds import StopBounds

CYCLE = 0.002
COUNT = 12


def brisk() -> dg.Machine:
    """Return a machine that is never so fast that it would look far ahead."""
    limits = dg.CarriageLimits(velocity=1500.0, acceleration=60e3, jerk=3e6)
    return replace(dg.Machine.default(), limits=limits)


def winding(count: int) -> Iterator[dg.Path]:
    """Yield paths of two lines each, which meet at an angle."""
    k = np.arange(2 * count + 1)
    rows = (-41.0 + 25.0 * np.cos(0.9 * k), 95.0 * np.sin(0.7 * k), 285.0 + 15.0 * np.sin(1.3 * k))
    points = np.column_stack(rows)
    for i in range(count):
        path = dg.Path.polyline(points[2 * i : 2 * i + 3], 3.0)
        yield path.at(1, SetOutput(1, 16 + i % 2, True))


@pytest.fixture(scope="module")
def parts() -> list[dg.Trajectory]:
    return list(dg.plan_program(brisk(), winding(COUNT), False, tolerance=3.0))


@pytest.fixture(scope="module")
def chain(parts: list[dg.Trajectory]) -> list[PreparedSetpoints]:
    fence = Fence.of(brisk())
    befores = [None, *parts[:-1]]
    numbered = enumerate(zip(parts, befores, strict=True), start=1)
    return [prepare_part(part, fence, number, before) for number, (part, before) in numbered]


class Walk:
    """A follower of a chain, cycle by cycle; every setpoint is looked at."""

    def __init__(self, chain: list[PreparedSetpoints], override: float = 1.0) -> None:
        self.chain = chain
        self.follower = Follower(chain[0], override)
        self.follower.last = chain[-1].number
        self.targets = [chain[0].first]
        self.places: list[tuple[int, float]] = [(1, 0.0)]
        self.outputs: list[tuple[int, Any]] = []
        self.come = len(chain)  # how many of the chain have come

    def go(self, cycles: int) -> None:
        for _ in range(cycles):
            follower = self.follower
            number = follower.prepared.number
            if follower.following is None and number < self.come:
                follower.following = self.chain[number]
            target = follower.advance()
            assert not follower.prepared.fence.refuses(target, self.targets[-1])
            self.targets.append(target)
            self.places.append((follower.prepared.number, follower.path_time))
            self.outputs += [(follower.prepared.number, out) for out in follower.take_outputs()]
            if follower.state in (RunState.FINISHED, RunState.STOPPED):
                return

    @property
    def passed(self) -> list[int]:
        return sorted({number for number, _ in self.places})

    def on_path(self, parts: list[dg.Trajectory]) -> None:
        """Hold every setpoint against the part that it is said to be of."""
        scales = self.chain[0].fence.scales
        for (number, u), target in zip(self.places, self.targets, strict=True):
            whole = parts[number - 1].whole or parts[number - 1]
            apart = np.subtract(scales.triple(whole.at(u).carriages), target)
            assert np.abs(apart).max() <= 1

    def stays_within(self, limits: dg.CarriageLimits) -> None:
        """Hold the setpoints' differences against limits; an increment of rounding is allowed."""
        rows = np.array(self.targets) / self.chain[0].fence.scales.axes[0].increments_per_mm
        rounding = 1e-3
        velocity = np.diff(rows, axis=0) / CYCLE
        assert (np.abs(velocity) <= limits.velocity + 2 * rounding / CYCLE).all()
        acceleration = np.diff(velocity, axis=0) / CYCLE
        assert (np.abs(acceleration) <= limits.acceleration + 4 * rounding / CYCLE**2).all()


def test_the_parts_take_over_in_motion_without_a_rest_between_them(
    parts: list[dg.Trajectory], chain: list[PreparedSetpoints]
) -> None:
    walk = Walk(chain)
    walk.go(5000)
    assert sum(one.seam is not None for one in chain) >= 2
    assert walk.follower.state is RunState.FINISHED and walk.passed == [p.number for p in chain]
    walk.on_path(parts)
    walk.stays_within(brisk().limits)
    cycles = sum(part.duration for part in parts) / CYCLE
    rests = sum(part.whole is None for part in parts)
    assert cycles <= len(walk.targets) - 1 <= cycles + rests + 1
    assert walk.targets[-1] == chain[-1].stretches[-1].grid[-1]


@pytest.mark.parametrize("override", [0.37, 0.8])
def test_at_any_override_the_same_path_is_gone_along(
    parts: list[dg.Trajectory], chain: list[PreparedSetpoints], override: float
) -> None:
    walk = Walk(chain, override)
    walk.go(20_000)
    assert walk.follower.state is RunState.FINISHED
    walk.on_path(parts)
    cycles = sum(part.duration for part in parts) / CYCLE / override
    assert abs(len(walk.targets) - cycles) < 2 * len(parts) + 2


def test_a_hold_at_any_cycle_about_a_seam_ends_within_the_stop_limits_and_goes_on(
    parts: list[dg.Trajectory], chain: list[PreparedSetpoints]
) -> None:
    seam = chain[0].seam
    assert seam is not None
    for begin in range(max(int(seam / CYCLE) - 30, 1), int(seam / CYCLE) + 3, 8):
        walk = Walk(chain)
        walk.go(begin)
        walk.follower.hold()
        walk.go(200)
        assert walk.follower.state is RunState.HELD
        assert walk.targets[-1] == walk.targets[-20]
        walk.follower.resume()
        walk.go(5000)
        assert walk.follower.state is RunState.FINISHED
        walk.on_path(parts)
        walk.stays_within(brisk().stop_limits)


def test_what_comes_too_late_is_waited_for_at_rest_and_gone_on_with(
    parts: list[dg.Trajectory], chain: list[PreparedSetpoints]
) -> None:
    walk = Walk(chain)
    walk.come = 1
    walk.go(1000)
    follower = walk.follower
    assert follower.state is RunState.WAITING and follower.starved
    assert walk.targets[-1] == chain[0].stretches[-1].grid[-1]
    waited = follower.waited
    assert waited > 0.5
    walk.come = len(chain)
    walk.go(5000)
    assert walk.follower.state is RunState.FINISHED and walk.passed == [p.number for p in chain]
    walk.on_path(parts)
    walk.stays_within(brisk().stop_limits)


@pytest.mark.parametrize("late", [0, 1])
def test_outputs_are_set_once_and_in_order_whether_the_parts_come_in_time_or_not(
    chain: list[PreparedSetpoints], late: int
) -> None:
    walk = Walk(chain)
    if late:
        for come in range(1, len(chain) + 1):
            walk.come = come
            walk.go(600)
    walk.come = len(chain)
    walk.go(5000)
    assert walk.follower.state is RunState.FINISHED
    assert [out.bit for _, out in walk.outputs] == [16 + i % 2 for i in range(COUNT)]


def test_a_stop_about_a_seam_is_for_good(chain: list[PreparedSetpoints]) -> None:
    seam = chain[0].seam
    assert seam is not None
    for begin in (5, int(seam / CYCLE) - 2, int(seam / CYCLE) + 1):
        walk = Walk(chain)
        walk.go(begin)
        walk.follower.stop()
        walk.go(500)
        assert walk.follower.state is RunState.STOPPED
        walk.stays_within(brisk().stop_limits)


def test_what_does_not_lie_on_the_way_is_not_gone_on_with(chain: list[PreparedSetpoints]) -> None:
    walk = Walk(chain)
    walk.come = 1
    walk.go(1000)
    walk.follower.following = replace(chain[2], lead_in=chain[0].seam or 0.0)
    walk.go(5)
    assert walk.follower.unjoined and walk.follower.state is RunState.STOPPED


def test_a_part_is_gone_along_to_its_end_however_the_sum_with_its_lead_in_is_rounded(
    chain: list[PreparedSetpoints],
) -> None:
    one, other = chain[:2]
    assert other.pace is not None
    whole, rounded = other.trajectory.duration, 0
    for lead_in in np.geomspace(1.0, 500.0, 12).tolist():
        rounded += (lead_in + whole) - lead_in < whole
        pace = StopBounds.constant(lead_in + whole, 20.0, 2000.0)
        walk = Walk([one, replace(other, lead_in=lead_in, pace=pace, seam=None)])
        walk.follower.last = 0  # not known yet that it is the last one
        walk.come = 1
        walk.go(300)
        walk.come = 2
        walk.go(1000)
        assert walk.follower.starved and walk.follower.state is RunState.WAITING
        assert walk.targets[-1] == other.stretches[-1].grid[-1]
    assert rounded > 0


def test_a_change_of_override_that_is_under_way_passes_a_seam(
    parts: list[dg.Trajectory], chain: list[PreparedSetpoints]
) -> None:
    seam = chain[0].seam
    assert seam is not None
    for begin in range(max(int(seam / CYCLE) - 9, 1), int(seam / CYCLE) + 1, 3):
        walk = Walk(chain)
        walk.go(begin)
        walk.follower.set_override(0.4)
        walk.go(8000)
        assert walk.follower.state is RunState.FINISHED
        walk.on_path(parts)
        walk.stays_within(brisk().stop_limits)
        rests = [a == b for a, b in pairwise(walk.targets[begin : begin + 150])]
        assert not any(rests)


def test_the_streamer_tells_of_each_part_and_of_each_wait(
    make_bench: Callable[..., Any], chain: list[PreparedSetpoints]
) -> None:
    bench = make_bench()
    scales = chain[0].fence.scales
    bench.place(*scales.mm(chain[0].first)).enable()
    bench.handed_over = {chain[0].number: chain[0]}
    bench.order(Command.RUN, 1, 1.0)
    bench.step(600)
    assert not bench.happened(Happening.FINISHED)
    bench.handed_over |= {one.number: one for one in chain}
    bench.order(Command.END, chain[-1].number)
    bench.step(2500)
    assert [int(event.value) for event in bench.happened(Happening.PART)] == [
        one.number for one in chain[1:]
    ]
    (awaited,) = bench.happened(Happening.AWAITED)
    assert 0.2 < awaited.value < 1.2
    assert len(bench.happened(Happening.FINISHED)) == 1 and not bench.tripped()
    assert {entry.run for entry in bench.log if entry.state == RunState.RUNNING} == {
        one.number for one in chain
    }
