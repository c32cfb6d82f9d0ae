from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.drives.simulation.firmware.demand import FRACTION, Demand, Phase

PERIOD = 2000  # [us]
moves = st.lists(st.one_of(st.none(), st.integers(-8000, 8000)), min_size=1, max_size=30)


def advance(demand: Demand, steps: int, dt: int = 500, deceleration: int = 60_000_000) -> None:
    for _ in range(steps):
        demand.advance(dt, deceleration)


@settings(max_examples=100, deadline=None)
@given(moves)
def test_the_demand_never_jumps(steps: list[int | None]) -> None:
    """Whatever setpoints come or stay away, it moves no faster than it says."""
    demand = Demand()
    for step in steps:
        if step is not None:
            demand.aim(demand.position // FRACTION + step, PERIOD)
        for _ in range(4):
            before, speed = demand.position, abs(demand.velocity)
            demand.advance(500, 60_000_000)
            moved = abs(demand.position - before)
            assert moved <= max(speed, abs(demand.velocity)) * 500 / 1e6 + 2


@settings(max_examples=100, deadline=None)
@given(st.integers(-8000, 8000), st.integers(1_000_000, 4_000_000_000))
def test_left_alone_it_bridges_one_period_then_brakes_and_stands(step: int, brake: int) -> None:
    demand = Demand()
    demand.aim(step, PERIOD)
    speed = abs(demand.velocity) / FRACTION
    advance(demand, 8, deceleration=brake)
    assert demand.position == 2 * step * FRACTION
    braking = speed / brake
    advance(demand, int(braking / 0.0005) + 2, deceleration=brake)
    assert demand.phase is Phase.HOLD
    assert demand.velocity == 0
    distance = abs(demand.position / FRACTION - 2 * step)
    rounding = 1.0 + speed * 2e-6 + braking / 0.0005 / 64  # 1/256 increment or so every step
    assert distance == pytest.approx(speed**2 / (2.0 * brake), abs=rounding)


def test_a_jog_runs_up_to_its_speed_and_no_further() -> None:
    demand = Demand()
    demand.jog(-20_000, 1_000_000)
    advance(demand, 10, dt=1000)
    assert demand.velocity == -10_000 * FRACTION
    advance(demand, 20, dt=1000)
    assert demand.velocity == -20_000 * FRACTION
    demand.brake()
    advance(demand, 10)
    assert demand.phase is Phase.HOLD
