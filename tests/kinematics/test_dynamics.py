"""Properties of the closed form; MuJoCo as a witness is in test_forces_against_mujoco.py."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics import batch
from duoglide.kinematics.dynamics import kernels
from duoglide.kinematics.dynamics.constants import KILOGRAM
from duoglide.kinematics.dynamics.dynamics import constants_of
from duoglide.kinematics.kernels import in_numpy

WORKING = dg.WorkingMode()
HOME = np.array([-41.0, 3.0, 302.0])
STEP = 1e-5  # [s]


class Motion:
    """Poses of one machine with velocities and accelerations, well inside its reach."""

    def __init__(self, geometry: dg.Geometry, rng: np.random.Generator, count: int = 12) -> None:
        draw = rng.uniform
        self.machine = dg.Machine(
            geometry=geometry,
            masses=dg.Masses(
                carriage=tuple(draw(0.2, 1.0, 3)),
                drive=tuple(draw(0.0, 0.5, 3)),
                leg=draw(0.01, 0.3),
                coupler=draw(0.01, 0.3),
                riser=draw(0.01, 0.3),
                arm=draw(0.01, 0.3),
                strut=draw(0.01, 0.3),
                platform=draw(0.01, 0.5),
                payload=draw(0.0, 1.0),
                coulomb_friction=0.0,  # type: ignore[arg-type]  # one for all
                viscous_friction=0.0,  # type: ignore[arg-type]
                gravity=tuple(draw(-1e4, 1e4, 3)),
            ),
        )
        cube = draw(-700.0, 700.0, (4000, 3))
        found = cube[dg.reachable(geometry, cube, WORKING)]
        inside = np.abs(dg.margins(geometry, found).least()) > 3.0
        self.position = found[inside][:count]
        shape = self.position.shape
        self.velocity, self.acceleration = rng.normal(0, 300, shape), rng.normal(0, 2e4, shape)

    def at(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity a little later."""
        v, a = self.velocity, self.acceleration
        return self.position + v * t + 0.5 * a * t * t, v + a * t

    def forces(self) -> np.ndarray:
        return dg.carriage_forces(self.machine, self.position, self.velocity, self.acceleration)


@pytest.fixture(scope="module")
def motions(geometries: list[dg.Geometry]) -> list[Motion]:
    rng = np.random.default_rng(17)
    made = [Motion(geometry, rng) for geometry in geometries]
    kept = [motion for motion in made if len(motion.position) > 3]
    assert len(kept) > 12
    return kept


def test_what_the_drives_do_becomes_energy(motions: list[Motion]) -> None:
    for motion in motions:
        rates = [dg.jacobian(motion.machine.geometry, motion.position) @ motion.velocity[..., None]]
        power = 1e-3 * (motion.forces() * rates[0][..., 0]).sum(axis=-1)
        energy = [
            dg.kinetic_energy(motion.machine, *motion.at(t))
            + dg.potential_energy(motion.machine, motion.at(t)[0])
            for t in (-STEP, STEP)
        ]
        change = (energy[1] - energy[0]) / (2.0 * STEP)
        assert np.allclose(power, change, rtol=1e-5, atol=1e-4 * np.abs(change).max())


def momentum_along_y(motion: Motion, t: float) -> np.ndarray:
    """Sum of mass times velocity along y of every part, from the places of its ends."""
    masses: Any = motion.machine.masses
    geometry = motion.machine.geometry
    position, velocity = motion.at(t)
    rates = (dg.jacobian(geometry, position) @ velocity[..., None])[..., 0]
    along = velocity[:, 1]
    total = ((np.array(masses.carriage) + masses.drive) * rates).sum(axis=-1)
    total += masses.leg * 0.5 * (rates[:, 0] + rates[:, 1] + 2.0 * along)
    total += (masses.coupler + masses.riser + masses.arm + masses.platform) * along
    total += masses.payload * along + masses.strut * 0.5 * (rates[:, 2] + along)
    return np.asarray(1e-3 * total)


