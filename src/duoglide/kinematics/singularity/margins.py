"""How far a pose is from every singular surface, family by family, and to the nearest of them."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_triples
from duoglide.errors import SingularityError
from duoglide.kinematics.batch import (
    as_batch,
    as_pose,
    legs_many,
    margins_many,
    margins_one,
    triple,
)
from duoglide.kinematics.constants import PoseConstants, pose_constants
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.reach import require_reach
from duoglide.kinematics.singularity.case2 import plain_curve
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.kinematics.singularity.nearest_pose import nearest_of_pose
from duoglide.machine import Geometry

FAMILIES = ("legs_vertical", "strut", "legs_parallel", "legs_flat", "arm_strut", "arm_flat")


class Margins:
    """A length [mm] for each singularity family; it is 0 exactly on the family's surface.

    The families are properties, each of the leading shape of the positions. What the rise of the
    legs alone decides is computed when it is first asked for: a large batch moves less memory.
    """

    # Not a dataclass: frozen fields take longer to set than the margins of one pose to compute.
    __slots__ = ("_constants", "_legs", "_measured")
    _legs: tuple[FloatArray, FloatArray]

    def __init__(self, measured: Sequence[float] | FloatArray, constants: PoseConstants) -> None:
        """Take ``strut``, ``legs_flat``, ``arm_strut`` and ``arm_flat``, and what they are of."""
        self._measured = measured
        self._constants = constants

    @property
    def strut(self) -> FloatArray:
        """l9 - sqrt(X^2 + Z^2): distance to the strut's edge of reach (serial)."""
        return self._family(0)

    @property
    def legs_flat(self) -> FloatArray:
        """h; its sign is the m of the assembly mode (parallel)."""
        return self._family(1)

    @property
    def arm_strut(self) -> FloatArray:
        """Case 2, X sin(beta) + Z cos(beta); its sign is the n of the assembly mode (parallel).

        It is the distance of B3 from the line of the arm through C3 in the xz plane.
        """
        return self._family(2)

    @property
    def arm_flat(self) -> FloatArray:
        """l6 - |x - (b - d)|: distance to where the branches v merge (edge of reach)."""
        return self._family(3)

    @property
    def legs_vertical(self) -> FloatArray:
        """l2 - |h|: rise that is left to the legs (serial; edge of reach)."""
        return self._legs_family(0)

    @property
    def legs_parallel(self) -> FloatArray:
        """|B| = |yA2 - yA1 - l3|; 0 everywhere in the modes w1 = w2 (parallel)."""
        return self._legs_family(1)

    def _family(self, row: int) -> FloatArray:
        """Return one of what was measured; of one pose, a number as numpy has them."""
        return _as_numpy(self._measured[row])

    def _legs_family(self, row: int) -> FloatArray:
        """Return what follows from the rise of the legs, computed once."""
        try:
            legs = self._legs
        except AttributeError:
            legs = self._legs = legs_many(self.legs_flat, self._constants)
        family: FloatArray = legs[row]
        return family

    def by_family(self) -> dict[str, FloatArray]:
        """Return the six margins by the name of their family."""
        return {family: getattr(self, family) for family in FAMILIES}

    def least(self) -> FloatArray:
        """Return the least absolute margin of all families [mm], shape (...)."""
        least: FloatArray = np.abs(np.stack(list(self.by_family().values()))).min(axis=0)
        return least

    def __repr__(self) -> str:
        families = (f"{family}={margin}" for family, margin in self.by_family().items())
        return f"Margins({', '.join(families)})"


def _as_numpy(value: float | FloatArray) -> FloatArray:
    """Return numbers and arrays without axes as numpy's own functions do: as a numpy float."""
    number: Any = value[()] if isinstance(value, np.ndarray) else np.float64(value)
    return number  # type: ignore[no-any-return]  # numpy's stubs know no type for both


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
    k = pose_constants(geometry, mode)
    if (pose := as_pose(position)) and (measured := margins_one(pose, k)):
        return Margins(measured, k)
    array = as_batch(position, "position")
    many, within = margins_many(array, k)
    if not within:
        many = _margins_at_edge(as_triples(array, "position"), k)
    return Margins(many, k)


def _margins_at_edge(position: FloatArray, k: PoseConstants) -> FloatArray:
    """Refuse what is beyond reach; take what only rounding has put there for the edge itself."""
    reach = require_reach(position, k)
    u, X, Z = position[..., 0] - k.cx, position[..., 0] - k.xb, position[..., 2] - k.zb
    left = -np.minimum(reach.lacking, 0.0)
    rise = np.clip(reach.h, -k.l2, k.l2)
    return np.stack([left[..., 2], rise, (X * reach.A - Z * u) / k.l6, left[..., 0]])


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
        Distances [mm], shape (...), 0 on a surface; of one pose, a number.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short.
    """
    k = pose_constants(geometry, mode)
    if (pose := as_pose(position)) and margins_one(pose, k) and mode.w1 != mode.w2:
        distance, *_ = nearest_of_pose(pose[0], pose[2], k, plain_curve(geometry, mode.v), inf)
        return _as_numpy(distance)
    array = as_triples(position, "position")
    require_reach(array, k)
    if mode.w1 == mode.w2:
        return _as_numpy(np.zeros(array.shape[:-1]))
    return _as_numpy(nearest_surface(geometry, mode.v, array).distance)


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
    k = pose_constants(geometry, mode)
    if (pose := as_pose(position)) and margins_one(pose, k) and mode.w1 != mode.w2:
        curve = plain_curve(geometry, mode.v)
        _, away_x, away_z, _ = nearest_of_pose(pose[0], pose[2], k, curve, inf)
        return triple(away_x, 0.0, away_z)
    array = as_triples(position, "position")
    require_reach(array, k)
    if mode.w1 == mode.w2:
        raise SingularityError(
            f"in {mode} the legs are parallel at every pose; no direction leads away from that",
            family="legs_parallel",
        )
    return nearest_surface(geometry, mode.v, array).away
