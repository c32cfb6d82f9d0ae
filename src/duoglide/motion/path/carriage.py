"""A checked path seen from the rails: where the three carriages go."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.kinematics.constants import PoseConstants, pose_constants
from duoglide.kinematics.derivatives import carriage_jets
from duoglide.kinematics.model import inverse_derivatives
from duoglide.kinematics.modes import WORKING
from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.checked import CheckedPath


@dataclass(frozen=True)
class CarriagePath:
    """The carriages along a checked curve, exact to the third derivative.

    Attributes:
        checked: The path that this is the image of.
    """

    checked: CheckedPath

    def __repr__(self) -> str:
        return f"CarriagePath({self.length:.6g} mm, {self.checked.path!r})"

    @property
    def machine(self) -> Machine:
        """The machine that it was checked for."""
        return self.checked.machine

    @property
    def curve(self) -> Curve:
        """The curve of the platform's centre."""
        return self.checked.curve

    @property
    def length(self) -> float:
        """How long the platform's path is [mm]."""
        return self.checked.curve.length

    @property
    def least_clearance(self) -> float:
        """Least distance to a singular surface or edge of reach on the path [mm]."""
        return self.checked.report["clearance"].margin

    @property
    def carriage_margin(self) -> float:
        """Least error of all carriages with which links may part or a surface is met [mm]."""
        return self.checked.report["carriage_margin"].margin

    def position(self, sigma: float | FloatArray) -> FloatArray:
        """Return the platform centre O' in the base frame [mm], shape (..., 3)."""
        return self.checked.curve.position(sigma)

    @cached_property
    def _constants(self) -> PoseConstants:
        return pose_constants(self.checked.machine.geometry, WORKING)

    def derivatives(
        self, sigma: float | FloatArray, piece: IndexArray | int | None = None
    ) -> FloatArray:
        """Evaluate the carriages and three derivatives by sigma, through the closed form.

        Args:
            sigma: Parameter [mm], clamped to the curve; a scalar or any shape.
            piece: Index of the curve's piece to use, which names the side at a break.

        Returns:
            Shape (..., 4, 3), last axis the carriages [mm, 1, 1/mm, 1/mm^2].
        """
        states = self.checked.curve.derivatives(sigma, piece)
        if states.ndim == 2:
            x, y, z = zip(*states.tolist(), strict=True)
            return np.array(carriage_jets(x, y, z, self._constants)).T
        return inverse_derivatives(self.checked.machine.geometry, states)


def map_to_carriages(checked: CheckedPath) -> CarriagePath:
    """Carry a checked path to the rails."""
    return CarriagePath(checked)