def test_the_drives_and_gravity_alone_change_the_momentum_along_y(motions: list[Motion]) -> None:
    for motion in motions:
        change = (momentum_along_y(motion, STEP) - momentum_along_y(motion, -STEP)) / (2.0 * STEP)
        masses = motion.machine.masses
        parts = (masses.leg, masses.leg, masses.coupler, masses.riser, masses.arm, masses.strut)
        hanging = sum(masses.carriage) + sum(part or 0.0 for part in parts)
        hanging += (masses.platform or 0.0) + masses.payload  # what a motor has turns, not hangs
        weight = 1e-3 * hanging * masses.gravity[1]
        found = motion.forces().sum(axis=-1) + weight
        assert np.allclose(found, change, rtol=1e-6, atol=1e-5 * np.abs(change).max())


def test_accelerations_come_back_from_the_forces(motions: list[Motion]) -> None:
    for motion in motions:
        for friction in (0.0, 5.0):
            masses = replace(
                motion.machine.masses,
                coulomb_friction=(friction, 0.5 * friction, friction),
                viscous_friction=(0.01 * friction,) * 3,
            )
            machine = replace(motion.machine, masses=masses)
            given = motion.position, motion.velocity
            forces = dg.carriage_forces(machine, *given, motion.acceleration)
            found = dg.platform_acceleration(machine, *given, forces)
            assert np.allclose(found, motion.acceleration, rtol=1e-7, atol=1e-4)


def test_the_mass_matrix_is_that_of_the_energy_and_positive(motions: list[Motion]) -> None:
    for motion in motions:
        matrix = dg.mass_matrix(motion.machine, motion.position)
        v = motion.velocity
        energy = 0.5e-6 * np.einsum("ni,nij,nj->n", v, matrix, v)
        assert np.allclose(
            energy, dg.kinetic_energy(motion.machine, motion.position, v), rtol=1e-12
        )
        assert np.all(matrix == np.swapaxes(matrix, -1, -2))
        assert np.linalg.eigvalsh(matrix).min() > 0.0


def test_friction_points_against_each_carriage_and_rest_has_none() -> None:
    smooth = dg.Machine(masses=dg.Masses(coulomb_friction=(0, 0, 0), viscous_friction=(0, 0, 0)))
    rough = dg.Machine(
        masses=dg.Masses(coulomb_friction=(1, 2, 3), viscous_friction=(0.01, 0.02, 0.03))
    )
    for velocity in ((200.0, -300.0, 100.0), (0.0, 400.0, 0.0)):
        given = HOME, velocity, (1e3, 2e3, 3e3)
        rates = dg.jacobian(rough.geometry, HOME) @ velocity
        more = dg.carriage_forces(rough, *given) - dg.carriage_forces(smooth, *given)
        expected = np.sign(rates) * [1, 2, 3] + rates * [0.01, 0.02, 0.03]
        assert more == pytest.approx(expected)
    still = HOME, np.zeros(3), np.zeros(3)
    assert np.all(dg.carriage_forces(rough, *still) == dg.carriage_forces(smooth, *still))


def test_a_machine_that_hangs_holds_with_the_opposite_forces() -> None:
    rest = HOME, np.zeros(3), np.zeros(3)
    stands = dg.Machine(masses=dg.Masses(gravity=(0.0, 0.0, -9810.0)))
    hangs = dg.Machine(masses=dg.Masses(gravity=(0.0, 0.0, 9810.0)))
    held = dg.carriage_forces(stands, *rest)
    assert np.abs(held).max() > 1.0
    assert dg.carriage_forces(hangs, *rest) == pytest.approx(-held)


