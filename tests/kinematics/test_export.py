"""MuJoCo as an independent witness: it is given the links and joints, never a closed form."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

import duoglide as dg
from duoglide.errors import ConfigError, InputError
from duoglide.kinematics.export import build_tree, to_mjcf
from duoglide.kinematics.home import home_position

mujoco = pytest.importorskip("mujoco")
from mujoco_witness import Witness  # noqa: E402  # it needs mujoco

WORKING = dg.WorkingMode()
GEOMETRIES = {
    "Table 1": dg.Geometry(),
    "riser and drops": dg.Geometry(
        riser_height=12.0, arm_drop=8.0, strut_drop=-6.0, arm_length=190
    ),
}


def random_lines(geometry: dg.Geometry, count: int) -> list[np.ndarray]:
    """Ways from the reference pose to random poses, inside the working mode all along."""
    random = np.random.default_rng(11)
    start = reference(geometry)
    reach = [geometry.arm_length, 200.0, geometry.strut_length]
    lines = []
    while len(lines) < count:
        goal = start + random.uniform(-1, 1, 3) * reach
        line = start + np.linspace(0.0, 1.0, 13)[1:, None] * (goal - start)
        if dg.reachable(geometry, line).all():
            sides = dg.margins(geometry, line)
            if (
                min(sides.legs_flat.min(), sides.arm_strut.min()) > 5.0
                and dg.clearance(geometry, line).min() > 1.0
            ):
                lines.append(line)
    return lines


def reference(geometry: dg.Geometry) -> np.ndarray:
    tree = build_tree(geometry)
    platform = next(body for body in tree.bodies if body.name == "platform")
    return np.add(platform.origin, tree.platform_offset)


@pytest.fixture(scope="module", params=GEOMETRIES)
def visited(request: pytest.FixtureRequest) -> list[tuple[np.ndarray, np.ndarray, int, float]]:
    """Carriages, MuJoCo's O', rank of the closures and rotation at 60 random poses."""
    geometry = GEOMETRIES[request.param]
    witness = Witness(to_mjcf(geometry))
    home = witness.data.qpos.copy()
    found = []
    for line in random_lines(geometry, 60):
        witness.data.qpos[:] = home
        for carriages in dg.inverse(geometry, line):
            witness.close(carriages)
        rank = int(np.linalg.matrix_rank(witness.constraints, tol=1e-9))
        turned = float(np.abs(witness.rotation - np.eye(3)).max())
        expected = dg.forward(geometry, carriages)
        assert np.allclose(expected, line[-1], atol=1e-8)
        found.append((witness.position.copy(), expected, rank, turned))
    return found


Visited = list[tuple[np.ndarray, np.ndarray, int, float]]


def test_the_closures_leave_mobility_three(visited: Visited) -> None:
    model = mujoco.MjModel.from_xml_string(to_mjcf(dg.Geometry()))
    assert model.nv == 13
    assert {model.nv - rank for _, _, rank, _ in visited} == {3}


def test_the_platform_does_not_turn(visited: Visited) -> None:
    assert max(turned for _, _, _, turned in visited) < 1e-10


def test_forward_kinematics_agree_with_mujoco_to_a_micrometre(visited: Visited) -> None:
    errors = [np.abs(found - expected).max() for found, expected, _, _ in visited]
    assert max(errors) < 1e-3  # [mm]; in fact about 1e-9


def test_fifteen_rows_close_thirteen_joints() -> None:
    witness = Witness(dg.to_mjcf(dg.Machine.default()))
    assert witness.constraints.shape == (15, 13)
    assert np.linalg.matrix_rank(witness.constraints, tol=1e-9) == 10
    assert np.abs(witness.residual).max() < 1e-12


SINGULAR = {
    "case 2": ((187.2797, 0.0, 250.0), WORKING),
    "legs flat": ((0.0, 0.0, 70.0 + np.sqrt(180.0**2 - 45.0**2)), WORKING),
    "legs parallel": ((-80.3862, 66.73, 307.2328), dg.WorkingMode(1, 1, 1, 1)),
}


def on_case_2(position: tuple[float, float, float]) -> np.ndarray:
    """Put x on the curve of case 2 to rounding, at the given z."""
    low, high, z = position[0] - 0.01, position[0] + 0.01, position[2]
    for _ in range(80):
        middle = 0.5 * (low + high)
        inside = dg.margins(dg.Geometry(), (middle, 0.0, z)).arm_strut > 0.0
        low, high = (middle, high) if inside else (low, middle)
    return np.array([low, 0.0, z])


@pytest.mark.parametrize("name", SINGULAR)
def test_the_platform_moves_with_held_carriages_at_a_parallel_singularity(name: str) -> None:
    position, mode = SINGULAR[name]
    pose = on_case_2(position) if name == "case 2" else np.array(position)
    witness = Witness(to_mjcf(dg.Geometry(), pose, mode))
    count, motion = witness.freedoms()
    assert count == 1
    assert np.linalg.norm(motion) > 1e-3
    parallel = parallel_jacobian(pose, mode)
    values, rows = np.linalg.svd(parallel)[1:]
    assert values[-1] < 1e-8 * values[0]
    unit = motion / np.linalg.norm(motion)
    assert abs(rows[-1] @ unit) == pytest.approx(1.0, abs=1e-6)


def parallel_jacobian(pose: np.ndarray, mode: dg.WorkingMode) -> np.ndarray:
    """A of Eq. 16 for Table 1."""
    x, y, z = pose
    q1, q2, q3 = dg.inverse(dg.Geometry(), pose, mode)
    cos = (45.0 - x) / 180.0
    sin = np.sqrt(1.0 - cos**2)
    h = z - 70.0 - 180.0 * sin
    cot = cos / sin
    return np.array(
        [
            [cot * h, -(y - 60.0 - q1), -h],
            [cot * h, -(y + 60.0 - q2), -h],
            [x + 45.0, y - q3, z - 70.0],
        ]
    )


def test_held_carriages_hold_the_platform_elsewhere() -> None:
    assert Witness(to_mjcf(dg.Geometry())).freedoms()[0] == 0


def test_all_carriages_together_move_y_alone() -> None:
    geometry = dg.Geometry()
    witness = Witness(to_mjcf(geometry))
    before = witness.position.copy()
    carriages = 1e3 * witness.data.qpos[witness.driven]
    for shift in np.linspace(0.0, 50.0, 6):
        witness.close(carriages + shift)
    assert witness.position - before == pytest.approx([0.0, 50.0, 0.0], abs=1e-9)


def test_a_ball_joint_in_place_of_r33_would_free_the_platform() -> None:
    root = Xml.fromstring(to_mjcf(dg.Geometry()))
    equality = root.find("equality")
    assert equality is not None
    equality.remove(list(equality)[-1])
    witness = Witness(Xml.tostring(root, encoding="unicode"))
    assert witness.model.nv - np.linalg.matrix_rank(witness.constraints, tol=1e-9) > 3


def test_the_simulation_keeps_the_loops_closed_while_it_moves() -> None:
    machine = dg.Machine.default()
    witness = Witness(dg.to_mjcf(machine))
    goal = dg.inverse(machine.geometry, np.add(home_position(machine), (10.0, 20.0, 10.0)))
    witness.data.ctrl[:] = 1e-3 * goal
    for _ in range(800):
        mujoco.mj_step(witness.model, witness.data)
    mujoco.mj_forward(witness.model, witness.data)
    carriages = 1e3 * witness.data.qpos[witness.driven]
    assert carriages == pytest.approx(goal, abs=0.1)
    assert np.abs(witness.residual).max() < 1e-5  # [m]
    assert witness.position == pytest.approx(dg.forward(machine.geometry, carriages), abs=0.1)


def test_the_model_has_one_base_and_weighs_what_the_machine_does() -> None:
    machine = dg.Machine(masses=dg.Masses(payload=0.7, drive=(0.1, 0.2, 0.3), strut=0.25))
    model = mujoco.MjModel.from_xml_string(dg.to_mjcf(machine))
    roots = [model.body(i).name for i in range(1, model.nbody) if model.body_parentid[i] == 0]
    assert roots == ["base"]
    whole = machine.masses.complete(machine.geometry)
    parts = (whole.coupler, whole.riser, whole.arm, whole.platform, whole.payload)
    weighed = sum(whole.carriage) + 0.25 + 2.0 * (whole.leg or 0.0) + sum(p or 0.0 for p in parts)
    assert model.body_mass.sum() == pytest.approx(weighed, rel=1e-12)
    slides = [model.joint(name).dofadr[0] for name in ("carriage_1", "carriage_2", "carriage_3")]
    assert model.dof_armature[slides].tolist() == [0.1, 0.2, 0.3]
    assert model.dof_armature.sum() == pytest.approx(0.6)
    assert model.dof_damping[slides].tolist() == pytest.approx([2.0, 2.0, 2.0])
    assert model.opt.gravity.tolist() == pytest.approx([0.0, 0.0, -9.80665])


def test_the_actuators_hold_the_platform_where_the_mechanism_yields_most() -> None:
    """The legs are 11 mm from lying flat at (180, 0, 200): soft actuators let it fall through."""
    witness = Witness(to_mjcf(dg.Machine.default(), (180.0, 0.0, 200.0)))
    witness.data.ctrl[:] = witness.data.qpos[witness.driven]
    for _ in range(3000):
        mujoco.mj_step(witness.model, witness.data)
    assert np.linalg.norm(witness.position - [180.0, 0.0, 200.0]) < 0.5


def test_poses_beyond_reach_and_batches_are_refused() -> None:
    with pytest.raises(dg.UnreachableError):
        to_mjcf(dg.Geometry(), (0.0, 0.0, 500.0))
    with pytest.raises(InputError, match="one triple"):
        to_mjcf(dg.Geometry(), np.zeros((2, 3)))
    machine = replace(dg.Machine.default(), home_position=(0.0, 0.0, 500.0))
    with pytest.raises(ConfigError, match="home_position"):
        to_mjcf(machine)
