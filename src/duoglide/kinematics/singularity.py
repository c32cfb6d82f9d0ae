"""How far a pose is from every singular surface, family by family, and to the nearest of them."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_triples
from duoglide.errors import SingularityError
from duoglide.kinematics._distance import nearest_surface
from duoglide.kinematics._kernels import pose_constants
from duoglide.kinematics._reach import require_reach
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.machine import Geometry


@dataclass(frozen=True, slots=True, eq=False)
class Margins:
    """A length [mm] for each singularity family; it is 0 exactly on the family's surface.

    Attributes:
        legs_vertical: l2 - |h|: rise that is left to the legs (serial; edge of reach).
        strut: l9 - sqrt(X^2 + Z^2): distance to the strut's edge of reach (serial).
        legs_parallel: |B| = |yA2 - yA1 - l3|; 0 everywhere in the modes w1 = w2 (parallel).
        legs_flat: h; its sign is the m of the assembly mode (parallel).
        arm_strut: X sin(beta) + Z cos(beta): distance of B3 from the line of the arm through C3 in
            the xz plane, case 2; its sign is the n of the assembly mode (parallel).
        arm_flat: l6 - |x - (b - d)|: distance to where the branches v merge (edge of reach).

    Each has the leading shape of the positions.
    """

    legs_vertical: FloatArray
    strut: FloatArray
    legs_parallel: FloatArray
    legs_flat: FloatArray
    arm_strut: FloatArray
    arm_flat: FloatArray

    def least(self) -> FloatArray:
        """Return the least absolute margin of all families [mm], shape (...)."""
        least: FloatArray = np.abs(np.stack(astuple(self))).min(axis=0)
        return least


def margins(geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING) -> Margins:
    """Measure how far a pose is from each singularity family.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        mode: Which of the inverse solutions.

    Returns:
        A length per family. These are not distances in space (``clearance`` is), except ``strut``
        and ``arm_flat``.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short.
    """
    array = as_triples(position, "position")
    k = pose_constants(geometry, mode)
    reach = require_reach(array, k)
    u, X, Z = array[..., 0] - k[0], array[..., 0] - k[5], array[..., 2] - k[6]
    lacking = np.minimum(reach.lacking, 0.0)
    return Margins(
        legs_vertical=-lacking[..., 1],
        strut=-lacking[..., 2],
        legs_parallel=abs(k[10] - k[9]) * reach.p,
        legs_flat=reach.h,
        arm_strut=(X * reach.A - Z * u) / k[2],
        arm_flat=-lacking[..., 0],
    )


def clearance(geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING) -> FloatArray:
    """Measure the distance to the nearest singular surface or edge of reach of the working mode.

    It is the Euclidean distance in space, to 1e-6 mm. Every surface is a cylinder along y, so that
    it is found in the xz plane: lines (arm flat), half circles of radius l6 (legs vertical and
    flat), a circle (strut) and a quartic curve (arm in line with strut). A distance changes by at
    most the distance moved, so that a sampled path is proven clear between its samples.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        mode: Which of the inverse solutions; in the modes w1 = w2 every pose is singular.

    Returns:
        Distances [mm], shape (...), 0 on a surface.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short.
    """
    array = as_triples(position, "position")
    require_reach(array, pose_constants(geometry, mode))
    if mode.w1 == mode.w2:
        return np.zeros(array.shape[:-1])
    distance, _ = nearest_surface(geometry, mode.v, array)
    return distance


def clearance_gradient(
    geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING
) -> FloatArray:
    """Find the direction straight away from the nearest surface, to back out along.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        mode: Which of the inverse solutions.

    Returns:
        Unit vectors, shape (..., 3): the gradient of ``clearance`` wherever it has one. Where two
        surfaces are equally near, one of them is taken; on a surface itself, its normal, into reach
        where the surface is an edge.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short.
        SingularityError: In the modes w1 = w2 there is no way out.
    """
    array = as_triples(position, "position")
    require_reach(array, pose_constants(geometry, mode))
    if mode.w1 == mode.w2:
        raise SingularityError(
            f"in {mode} the legs are parallel at every pose; no direction leads away from that",
            family="legs_parallel",
        )
    _, normal = nearest_surface(geometry, mode.v, array)
    return normal
