"""Where every body of the mechanism is along a motion: joint values, and poses of the bodies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from duoglide.arrays import FloatArray, as_triples
from duoglide.errors import InputError
from duoglide.kinematics.export.tree import Motion, Tree
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.skeleton import joints
from duoglide.machine import Geometry

_X, _Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def joint_values(
    tree: Tree, geometry: Geometry, position: ArrayLike, mode: WorkingMode = WORKING
) -> dict[str, FloatArray]:
    """Find what every joint of the tree reads where the platform is at ``position``.

    A parallelogram's upper side turns back by what its long bars turn, so that it stays level.

    Args:
        tree: The mechanism, as ``build_tree`` makes it of the same geometry and mode.
        geometry: Dimensions of the robot.
        position: Platform centres O' [mm], shape (n, 3).
        mode: Which of the inverse solutions.

    Returns:
        Name of the body to what its joint reads, shape (n,): carriages [mm], hinges [rad], which
        are zero at the tree's reference pose.

    Raises:
        InputError: Not finite, or not of shape (n, 3).
        UnreachableError: A link is too short at one of the positions.
    """
    pose = as_triples(position, "position")
    if pose.ndim != 2:
        raise InputError(f"position must have shape (n, 3), got {pose.shape}")
    at = joints(geometry, pose, mode)
    reference = {
        body.name: np.subtract(body.bars[0].end, body.bars[0].start) for body in tree.bodies
    }
    across = next(np.array(body.axis) for body in tree.bodies if body.name == "strut_near")
    leg_1 = _angle(_X, reference["leg_1"], at["C1"] - at["B1"])
    leg_2 = _angle(_X, reference["leg_2"], at["C2"] - at["B2"])
    arm = _angle(_Y, reference["arm_near"], at["E2"] - at["D2"])
    strut = at["C3"] - at["B3"]
    lower = _angle(_Y, reference["strut_near"], strut)
    upright = Rotation.from_rotvec(-lower[:, None] * _Y).apply(strut)
    tilt = _angle(across, reference["strut_near"], upright)
    return {
        **{f"carriage_{n}": at[f"A{n}"][:, 1] for n in (1, 2, 3)},
        "leg_1": leg_1,
        "leg_2": leg_2,
        "coupler": -leg_1,
        "arm_near": arm,
        "arm_far": arm,
        "platform": -arm,
        "lower_bar": lower,
        "strut_near": tilt,
        "strut_far": tilt,
        "upper_bar": -tilt,
    }


def body_poses(
    tree: Tree, values: Mapping[str, FloatArray]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Find where the bodies are for what their joints read.

    Args:
        tree: The mechanism.
        values: Of every body, as ``joint_values`` returns them, shape (n,) each.

    Returns:
        Name of the body to the origin of its frame in the base frame [mm], shape (n, 3), and how it
        is turned from the reference pose, as a unit quaternion (x, y, z, w), shape (n, 4).
    """
    some = next(iter(values.values()))
    origins: dict[str, FloatArray] = {"base": np.zeros((len(some), 3))}
    turns: dict[str, Rotation] = {"base": Rotation.identity(len(some))}
    offsets = {"base": np.zeros(3)}
    poses: dict[str, tuple[FloatArray, FloatArray]] = {}
    for body in tree.bodies:
        axis, value = np.array(body.axis), values[body.name]
        offset = np.array(body.origin) - offsets[body.parent]
        turn = turns[body.parent]
        if body.motion is Motion.SLIDE:
            moved = offset + (value - body.value)[:, None] * axis
        else:
            moved = np.tile(offset, (len(some), 1))
            turn = turn * Rotation.from_rotvec(value[:, None] * axis)
        origin = origins[body.parent] + turns[body.parent].apply(moved)
        offsets[body.name] = np.array(body.origin)
        origins[body.name], turns[body.name] = origin, turn
        poses[body.name] = origin, turn.as_quat()
    return poses


def _angle(axis: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return by how much ``start`` (3,) turns about a unit axis into each of ``end`` (n, 3)."""
    flat = start - (start @ axis) * axis
    angle: FloatArray = np.arctan2(np.cross(flat, end) @ axis, end @ flat)
    return angle
