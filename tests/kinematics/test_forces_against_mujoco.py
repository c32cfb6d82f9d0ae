"""The forces of the closed form beside those of MuJoCo, which is given bodies, joints and masses.

MuJoCo's own inverse dynamics keeps closures softly; the witness closes them by Newton's method.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.home import home_position
from duoglide.motion.motion import State

mujoco = pytest.importorskip("mujoco")
from mujoco_witness import Witness  # noqa: E402  # it needs mujoco

HEAVY = dg.Masses(
    carriage=(0.5, 0.6, 0.7),
    drive=(0.1, 0.2, 0.05),
    leg=0.11,
    coupler=0.09,
    riser=0.05,
    arm=0.21,
    strut=0.33,
    platform=0.17,
    payload=0.4,
    coulomb_friction=(2.0, 3.0, 4.0),
    viscous_friction=(0.001, 0.003, 0.002),
    gravity=(500.0, -3000.0, -9000.0),
)
MACHINES = {
    "Table 1": dg.Machine.default(),
    "riser and drops, inclined": dg.Machine(
        geometry=dg.Geometry(riser_height=12.0, arm_drop=8.0, strut_drop=-6.0, arm_length=190),
        masses=HEAVY,
    ),
}
NAMES = ("pick", "line", "arc", "spline", "polyline")


def path(name: str, machine: dg.Machine) -> dg.Path:
    """Return a path of one kind about the machine's home."""
    at = np.array(home_position(machine))

    def by(x: float, y: float, z: float) -> np.ndarray:
        return np.add(at, (x, y, z))

    if name == "pick":
        return dg.pick_and_place(by(0, -110, -8), by(0, 110, -8), 25.0, 4.0)
    if name == "line":
        return dg.Path.line(by(-25, -60, 0), by(25, 60, -10))
    if name == "arc":
        return dg.Path.arc(by(-20, -40, 0), by(0, 0, 10), by(25, 40, -5))
    if name == "spline":
        return dg.Path.through([by(-20, -80, 0), by(10, -20, 8), by(-10, 40, -8), by(0, 90, 0)])
    return dg.Path.polyline([by(-20, -80, 0), by(20, 20, 8), by(-10, 90, -5)], 3.0)


def plan(machine: dg.Machine, name: str) -> dg.Trajectory:
    return dg.plan(machine, path(name, machine), brake_safe=False)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES)
def test_the_forces_of_a_plan_are_those_of_constrained_inverse_dynamics(
    machine: dg.Machine, name: str
) -> None:
    motion = plan(machine, name)
    times = np.linspace(0.013, 0.987, 24) * motion.duration
    closed = motion.forces(times)
    witness = Witness(dg.to_mjcf(machine))
    states = motion.at(times)
    parts = (states.carriages, states.velocity, states.acceleration, states.jerk)
    for row in range(times.size):
        found = witness.forces(State(*(part[row] for part in parts)))
        error = np.abs(found - closed[row]).max()
        assert error < 1e-6 * np.abs(closed).max(), (row, found, closed[row])


def follow(witness: Witness, motion: dg.Trajectory, *, by_forces: bool) -> tuple[float, float]:
    """Simulate a plan; return the largest errors of carriages and of O' [mm].

    Args:
        witness: At any pose.
        motion: From rest.
        by_forces: Whether the plan's forces alone drive the carriages, in an open loop; else the
            model's own actuators are sent the positions.
    """
    model, data = witness.model, witness.data
    step = model.opt.timestep
    times = np.arange(int(motion.duration / step) + 1) * step
    carriages, position = motion.at(times).carriages, motion.position_at(times)
    forces = motion.forces(times + 0.5 * step)
    witness.close(carriages[0])
    errors = []
    for row in range(times.size - 1):
        if by_forces:
            data.qfrc_applied[witness.driven] = forces[row]
        else:
            data.ctrl[:] = 1e-3 * carriages[row]
        mujoco.mj_step(model, data)
        off = np.abs(1e3 * data.qpos[witness.driven] - carriages[row + 1]).max()
        errors.append((off, np.linalg.norm(witness.position - position[row + 1])))
    worst = np.max(errors, axis=0)
    return float(worst[0]), float(worst[1])


@pytest.mark.parametrize("name", NAMES)
def test_the_actuators_of_the_model_trail_a_plan_by_less_than_a_millimetre(name: str) -> None:
    machine = MACHINES["riser and drops, inclined"]
    motion = plan(machine, name)
    off, _ = follow(Witness(dg.to_mjcf(machine)), motion, by_forces=False)
    assert 0.05 < off < 1.0


@pytest.mark.parametrize(("friction", "most"), [(False, 0.1), (True, 0.8)])
def test_a_simulation_that_the_forces_drive_follows_the_plan(friction: bool, most: float) -> None:
    """Nothing corrects it: what the forces miss adds up. MuJoCo's dry friction is a little soft."""
    given = MACHINES["riser and drops, inclined"]
    none = 0.0, 0.0, 0.0
    smooth = replace(given.masses, coulomb_friction=none, viscous_friction=none)
    machine = given if friction else replace(given, masses=smooth)
    motion = plan(machine, "pick")
    witness = Witness(dg.to_mjcf(machine))
    options = witness.model.opt
    options.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    options.timestep, options.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    witness.model.eq_solref[:, 0] = 2e-4  # [s]
    off, apart = follow(witness, motion, by_forces=True)
    assert max(off, apart) < most
    assert np.abs(np.diff(motion.at([0.0, 0.5 * motion.duration]).carriages, axis=0)).max() > 50.0
