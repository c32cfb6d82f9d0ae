"""Where the joints are at a pose: for pictures, pages and models, never for solving."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_triples
from duoglide.kinematics.constants import pose_constants
from duoglide.kinematics.model import inverse
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.reach import reach_of
from duoglide.machine import Geometry

LINKS = {  # name of the link: the joints at its ends, by the paper's letters (Fig. 2)
    "post 1": ("A1", "B1"),
    "post 2": ("A2", "B2"),
    "post 3": ("A3", "B3"),
    "leg 1": ("B1", "C1"),
    "leg 2": ("B2", "C2"),
    "coupler": ("C1", "C2"),
    "riser": ("D1", "D2"),
    "arm": ("D2", "E2"),
    "arm drop": ("E2", "S"),
    "platform": ("S", "T"),
    "strut drop": ("T", "C3"),
    "strut": ("B3", "C3"),
}


def joints(
    geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING
) -> dict[str, FloatArray]:
    """Find every joint centre of the mechanism at a pose.

    Section 2.3.1 and Eqs. 8-10 of [Shen2021]_, with the joints named by the paper's letters.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' in the base frame [mm], shape (..., 3).
        mode: Which of the inverse solutions.

    Returns:
        Letter to joint centre in the base frame [mm], each of shape (..., 3): A1 to A3, B1 to B3,
        C1 to C3, D1, D2, E2, S, T and O (for O').

    Raises:
        InputError: Not finite, or not three values.
        UnreachableError: A link is too short.
    """
    pose = as_triples(position, "position")
    carriages = inverse(geometry, pose, mode)
    g = geometry
    x, y, z = pose[..., 0], pose[..., 1], pose[..., 2]
    b, d = g.rail_half_spacing, g.platform_half_width
    z_arm = z - g.arm_drop - reach_of(pose, pose_constants(g, mode)).A
    z_leg = z_arm - g.riser_height
    half = g.coupler_length / 2.0

    def point(px: ArrayLike, py: ArrayLike, pz: ArrayLike) -> FloatArray:
        return np.stack(np.broadcast_arrays(px, py, pz), axis=-1).astype(np.float64)

    found = {"O": pose}
    for number, rail in ((1, b), (2, b), (3, -b)):
        along = carriages[..., number - 1]
        found[f"A{number}"] = point(rail, along, 0.0)
        found[f"B{number}"] = point(rail, along, g.carriage_height)
    found["C1"], found["C2"] = point(b, y - half, z_leg), point(b, y + half, z_leg)
    found["C3"] = point(x - d, y, z - g.strut_drop)
    found["D1"], found["D2"] = point(b, y, z_leg), point(b, y, z_arm)
    found["E2"] = point(x + d, y, z - g.arm_drop)
    found["S"], found["T"] = point(x + d, y, z), point(x - d, y, z)
    return found
