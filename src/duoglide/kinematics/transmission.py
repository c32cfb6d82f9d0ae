"""How the mechanism turns carriage speeds and forces into the platform's, axis by axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray
from duoglide.kinematics.model import jacobian
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.machine import Geometry


@dataclass(frozen=True, slots=True, eq=False)
class Transmission:
    """Singular values of the Jacobian J = d carriages / d position, and what they mean.

    The velocity ellipsoid holds the platform velocities at which the squares of the carriage
    velocities add up to 1; the force ellipsoid the platform forces that carriage forces of that
    size can hold. They share their axes, and their half-lengths are each other's inverse.

    Attributes:
        axes: Unit vectors along the axes of both ellipsoids, one per row, shape (..., 3, 3).
        velocity: Half-lengths of the velocity ellipsoid [mm/s per mm/s], rising, shape (..., 3);
            infinite where a parallel singularity frees the platform.
        force: Half-lengths of the force ellipsoid [N/N], falling, shape (..., 3).
    """

    axes: FloatArray
    velocity: FloatArray
    force: FloatArray

    @property
    def condition_number(self) -> FloatArray:
        """Greatest over least singular value, 1 where all directions are alike, shape (...)."""
        with np.errstate(divide="ignore"):
            ratio: FloatArray = self.force[..., 0] / self.force[..., -1]
        return ratio

    @property
    def manipulability(self) -> FloatArray:
        """Volume that the carriages' velocities span at the platform, |det J|^-1, shape (...)."""
        with np.errstate(over="ignore"):
            volume: FloatArray = self.velocity.prod(axis=-1)
        return volume


def transmission(
    geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING
) -> Transmission:
    """Decompose the Jacobian at ``position``.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        mode: Which of the inverse solutions.

    Returns:
        The axes of the velocity and force ellipsoids, and their half-lengths.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach, where the Jacobian is infinite.
    """
    _, force, axes = np.linalg.svd(jacobian(geometry, position, mode))
    with np.errstate(divide="ignore"):
        velocity = 1.0 / force
    return Transmission(axes=axes, velocity=velocity, force=force)
