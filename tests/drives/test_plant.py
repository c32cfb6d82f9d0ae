from __future__ import annotations

from math import pi

import pytest

from duoglide.drives.simulation.plant import Plant, PlantParameters


def follow(plant: Plant, speed: float, seconds: float) -> float:
    """Run a ramp; return the following error at its end."""
    step = 0.001
    for i in range(round(seconds / step)):
        plant.drive(speed * i * step, speed, step)
    return speed * seconds - plant.position


def test_a_carriage_settles_on_a_demand_that_stands() -> None:
    plant = Plant()
    for _ in range(300):
        plant.drive(5.0, 0.0, 0.001)
    assert plant.position == pytest.approx(5.0, abs=1e-6)
    assert plant.velocity == pytest.approx(0.0, abs=1e-3)


def test_following_error_on_a_ramp_is_what_the_equation_says() -> None:
    p = PlantParameters(bandwidth=50.0, damping=1.0, velocity_feedforward=0.9)
    lag = 2.0 * p.damping * (1.0 - p.velocity_feedforward) / (2.0 * pi * p.bandwidth)
    assert follow(Plant(p), 1000.0, 0.5) == pytest.approx(1000.0 * lag, rel=1e-3)


def test_full_feed_forward_leaves_no_following_error_on_a_ramp() -> None:
    assert abs(follow(Plant(PlantParameters(velocity_feedforward=1.0)), 1000.0, 0.5)) < 1e-6


def test_the_motor_has_a_greatest_acceleration() -> None:
    plant = Plant(PlantParameters(greatest_acceleration=1000.0))
    plant.drive(1000.0, 0.0, 0.01)
    assert plant.velocity == pytest.approx(10.0)


@pytest.mark.parametrize("brake_set", [True, False])
def test_without_power_friction_and_brake_stop_the_carriage(brake_set: bool) -> None:
    p = PlantParameters(coasting_deceleration=1000.0, brake_deceleration=3000.0)
    plant = Plant(p)
    plant.velocity = -100.0
    for _ in range(200):
        plant.coast(brake_set, 0.001)
    braking = 4000.0 if brake_set else 1000.0
    assert plant.velocity == 0.0
    assert plant.position == pytest.approx(-(100.0**2) / (2.0 * braking), rel=1e-9)


def test_a_jammed_carriage_does_not_move() -> None:
    plant = Plant()
    plant.jammed = True
    plant.drive(10.0, 0.0, 0.01)
    assert plant.position == 0.0
    assert plant.velocity == 0.0
