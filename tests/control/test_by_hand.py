"""The platform moved by hand, in virtual time: what makes its parts, and what goes along them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.channel.events import RunState
from duoglide.control.channel.setpoints import PreparedSetpoints
from duoglide.control.host.run.by_hand import DEAD_MAN, STEP, JogSource
from duoglide.control.streamer.follower import Follower
from duoglide.kinematics.headroom.room import room

CYCLE = 0.002
HOME = (-41.0, 0.0, 302.0)


class Hand:
    """Somebody who moves the platform, cycle by cycle.

    Args:
        slow: Cycles that it takes to make a part.
    """

    def __init__(self, slow: int = 10) -> None:
        self.machine, self.slow = dg.Machine.default(), slow
        start = dg.inverse(self.machine.geometry, HOME)
        self.jog = dg.Jog(self.machine, start, period=STEP)
        self.entry: Any = None
        self.cycle = self.number = 0
        self.follower: Follower | None = None
        self.coming: list[tuple[int, PreparedSetpoints]] = []
        self.targets: list[tuple[int, int, int]] = []
        self.handed_over: dict[int, PreparedSetpoints] = {}
        self.source = JogSource(
            self.machine, self.jog, lambda: self.entry, lambda: self.cycle * CYCLE
        )

    def go(self, cycles: int, velocity: tuple[float, float, float] | None = None) -> None:
        for _ in range(cycles):
            if velocity is not None and self.cycle % 10 == 0:
                self.source.aim(velocity)
            self._make()
            self._advance()
            self.cycle += 1

    def _make(self) -> None:
        if self.coming and self.coming[0][0] <= self.cycle:
            _, prepared = self.coming.pop(0)
            self.handed_over[prepared.after] = prepared
        if not self.coming and (part := self.source.make_if_due()) is not None:
            self.number += 1
            prepared = replace(part.prepared, number=self.number, after=part.after or 0)
            self.coming.append((self.cycle + self.slow, prepared))

    def _advance(self) -> None:
        if self.follower is None:
            if (first := self.handed_over.get(0)) is None:
                return
            self.follower = Follower(first, 1.0)
            self.targets.append(first.first)
        follower = self.follower
        if follower.following is None:
            follower.following = self.handed_over.get(follower.prepared.number)
        target = follower.advance()
        assert not follower.prepared.fence.refuses(target, self.targets[-1])
        self.targets.append(target)
        self.entry = SimpleNamespace(
            run=follower.prepared.number, state=follower.state, path_time=follower.path_time
        )

    @property
    def carriages(self) -> np.ndarray:
        return np.array(self.targets) * 1e-3

    @property
    def position(self) -> np.ndarray:
        return np.asarray(dg.forward(self.machine.geometry, self.carriages))


def test_the_platform_moves_at_the_velocity_that_is_asked_for_again_and_again() -> None:
    hand = Hand()
    hand.go(500, (0.0, 40.0, -15.0))
    speed = np.diff(hand.position[-50:], axis=0) / CYCLE
    np.testing.assert_allclose(speed.mean(axis=0), (0.0, 40.0, -15.0), atol=0.2)
    assert hand.number > 10
    acceleration = np.diff(hand.carriages, 2, axis=0) / CYCLE**2
    assert np.abs(acceleration).max() < 1500.0 + 4e-3 / CYCLE**2


def test_whoever_lets_go_stops_the_platform_within_the_time_of_a_dead_man() -> None:
    hand = Hand()
    hand.go(500, (0.0, 60.0, 0.0))
    let_go = len(hand.targets)
    hand.go(300)
    speed = np.diff(hand.position[:, 1]) / CYCLE
    slower = np.flatnonzero(speed[let_go:] < 55.0)
    assert slower[0] * CYCLE <= DEAD_MAN + 0.03  # and 30 ms until it is slower by a twelfth
    assert (np.abs(speed[-50:]) < 1e-6).all()
    assert hand.entry.state is RunState.WAITING
    hand.go(200, (0.0, -30.0, 0.0))
    assert hand.position[-1, 1] < hand.position[-200, 1] - 5.0


def test_parts_that_come_too_late_leave_the_platform_at_rest_and_it_goes_on_from_there() -> None:
    hand = Hand(slow=40)  # more than the 20 cycles that there are
    hand.go(1500, (0.0, 40.0, 0.0))
    assert hand.position[-1, 1] > 10.0
    states = np.abs(np.diff(hand.position[:, 1]))
    assert (states == 0.0).sum() > 100


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 90.0), (-90.0, 0.0, 0.0), (0.0, 100.0, 0.0)])
def test_the_platform_stops_before_it_comes_to_where_it_may_not_be(
    velocity: tuple[float, float, float],
) -> None:
    hand = Hand()
    hand.go(2200, velocity)
    assert hand.source.blocked
    assert (np.diff(hand.carriages[-50:], axis=0) == 0.0).all()
    _, _, least = room(hand.machine, hand.carriages[::5]).worst()
    assert least >= 0.0


def test_a_velocity_that_is_none_is_refused() -> None:
    with pytest.raises(dg.InputError, match="velocity"):
        Hand().source.aim((0.0, float("nan"), 0.0))
