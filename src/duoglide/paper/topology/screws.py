"""Mobility from screws at a random placement: a witness that knows nothing of POC rules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import InputError
from duoglide.paper.topology.mechanism import Joint, JointKind, Mechanism
from duoglide.paper.topology.subspace import Vector


@dataclass(frozen=True, slots=True)
class ScrewMobility:
    """Instantaneous mobility at one placement of the axes.

    Attributes:
        dof: Freedoms of the whole mechanism.
        platform: How many independent motions the platform has.
        rotations: How many of these are rotations.
    """

    dof: int
    platform: int
    rotations: int


def screw_mobility(mechanism: Mechanism, seed: int = 0) -> ScrewMobility:
    """Place every axis at random with its given direction, and count freedoms by rank.

    Each link has a twist (angular velocity, velocity of the origin); each joint lets the twists of
    its two links differ by its own screws only.

    Args:
        mechanism: The mechanism.
        seed: Of the random placement.

    Raises:
        InputError: The mechanism has no joints.
    """
    if not mechanism.joints:
        raise InputError(f"{mechanism.name} has no joints")
    random = np.random.default_rng(seed)
    moving = [link for link in mechanism.links if link != mechanism.base]
    screws = [_screws(joint, random) for joint in mechanism.joints]
    columns = 6 * len(moving) + sum(len(rows) for rows in screws)
    equations = np.zeros((6 * len(mechanism.joints), columns))
    at = 6 * len(moving)
    for i, (joint, rows) in enumerate(zip(mechanism.joints, screws, strict=True)):
        band = slice(6 * i, 6 * i + 6)
        for link, sign in zip(joint.links, (-1.0, 1.0), strict=True):
            if link in moving:
                start = 6 * moving.index(link)
                equations[band, start : start + 6] += sign * np.eye(6)
        equations[band, at : at + len(rows)] = -rows.T
        at += len(rows)
    return _count(equations, 6 * moving.index(mechanism.platform))


def _count(equations: FloatArray, platform: int) -> ScrewMobility:
    """Count freedoms in the null space of the joint equations."""
    _, values, rows = np.linalg.svd(equations)
    rank = int((values > 1e-9 * values[0]).sum())
    twists = rows[rank:, platform : platform + 6]
    return ScrewMobility(
        dof=len(rows) - rank,
        platform=int(np.linalg.matrix_rank(twists, tol=1e-9)),
        rotations=int(np.linalg.matrix_rank(twists[:, :3], tol=1e-9)),
    )


def _screws(joint: Joint, random: np.random.Generator) -> FloatArray:
    """Return the joint's screws, shape (freedoms, 6), its axes through one random point."""
    point = random.normal(size=3)
    axes = [_unit(axis) for axis in joint.axes]
    turn = [np.concatenate([axis, np.cross(point, axis)]) for axis in axes]
    slide = [np.concatenate([np.zeros(3), axis]) for axis in axes]
    match joint.kind:
        case JointKind.PRISMATIC:
            return np.array(slide)
        case JointKind.CYLINDRICAL:
            return np.array(turn + slide)
        case JointKind.SPHERICAL:
            return np.array([np.concatenate([e, np.cross(point, e)]) for e in np.eye(3)])
        case JointKind.PARALLELOGRAM:
            circular = np.cross(axes[0], random.normal(size=3))
            return np.concatenate([np.zeros(3), circular])[None, :]
        case _:
            return np.array(turn)


def _unit(axis: Vector) -> FloatArray:
    """Return an axis as floating point numbers of length one."""
    values = np.array([float(value) for value in axis])
    unit: FloatArray = values / np.linalg.norm(values)
    return unit
