"""A MuJoCo model as a witness of the mechanism: loops closed by Newton, forces without softness."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

CARRIAGES = ("carriage_1", "carriage_2", "carriage_3")
_STEP = 1e-4  # [s], of the differences of the closures' Jacobian
METRE = 1e-3


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
        """Jacobian of the closures, (15, joints)."""
        equality = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        jacobian: np.ndarray = self.data.efc_J.reshape(-1, self.model.nv)[equality]
        return jacobian.copy()

    @property
    def residual(self) -> np.ndarray:
        """What the closures gape [m], (15,)."""
        equality = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        gaps: np.ndarray = self.data.efc_pos[equality]
        return gaps

    @property
    def position(self) -> np.ndarray:
        """O' [mm]."""
        return np.array(1e3 * self.data.site("platform").xpos)

    @property
    def rotation(self) -> np.ndarray:
        """How the platform is turned."""
        return np.array(self.data.body("platform").xmat.reshape(3, 3))

    def close(self, carriages: np.ndarray) -> None:
        """Hold the carriages [mm] and close the loops by Newton's method."""
        self.data.qvel[:] = 0.0
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

    def forces(self, state: Any) -> np.ndarray:
        """Forces that the carriages need in one state of a motion [N].

        M a + bias = S f + J^T lambda, by least squares, with joint velocities and accelerations
        that keep the closures' first and second derivatives at zero.

        Args:
            state: ``dg.State`` of one instant.
        """
        self.close(state.carriages)
        jacobian = self.constraints
        velocity = self._solve(jacobian, METRE * state.velocity, np.zeros(len(jacobian)))
        bend = self._jacobian_rate(velocity) @ velocity
        acceleration = self._solve(jacobian, METRE * state.acceleration, -bend)
        data, count = self.data, self.model.nv
        data.qvel[:] = velocity
        mujoco.mj_forward(self.model, data)
        matrix = np.zeros((count, count))
        mujoco.mj_fullM(self.model, data, matrix)
        needed = matrix @ acceleration + data.qfrc_bias - data.qfrc_passive
        needed += self.model.dof_frictionloss * np.sign(velocity)
        selected = np.eye(count)[:, self.driven]
        solution = np.linalg.lstsq(np.hstack([selected, jacobian.T]), needed, rcond=1e-11)[0]
        return np.asarray(solution[:3])

    def _solve(self, jacobian: np.ndarray, driven: np.ndarray, wished: np.ndarray) -> np.ndarray:
        """Return rates of all joints with those of the carriages given and J rates = wished."""
        rates = np.zeros(self.model.nv)
        rates[self.driven] = driven
        rest = wished - jacobian @ rates
        rates[self.passive] = np.linalg.lstsq(jacobian[:, self.passive], rest, rcond=1e-9)[0]
        return rates

    def _jacobian_rate(self, velocity: np.ndarray) -> np.ndarray:
        """Return dJ/dt while all joints move at constant velocity: differences of fourth order."""
        here, found = self.data.qpos.copy(), []
        for shift in (-2, -1, 1, 2):
            self.data.qpos[:] = here + shift * _STEP * velocity
            mujoco.mj_forward(self.model, self.data)
            found.append(self.constraints)
        self.data.qpos[:] = here
        return np.asarray((found[0] - 8.0 * found[1] + 8.0 * found[2] - found[3]) / (12.0 * _STEP))
