"""Bounds on the clearance about a pose, by the clearance of points further away."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.modes import WORKING
from duoglide.kinematics.reach import reach_of
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.machine import Machine

_FARTHEST = 0.25  # No anchor is farther away than this share of the leg's length.
_NEAREST = 1e-3  # [mm]

Pair: TypeAlias = tuple[FloatArray, FloatArray]


def bound_from_anchors(
    machine: Machine, pose: Pair, corners: FloatArray, spare: FloatArray
) -> FloatArray:
    """Bound the clearance between corners from points further away from the nearest surface.

    For any anchor C, clearance(p) >= clearance(C) - |p - C|. With C at the pose itself that is the
    bound of first order; with C further away from the surface it is one of second order, and asks
    nothing else of the surface. C is twice as far away as the corners ask for: at a distance l it
    is short of the truth by about w^2 / (2 l), w along the surface.

    Args:
        machine: Whose geometry it is.
        pose: Positions [mm], (n, 3), and the directions in x and z away from the surface, (n, 2).
        corners: Of convex sets about the positions, seen from these in x and z [mm], (n, c, 2).
        spare: What the bound of first order leaves [mm], above 0, (n,).

    Returns:
        Lower bounds on the clearance anywhere in the sets [mm], (n,); -inf where there is none.
    """
    (position, normal), g = pose, machine.geometry
    k = pose_constants(g, WORKING)
    square = (corners * corners).sum(axis=-1).max(axis=-1)
    length = (square / spare).clip(_NEAREST, _FARTHEST * g.leg_length)
    offset = length[:, None] * normal
    anchor = position.copy()
    anchor[:, ::2] += offset
    inside = reach_of(anchor, k).lacking.max(axis=1) < 0.0
    clear = np.full(len(position), -np.inf)
    clear[inside] = nearest_surface(g, WORKING.v, anchor[inside]).distance
    bound: FloatArray = clear - np.linalg.norm(corners - offset[:, None], axis=-1).max(axis=1)
    return bound