def test_one_formula_for_float_batch_and_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    machine, rng = dg.Machine.default(), np.random.default_rng(3)
    position = HOME + rng.uniform(-20, 20, (600, 3))
    velocity, acceleration = rng.normal(0, 500, (2, 600, 3))
    payload = rng.uniform(0, 1, 600)
    given = position, velocity, acceleration, payload
    many = dg.carriage_forces(machine, *given)
    single = [dg.carriage_forces(machine, *one) for one in zip(*given, strict=True)]
    assert np.array_equal(many, single)
    k, m = constants_of(machine)
    flat = position.ravel(), velocity.ravel(), acceleration.ravel(), KILOGRAM * payload
    out = np.empty(1800)
    assert kernels.forces_loop(flat, (3, 3, 3, 1), out, tuple(k), tuple(m)[:-1]) == 0
    assert np.array_equal(out.reshape(-1, 3), many)
    monkeypatch.setattr(batch, "compiles", lambda array: True)
    monkeypatch.setattr("duoglide.kinematics.dynamics.dynamics.compiles", lambda array: True)
    compiled = dg.carriage_forces(machine, *given)
    assert np.allclose(compiled, many, rtol=1e-13, atol=1e-12)
    same = velocity[0], acceleration[0]
    one = dg.carriage_forces(machine, position, *same)
    assert np.allclose(one[5], dg.carriage_forces(machine, position[5], *same))


def test_a_million_poses_need_less_than_three_copies_of_their_arrays() -> None:
    machine = dg.Machine.default()
    position = np.tile(HOME, (10**6, 1))
    velocity = np.full_like(position, 100.0)
    copy = position.nbytes
    calls: list[Any] = [
        lambda: dg.carriage_forces(machine, position, velocity, velocity),
        lambda: dg.carriage_forces(machine, HOME, velocity, (0.0, 0.0, 0.0)),
        lambda: dg.platform_acceleration(machine, position, velocity, HOME),
    ]
    for call in calls:
        tracemalloc.start()
        call()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 3 * copy, call


def test_poses_without_an_answer_are_named() -> None:
    machine = dg.Machine.default()
    none = np.zeros(3)
    with pytest.raises(dg.UnreachableError, match=r"position\[1\]"):
        dg.carriage_forces(machine, np.stack([HOME, 3.0 * HOME]), none, none)
    flat = np.array([0.0, 0.0, 70.0 + np.sqrt(180.0**2 - 45.0**2)])
    for where in (flat, np.stack([HOME, flat])):
        with pytest.raises(dg.SingularityError, match="legs lie flat") as found:
            dg.carriage_forces(machine, where, none, none)
        assert found.value.family == "legs_flat"
    with pytest.raises(dg.SingularityError, match="edge of reach"):
        dg.carriage_forces(machine, (225.0, 0.0, 100.0), none, none)
    with pytest.raises(dg.InputError, match="payload = -1 kg"):
        dg.carriage_forces(machine, HOME, none, none, -1.0)
    with pytest.raises(dg.InputError, match="do not fit"):
        dg.carriage_forces(machine, np.tile(HOME, (2, 1)), np.zeros((3, 3)), none)
    with pytest.raises(dg.InputError, match="too large"):
        dg.carriage_forces(machine, HOME, (1e200, 0.0, 0.0), none)
    with pytest.raises(dg.InputError, match=r"duoglide\.Machine"):
        dg.carriage_forces(machine.geometry, HOME, none, none)  # type: ignore[arg-type]
    assert dg.carriage_forces(machine, np.empty((0, 3)), none, none).shape == (0, 3)
    assert np.isfinite(dg.platform_acceleration(machine, flat, none, none)).all()


def test_the_kernels_need_nothing_of_numpy() -> None:
    """The columns are the same code: only the roots differ."""
    k, m = constants_of(dg.Machine.default())
    columns = in_numpy(kernels.levers_pose)(HOME[None, 0], HOME[None, 2], k)
    assert [float(c[0]) for c in columns] == list(kernels.levers_pose(HOME[0], HOME[2], k))
    assert kernels.weight_pose(kernels.levers_pose(HOME[0], HOME[2], k), m).y == 0.0
