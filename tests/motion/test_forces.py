"""Forces of a motion, and what it demands of the drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import duoglide as dg

PICK = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0, 4.0)
LOADED = dg.Machine(masses=dg.Masses(payload=0.5, platform=0.2))


@pytest.fixture(scope="module")
def pick() -> dg.Trajectory:
    return dg.plan(LOADED, PICK, brake_safe=False)


def test_forces_are_those_of_the_platform_s_motion(pick: dg.Trajectory) -> None:
    step = 1e-4
    times = np.linspace(0.01, pick.duration - 0.01, 30)
    position = [pick.position_at(times + k * step) for k in (-1, 0, 1)]
    velocity = (position[2] - position[0]) / (2.0 * step)
    acceleration = (position[2] - 2.0 * position[1] + position[0]) / step**2
    expected = dg.carriage_forces(LOADED, position[1], velocity, acceleration)
    found = pick.forces(times)
    assert np.abs(found - expected).max() < 2e-3 * np.abs(found).max()
    assert pick.forces(float(times[3])) == pytest.approx(found[3], rel=1e-9)
    assert pick.forces(times[:4].reshape(2, 2)).shape == (2, 2, 3)


def test_a_transfer_needs_the_forces_of_the_same_states() -> None:
    """Its platform follows the carriages: forward kinematics with two derivatives."""
    geometry = LOADED.geometry
    motion = dg.transfer(LOADED, (-41.0, 0.0, 302.0), (-20.0, 40.0, 290.0))
    times = np.linspace(0.1, 0.9, 9) * motion.duration
    state, step = motion.at(times), 1e-5
    before, here, after = (
        dg.forward(geometry, motion.at(times + k * step).carriages) for k in (-1, 0, 1)
    )
    velocity = (after - before) / (2.0 * step)
    forces = motion.forces(times)
    rates = np.einsum("nij,nj->ni", dg.jacobian(geometry, here), velocity)
    assert np.allclose(rates, state.velocity, atol=1e-3)
    acceleration = dg.platform_acceleration(LOADED, here, velocity, forces)
    assert np.allclose(acceleration, (after - 2.0 * here + before) / step**2, rtol=2e-3, atol=30.0)


def test_the_energy_that_is_delivered_and_returned_is_lost_to_friction_alone(
    pick: dg.Trajectory,
) -> None:
    demand = pick.demand()
    times = np.linspace(0.0, pick.duration, 20001)
    speeds = np.abs(pick.at(times).velocity)
    masses = LOADED.masses
    friction = speeds * (masses.coulomb_friction + np.array(masses.viscous_friction) * speeds)
    lost = 1e-3 * friction.sum() * pick.duration / 20000  # from rest to rest at one height
    assert demand.energy.sum() - demand.returned.sum() == pytest.approx(lost, rel=1e-3)
    assert demand.energy.min() > 0.0
    assert demand.total_peak_power <= demand.peak_power.sum() * (1.0 + 1e-12)
    assert demand.peak_force == pytest.approx(np.abs(pick.forces(times)).max(axis=0), rel=1e-3)
    assert np.all(demand.rms_force < 0.9 * demand.peak_force)


def test_what_rests_needs_what_holds_it() -> None:
    path = dg.Path.line((-41.0, 0.0, 302.0), (-41.0, 5.0, 302.0)).at(1, dg.Dwell(30.0))
    motion = dg.plan(LOADED, path)
    end = dg.carriage_forces(LOADED, (-41.0, 5.0, 302.0), np.zeros(3), np.zeros(3))
    assert motion.forces(motion.duration) == pytest.approx(end)
    heavier = replace(LOADED, masses=replace(LOADED.masses, payload=1.5))
    held = dg.carriage_forces(heavier, (-41.0, 5.0, 302.0), np.zeros(3), np.zeros(3))
    assert np.abs(held).max() > 1.5 * np.abs(end).max()
