from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.kinematics.headroom.room import locate, room
from duoglide.planning.transfer.recover import RESERVE, recover

MACHINE = dg.Machine.default()


def bad_pose(machine: dg.Machine, rng: np.random.Generator) -> np.ndarray:
    """Draw carriages that stand where they must not, in the machine's own assembly mode."""
    g = machine.geometry
    while True:
        position = rng.uniform([-135.0, -340.0, 80.0], [225.0, 340.0, 370.0])
        if not dg.reachable(g, position):
            continue
        carriages = dg.inverse(g, position)
        found, closed = locate(machine, carriages[None])
        own = closed[0] and np.allclose(found[0], position, atol=1e-6)
        if own and -30.0 < room(machine, carriages[None]).least()[0] <= 0.0:
            return carriages


def require_way_out(machine: dg.Machine, trajectory: dg.Trajectory) -> None:
    carriages = trajectory.at(np.linspace(0.0, trajectory.duration, 500)).carriages
    here = room(machine, carriages)
    for field in fields(here):
        margin = getattr(here, field.name)
        short = np.minimum(margin, 0.0)  # what is too small
        assert np.diff(short).min() > -1e-5
    assert here.least()[-1] > 0.0
    assert np.abs(np.diff(carriages, axis=0)).max() * 499 <= 20.1 * trajectory.duration


@settings(max_examples=12, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_there_is_a_way_out_on_which_nothing_gets_worse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    trajectory = recover(MACHINE, bad_pose(MACHINE, rng))
    require_way_out(MACHINE, trajectory)
    assert trajectory.audit().worst <= 1.0005


@settings(max_examples=10, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 5.0, 12.0]))
def test_a_carriage_margin_that_is_too_small_never_gets_smaller(seed: int, needed: float) -> None:
    rng, machine = np.random.default_rng(seed), replace(MACHINE, carriage_margin=needed)
    start = bad_pose(machine, rng)
    while room(machine, start[None]).carriage_margin[0] > 0.0:
        start = bad_pose(machine, rng)
    trajectory = recover(machine, start)
    require_way_out(machine, trajectory)
    onward = dg.carriage_margin(machine.geometry, dg.forward(machine.geometry, trajectory.end))
    assert onward > needed


def test_a_carriage_past_its_travel_is_brought_back_along_the_rails() -> None:
    start = dg.inverse(MACHINE.geometry, (-41.0, 165.0, 300.0))
    assert np.abs(start).max() > 360.0
    trajectory = recover(MACHINE, start)
    end = trajectory.end
    np.testing.assert_allclose(np.diff(end - start), 0.0, atol=1e-9)  # all three together
    assert 360.0 - np.abs(end).max() == pytest.approx(RESERVE, abs=0.1)


def test_the_neighbourhood_of_a_singularity_is_left_for_good() -> None:
    start = dg.inverse(MACHINE.geometry, (0.0, 0.0, 244.4))
    trajectory = recover(MACHINE, start)
    require_way_out(MACHINE, trajectory)
    onward = dg.transfer(MACHINE, trajectory.position_at(trajectory.duration), (-41.0, 0.0, 302.0))
    assert onward.duration > 0.0


def test_out_of_a_keep_out_box_too() -> None:
    box = dg.Box(low=(-60.0, -20.0, 280.0), high=(-30.0, 20.0, 310.0))
    machine = replace(MACHINE, keep_out=(box,), home_position=(20.0, 0.0, 300.0))
    trajectory = recover(machine, dg.inverse(machine.geometry, (-31.0, 0.0, 295.0)))
    require_way_out(machine, trajectory)


def test_where_nothing_is_wrong_it_stays() -> None:
    start = dg.inverse(MACHINE.geometry, (-41.0, 0.0, 302.0))
    trajectory = recover(MACHINE, start)
    np.testing.assert_array_equal(trajectory.end, start)
    assert trajectory.duration == MACHINE.drives.cycle


def test_carriages_that_do_not_tell_the_pose_are_refused() -> None:
    with pytest.raises(dg.PathError, match="by hand"):
        recover(MACHINE, (-220.0, 220.1, 240.0))
    with pytest.raises(dg.InputError, match="speed"):
        recover(MACHINE, (-220.0, 220.0, 240.0), speed=0.0)
    with pytest.raises(dg.InputError, match="carriages"):
        recover(MACHINE, (0.0, 0.0))
