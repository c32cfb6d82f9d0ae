"""Limits far apart, far above and far below usual ones."""

from __future__ import annotations

import numpy as np
import pytest

import duoglide as dg
from duoglide.planning.braking.certificate import brake_report
from duoglide.planning.timing.base import plan_seven_phases

MOVE = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0, 4.0)


def _plan(
    velocity: float, acceleration: float, jerk: float, brake_safe: bool = False
) -> dg.Trajectory:
    limits = dg.CarriageLimits(velocity=velocity, acceleration=acceleration, jerk=jerk)
    brakes = dg.DriveSettings(quick_stop_deceleration=max(60e3, velocity / 5.0))
    return dg.plan(dg.Machine(limits=limits, drives=brakes), MOVE, brake_safe=brake_safe)


def _draws(seed: int, count: int) -> list[tuple[float, float, float]]:
    """Return limits of velocity, acceleration and jerk, each over eight powers of ten or more."""
    rng = np.random.default_rng(seed)
    powers = rng.uniform([1.0, 2.0, 2.0], [9.0, 12.0, 15.0], (count, 3))
    return [(v, a, j) for v, a, j in (10.0**powers).tolist()]


@pytest.mark.parametrize("limits", _draws(11, 8))
def test_a_plan_keeps_any_limits_and_is_near_what_one_of_them_alone_allows(
    limits: tuple[float, float, float],
) -> None:
    plan = _plan(*limits)
    assert plan.report.reason == ""
    assert plan.audit().worst <= 1.0005
    assert plan.lower_bound() <= plan.duration * (1.0 + 1e-5)
    v, a, j = limits
    # of these three, one at least is all that holds the move back, but for a factor
    alone = 365.0 / v, 2.0 * (365.0 / a) ** 0.5, (32.0 * 365.0 / j) ** (1.0 / 3.0)
    assert max(alone) * 0.9 < plan.duration < 6.0 * max(alone)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_the_same_motion_in_another_unit_of_time_takes_as_many_of_them(factor: float) -> None:
    usual = _plan(4e3, 60e3, 3e6)
    other = _plan(4e3 * factor, 60e3 * factor**2, 3e6 * factor**3)
    assert other.duration * factor == pytest.approx(usual.duration, rel=2e-3)


@pytest.mark.parametrize("jerk", [3.1e12, 1e15])
def test_jerk_without_a_limit_worth_the_name_comes_near_the_bound_without_any(jerk: float) -> None:
    plan = _plan(4e3, 60e3, jerk)
    assert plan.lower_bound() <= plan.duration < 1.01 * plan.lower_bound()


@pytest.mark.parametrize("jerk", 10.0 ** np.linspace(8.0, 15.0, 40))
def test_phases_without_room_for_jerk_are_those_without_a_limit_of_it(jerk: float) -> None:
    quick = plan_seven_phases(0.0, 300.0, (1e9, 60e3, jerk)).duration
    assert quick == pytest.approx(2.0 * (300.0 / 60e3) ** 0.5 + 60e3 / jerk, rel=1e-5)


def test_what_holds_back_a_machine_without_limits_are_the_brakes_alone() -> None:
    plan = _plan(1e6, 1e9, 1e12, brake_safe=True)
    assert brake_report(plan).safe
    assert plan.audit().worst <= 1.0005
    # From 9.3 m/s a brake would take the whole length of a rail; and within the reaction time no
    # carriage may get as far ahead of another as would part the links.
    assert 365.0 / 9.3e3 < plan.duration < 0.6
