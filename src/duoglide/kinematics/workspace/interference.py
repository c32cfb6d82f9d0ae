"""Distance between links that share no joint."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.skeleton import LINKS, joints
from duoglide.machine import Geometry

POINTLIKE = 1e-9  # [mm], a link shorter than this is a point of its neighbours


def interference_gap(
    geometry: Geometry, position: FloatArray, mode: WorkingMode = WORKING
) -> FloatArray:
    """Measure the least distance between the centre lines of links that share no joint.

    Args:
        geometry: Dimensions of the robot.
        position: Platform centre O' [mm], shape (..., 3), within reach.
        mode: Which of the inverse solutions.

    Returns:
        Distance [mm], shape (...).

    Raises:
        UnreachableError: A link is too short.
    """
    at = joints(geometry, position, mode)
    gap = np.full(position.shape[:-1], np.inf)
    for first, second in _list_pairs(geometry):
        gap = np.minimum(gap, _measure_distance(*(at[n] for n in (*LINKS[first], *LINKS[second]))))
    return gap


def _list_pairs(g: Geometry) -> list[tuple[str, str]]:
    """Return pairs of links with a length that do not meet in a joint."""
    zero = {"riser": g.riser_height, "arm drop": g.arm_drop, "strut drop": g.strut_drop}
    shape = [name for name in LINKS if abs(zero.get(name, 1.0)) > POINTLIKE]
    merged = {"D1": "coupler"}  # D1 lies on the coupler, between C1 and C2
    for name in set(LINKS) - set(shape):
        start, end = LINKS[name]
        merged[end] = merged.get(start, start)

    def ends(name: str) -> set[str]:
        found = {merged.get(letter, letter) for letter in LINKS[name]}
        return found | {"coupler"} if name == "coupler" else found

    posts = {"post 1", "post 2"}
    return [
        (first, second)
        for first, second in combinations(shape, 2)
        if not ends(first) & ends(second) and {first, second} != posts
    ]


def _measure_distance(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return the distance between segments ab and cd, each of shape (..., 3).

    The unconstrained optimum is clamped to one segment, then the other, then the first again, which
    is exact for segments.
    """
    run, other, offset = b - a, d - c, a - c
    rr, oo, ro = _dot(run, run), _dot(other, other), _dot(run, other)
    rw, ow = _dot(run, offset), _dot(other, offset)
    slack = rr * oo - ro * ro
    parallel = slack <= 1e-12 * rr * oo
    s = np.clip(np.where(parallel, 0.0, ro * ow - oo * rw) / np.where(parallel, 1.0, slack), 0, 1)
    t = np.clip((ro * s + ow) / oo, 0.0, 1.0)
    s = np.clip((ro * t - rw) / rr, 0.0, 1.0)
    apart = offset + s[..., None] * run - t[..., None] * other
    distance: FloatArray = np.sqrt(_dot(apart, apart))
    return distance


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = np.einsum("...i,...i", a, b)
    return product
