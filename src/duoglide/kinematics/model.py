"""Inverse and forward kinematics, closed form, one pose or many."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import BoolArray, FloatArray, as_triples
from duoglide.errors import InputError
from duoglide.kinematics._forward import require_forward
from duoglide.kinematics.batch import (
    as_batch,
    as_pose,
    forward_many,
    inverse_many,
    margins_one,
    triple,
)
from duoglide.kinematics.constants import PoseConstants, carriage_constants, pose_constants
from duoglide.kinematics.derivatives import root_jets, shift
from duoglide.kinematics.kernels import forward_pose, in_numpy, inverse_pose, jacobian_pose
from duoglide.kinematics.modes import ASSEMBLY, WORKING, AssemblyMode, WorkingMode
from duoglide.kinematics.reach import reach_of, require_inside, require_reach
from duoglide.machine import Geometry

CLEARLY_INSIDE = 1e-6  # [mm], of every edge of reach: no need to look closer
_jacobian_columns = in_numpy(jacobian_pose)

LAST_AXIS = "(carriage 1, 2, 3)"


def inverse(geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING) -> FloatArray:
    """Find the carriage positions that hold the platform at ``position``.

    Closed form, Eqs. 13-15 of [Shen2021]_ with L3 corrected. Links only: the travel of the
    carriages is not looked at.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' in the base frame [mm], shape (..., 3).
        mode: Which of the inverse solutions.

    Returns:
        Carriage positions along the rails [mm], shape (..., 3).

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short; carries the index, the link and the shortfall [mm].
    """
    k = pose_constants(geometry, mode)
    if pose := as_pose(position):
        x, y, z = pose
        try:
            a1, a2, a3 = inverse_pose(x, y, z, k)
        except ValueError:  # a square root has failed: look closer
            return _inverse_at_edge(as_triples(position, "position"), k)
        total = a1 + a3
        if total - total == 0.0:  # finite
            return triple(a1, a2, a3)
    array = as_batch(position, "position")
    many, real = inverse_many(array, k)
    return many if real else _inverse_at_edge(as_triples(array, "position"), k)


def _inverse_at_edge(position: FloatArray, k: PoseConstants) -> FloatArray:
    """Refuse what is beyond reach; take what only rounding has put there for the edge itself."""
    reach = require_reach(position, k)
    y, half = position[..., 1], k.half_l3
    columns = y - half + k.w1 * reach.p, y + half + k.w2 * reach.p, y + k.w3 * reach.q
    return np.stack(columns, axis=-1)


def forward(geometry: Geometry, carriages: ArrayLike, mode: AssemblyMode = ASSEMBLY) -> FloatArray:
    """Find the platform position that the carriages give.

    Closed form, Eqs. 8-12 of [Shen2021]_, without their quotients, so that beta = pi (G3 = G2) is a
    pose like any other. sin(beta) comes out with either sign.

    Args:
        geometry: Dimensions of the robot.
        carriages: Carriage positions along the rails [mm], shape (..., 3).
        mode: Which of the forward solutions.

    Returns:
        Platform centre O' in the base frame [mm], shape (..., 3).

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short; carries the index, the link and the shortfall [mm].
        SingularityError: The answer is indeterminate: |B|, h or the case-2 value is below 1e-9 mm,
            or cannot be told from zero in double precision.
    """
    k = carriage_constants(geometry, mode)
    if given := as_pose(carriages):
        a1, a2, a3 = given
        try:
            x, y, z, sure = forward_pose(a1, a2, a3, k)
        except (ValueError, ZeroDivisionError):  # a square root or a quotient has failed
            sure = False
        if sure:
            return triple(x, y, z)
    array = as_batch(carriages, "carriages", LAST_AXIS)
    many, sure = forward_many(array, k)
    if not sure:
        require_forward(as_triples(array, "carriages", LAST_AXIS), k)
    return many


def reachable(geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING) -> BoolArray:
    """Tell which positions the links reach; never raises on a finite input.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        mode: Which of the inverse solutions.

    Returns:
        Boolean mask of shape (...); of one pose, a truth value. The edge of reach belongs to it.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
    """
    k = pose_constants(geometry, mode)
    if (pose := as_pose(position)) and margins_one(pose, k):
        return np.True_  # type: ignore[return-value]  # numpy's scalars pass for arrays
    within: BoolArray = reach_of(as_triples(position, "position"), k).within[()]
    return within


def jacobian(geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING) -> FloatArray:
    """Differentiate the carriage positions by the platform position, -B^-1 A of Eq. 16.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3).
        mode: Which of the inverse solutions.

    Returns:
        d carriages / d position [mm/mm], shape (..., 3, 3), last axis the position's.

    Raises:
        InputError: Not finite numbers of shape (..., 3).
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach, where a derivative is infinite.
    """
    k = pose_constants(geometry, mode)
    if (pose := as_pose(position)) and (measured := margins_one(pose, k)):
        strut, h, _, arm = measured
        if min(strut, k.l2 - abs(h), arm) > CLEARLY_INSIDE:
            px, pz, qx, qz = jacobian_pose(pose[0], pose[2], k)
            rows = [(w * px, 1.0, w * pz) for w in (k.w1, k.w2)]
            return np.array([*rows, (k.w3 * qx, 1.0, k.w3 * qz)])
    array = as_triples(position, "position")
    require_inside(array, require_reach(array, k))
    px, pz, qx, qz = _jacobian_columns(array[..., 0], array[..., 2], k)
    result = np.empty((*array.shape, 3))
    result[..., :, 1] = 1.0
    for column, p, q in ((0, px, qx), (2, pz, qz)):
        for row, w in enumerate((k.w1, k.w2)):
            result[..., row, column] = w * p
        result[..., 2, column] = k.w3 * q
    return result


def inverse_derivatives(
    geometry: Geometry, derivatives: ArrayLike, mode: WorkingMode = WORKING
) -> FloatArray:
    """Carry a position and its derivatives through the inverse kinematics, exactly.

    Args:
        geometry: Dimensions of the robot.
        derivatives: Platform position and its first k derivatives by any parameter [mm per unit of
            it to the power], shape (..., k + 1, 3).
        mode: Which of the inverse solutions.

    Returns:
        Carriage positions and their first k derivatives by the same parameter, the same shape.

    Raises:
        InputError: Not finite numbers of shape (..., k + 1, 3).
        UnreachableError: A link is too short.
        SingularityError: On the edge of reach, where a derivative is infinite.
    """
    array = as_triples(derivatives, "derivatives")
    if array.ndim < 2 or array.shape[-2] == 0:
        raise InputError(f"derivatives must have shape (..., k + 1, 3), got {array.shape}")
    k = pose_constants(geometry, mode)
    reach = require_reach(array[..., 0, :], k)
    order = array.shape[-2]
    if order > 1:
        require_inside(array[..., 0, :], reach)
    cx, base, _l6, _l2, half, xb, zb, _l9, _v, w1, w2, w3 = k
    x, y, z = ([array[..., i, axis] for i in range(order)] for axis in range(3))
    A = root_jets(reach.A, shift(x, cx))
    h = [zi - Ai for zi, Ai in zip(shift(z, base), A, strict=True)]
    p = root_jets(reach.p, h)
    q = root_jets(reach.q, shift(x, xb), shift(z, zb))
    result = np.empty(array.shape)
    for i in range(order):
        middle = half if i == 0 else 0.0
        result[..., i, 0] = y[i] - middle + w1 * p[i]
        result[..., i, 1] = y[i] + middle + w2 * p[i]
        result[..., i, 2] = y[i] + w3 * q[i]
    return result
