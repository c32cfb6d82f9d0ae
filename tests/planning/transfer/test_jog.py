from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import duoglide as dg
from duoglide.planning.transfer.jog import Jog, JogLimits, _bound_bends, _sample

MACHINE = dg.Machine.default()
CYCLE = MACHINE.drives.cycle
HOME = dg.inverse(MACHINE.geometry, (-41.0, 0.0, 302.0))


def jogged(jog: Jog, velocity: tuple[float, float, float], steps: int) -> np.ndarray:
    jog.aim(velocity)
    return np.array([jog.step() for _ in range(steps)])


def require_room(machine: dg.Machine, carriages: np.ndarray) -> None:
    positions = dg.forward(machine.geometry, carriages)
    assert dg.clearance(machine.geometry, positions).min() > machine.clearance
    assert np.abs(carriages).max() < machine.geometry.rail_half_length
    assert np.diff(carriages[:, :2]).min() > machine.carriage_width


def test_it_reaches_the_velocity_that_is_asked_for_and_stops_when_let_go() -> None:
    jog = Jog(MACHINE, HOME)
    jogged(jog, (0.0, 60.0, -20.0), 150)
    np.testing.assert_allclose(jog.velocity, [0.0, 60.0, -20.0], atol=1e-9)
    assert jog.blocked == ""
    jogged(jog, (0.0, 0.0, 0.0), 150)
    assert not jog.moving
    np.testing.assert_allclose(jog.velocity, 0.0, atol=1e-9)


def test_a_wish_is_shortened_to_the_limit_of_speed() -> None:
    jog = Jog(MACHINE, HOME, JogLimits(speed=30.0))
    jogged(jog, (300.0, 0.0, -400.0), 150)
    np.testing.assert_allclose(jog.velocity, [18.0, 0.0, -24.0], atol=1e-9)


def test_it_goes_straight_from_rest() -> None:
    jog = Jog(MACHINE, HOME)
    carriages = jogged(jog, (30.0, 60.0, -20.0), 120)
    moved = dg.forward(MACHINE.geometry, carriages) - dg.forward(MACHINE.geometry, HOME)
    direction = np.array([30.0, 60.0, -20.0]) / 70.0
    aside = moved - (moved @ direction)[:, None] * direction
    assert np.abs(aside).max() < 1e-5


@pytest.mark.parametrize(
    ("velocity", "quantity"),
    [
        ((0.0, 0.0, -90.0), "carriage_margin"),
        ((0.0, 90.0, 0.0), "travel"),
        ((90.0, 0.0, 0.0), "keep_out"),
    ],
)
def test_it_comes_to_rest_before_what_is_in_the_way(
    velocity: tuple[float, float, float], quantity: str
) -> None:
    box = dg.Box(low=(10.0, -500.0, 0.0), high=(20.0, 500.0, 600.0))
    jog = Jog(replace(MACHINE, keep_out=(box,)), HOME)
    carriages = jogged(jog, velocity, 1100)
    require_room(MACHINE, carriages)
    assert (jog.blocked, jog.moving) == (quantity, False)
    room = {
        "carriage_margin": dg.carriage_margin(MACHINE.geometry, jog.position) - 1.0,
        "travel": 360.0 - np.abs(carriages[-1]).max(),
        "keep_out": 10.0 - jog.position[0],
    }[quantity]
    assert 0.0 < room < 0.5  # near to it, too
    jogged(jog, (-velocity[0], -velocity[1], -velocity[2]), 100)
    assert jog.blocked == ""
    assert jog.moving


@settings(max_examples=5, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_no_sequence_of_wishes_leaves_what_is_allowed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    geometry = {k: v * rng.uniform(0.95, 1.05) for k, v in MACHINE.to_dict()["geometry"].items()}
    machine = replace(MACHINE, geometry=dg.Geometry(**geometry))
    limits = JogLimits(speed=250.0, acceleration=4000.0, jerk=1e5)
    home = dg.inverse(machine.geometry, (-41.0, 0.0, 302.0))
    jog = Jog(machine, home, limits)
    rows = [np.repeat(home[None], 3, axis=0)]
    for wish in rng.uniform(-250.0, 250.0, (5, 3)):
        rows += [jogged(jog, tuple(wish), int(rng.integers(5, 80)))]
    rows.append(jogged(jog, (0.0, 0.0, 0.0), 100))
    carriages = np.concatenate(rows)
    require_room(machine, carriages)
    assert not jog.moving
    for order, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
        worst = np.abs(np.diff(carriages, order, axis=0)).max(axis=0) / CYCLE**order
        assert np.all(worst <= getattr(machine.limits, name) * (1 + 1e-6)), name


def test_it_does_not_begin_where_the_machine_must_not_stand() -> None:
    with pytest.raises(dg.PathError, match="recover first"):
        Jog(MACHINE, dg.inverse(MACHINE.geometry, (-41.0, 160.0, 290.0)))
    with pytest.raises(dg.InputError, match="speed"):
        JogLimits(speed=0.0)
    with pytest.raises(dg.InputError, match="velocity"):
        Jog(MACHINE, HOME).aim([1.0, 2.0])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_no_motion_bows_off_the_chords_of_its_samples_by_more_than_is_taken_off(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits = JogLimits()
    jog = Jog(MACHINE, HOME, limits)
    way = np.eye(3)[rng.integers(3)] if rng.integers(2) else rng.normal(size=3)
    straight = bool(rng.integers(2))
    state, wish = rng.normal(size=(3, 3)), rng.normal(size=3)
    if straight:
        way /= np.linalg.norm(way)
        state, wish = rng.normal(size=(3, 1)) * way, rng.normal() * way
    scale = np.array([1.0, 0.5 * limits.speed, 0.3 * limits.acceleration])[:, None]
    motion = jog._go_over_to(state * scale, wish * 0.5 * limits.speed)
    times = np.linspace(0.0, motion.duration, 17)
    samples = _sample(motion, times)
    bow = 0.125 * _bound_bends(samples, float(times[1]), limits.jerk)
    low, high = samples[:-1, 0], samples[1:, 0]
    square = np.maximum(((high - low) ** 2).sum(axis=-1), 1e-300)
    for share in np.linspace(0.0, 1.0, 21):
        place = _sample(motion, times[:-1] + share * times[1])[:, 0]
        along = np.clip(((place - low) * (high - low)).sum(axis=-1) / square, 0.0, 1.0)
        off = np.linalg.norm(place - low - along[:, None] * (high - low), axis=-1)
        assert np.all(off <= bow + 1e-7)
