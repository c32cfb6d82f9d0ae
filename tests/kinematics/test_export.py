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

WORKING = dg.WorkingMode()
GEOMETRIES = {
    "Table 1": dg.Geometry(),
    "riser and drops": dg.Geometry(
        riser_height=12.0, arm_drop=8.0, strut_drop=-6.0, arm_length=190
    ),
}
CARRIAGES = ("carriage_1", "carriage_2", "carriage_3")


class Witness:
    """A MuJoCo model, moved by its own constraint Jacobian alone."""

    def __init__(self, mjcf: str) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf)
        self.data = mujoco.MjData(self.model)
        self.driven = [self.model.joint(name).qposadr[0] for name in CARRIAGES]
        self.passive = [i for i in range(self.model.nv) if i not in self.driven]
        mujoco.mj_forward(self.model, self.data)

    @property
    def constraints(self) -> np.ndarray:
        equality = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        jacobian: np.ndarray = self.data.efc_J.reshape(-1, self.model.nv)[equality]
        return jacobian

    @property
    def residual(self) -> np.ndarray:
        equality = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        gaps: np.ndarray = self.data.efc_pos[equality]
        return gaps

    @property
    def position(self) -> np.ndarray:
        return 1e3 * self.data.site("platform").xpos

    @property
    def rotation(self) -> np.ndarray:
        return self.data.body("platform").xmat.reshape(3, 3)

    def close(self, carriages: np.ndarray) -> None:
        """Hold the carriages [mm] and close the loops by Newton's method."""
        self.data.qpos[self.driven] = 1e-3 * carriages
        for _ in range(20):
            mujoco.mj_forward(self.model, self.data)
            if np.abs(self.residual).max() < 1e-13:
                return
            step = np.linalg.lstsq(self.constraints[:, self.passive], self.residual, rcond=1e-9)[0]
            self.data.qpos[self.passive] -= step
        assert np.abs(self.residual).max() < 1e-10

    def freedoms(self) -> tuple[int, np.ndarray]:
        """Motions that are left while the carriages are held: their number, and O' in the first."""
        jacobian = self.constraints[:, self.passive]
        _, values, rows = np.linalg.svd(jacobian)
        rank = int((values > 1e-9 * values[0]).sum())
        site = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, site, None, self.model.site("platform").id)
        return len(self.passive) - rank, site[:, self.passive] @ rows[-1]


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


def test_poses_beyond_reach_and_batches_are_refused() -> None:
    with pytest.raises(dg.UnreachableError):
        to_mjcf(dg.Geometry(), (0.0, 0.0, 500.0))
    with pytest.raises(InputError, match="one triple"):
        to_mjcf(dg.Geometry(), np.zeros((2, 3)))
    machine = replace(dg.Machine.default(), home_position=(0.0, 0.0, 500.0))
    with pytest.raises(ConfigError, match="home_position"):
        to_mjcf(machine)
