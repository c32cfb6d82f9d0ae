"""Many poses at once: numpy for some, compiled loops for very many, with the same result.

Loading numba takes most of a second, in which numpy answers tens of millions of poses. So numpy
answers until that has added up to something: whoever has one large batch never waits for numba.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_triples
from duoglide.kinematics import kernels
from duoglide.kinematics.compiled import compiled, share
from duoglide.kinematics.constants import CarriageConstants, PoseConstants

WORTH_LOADING = 1_000_000  # poses that numpy answers before numba is loaded for the next
WORTH_CALLING = 500  # poses, from which calling compiled loops pays once they are loaded
BLOCK = 4096  # poses at a time in numpy: what is between the steps stays in the cache
DOUBLE = np.dtype(np.float64)
ARRAY, FLOAT, EMPTY, ONE_POSE = np.ndarray, float, np.empty, (3,)

_inverse_columns = kernels.in_numpy(kernels.inverse_pose)
_forward_columns = kernels.in_numpy(kernels.forward_pose)
_margins_columns = kernels.in_numpy(kernels.margins_pose)
_legs_columns = kernels.in_numpy(kernels.legs_pose)


class _Answered:
    """How many poses numpy has answered in this process."""

    poses = 0


def inverse_many(position: FloatArray, k: PoseConstants) -> tuple[FloatArray, bool]:
    """Return the carriages of positions of shape (..., 3), and whether all of them are real."""
    if compiles(position):
        return _run(kernels.inverse_loop, position, k)
    carriages = np.empty(position.shape)
    with np.errstate(invalid="ignore", over="ignore"):
        for given, out in _blocks(position, carriages):
            out[0], out[1], out[2] = _inverse_columns(*given, k)
    return carriages, bool(np.isfinite(carriages).all())


def forward_many(carriages: FloatArray, k: CarriageConstants) -> tuple[FloatArray, bool]:
    """Return the positions for carriages of shape (..., 3), and whether all of them are sure."""
    if compiles(carriages):
        return _run(kernels.forward_loop, carriages, k)
    position, all_sure = np.empty(carriages.shape), True
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        for given, out in _blocks(carriages, position):
            out[0], out[1], out[2], sure = _forward_columns(*given, k)
            all_sure = all_sure and bool(sure.all())
    return position, all_sure


def margins_many(position: FloatArray, k: PoseConstants) -> tuple[FloatArray, bool]:
    """Return what ``margins_pose`` does, shape (4, ...), and whether all poses are within reach."""
    measured = np.empty((4, *position.shape[:-1]))
    if compiles(position):
        failed = _compiled(kernels.margins_loop)(_flat(position), measured.reshape(-1), k)
        return measured, failed == 0
    rows = measured.reshape(4, -1).T
    with np.errstate(invalid="ignore", over="ignore"):
        for (x, _, z), out in _blocks(position, rows):
            out[0], out[1], out[2], out[3] = _margins_columns(x, z, k)
    return measured, bool((measured[0] >= 0.0).all() and (np.abs(measured[1]) <= k.l2).all())


def legs_many(rise: FloatArray, k: PoseConstants) -> tuple[FloatArray, FloatArray]:
    """Return what ``legs_pose`` does, each of the shape of ``rise``."""
    if not _pays(rise.size):
        left, spread = _legs_columns(rise, k)
        return left, spread
    out = np.empty((2, *rise.shape))
    _compiled(kernels.legs_loop)(rise.reshape(-1), out.reshape(-1), k)
    return out[0], out[1]


def _blocks(given: FloatArray, out: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield the columns of both arrays, a block of rows at a time."""
    rows, into = given.reshape(-1, given.shape[-1]), out.reshape(-1, out.shape[-1])
    _Answered.poses += len(rows)
    for start in range(0, len(rows), BLOCK):
        block = slice(start, start + BLOCK)
        yield rows[block].T, into[block].T


def as_pose(value: Any) -> Sequence[float]:
    """Return the three floats of what is plainly one pose, nothing for anything else."""
    kind = type(value)
    if kind is tuple or kind is list:
        if len(value) == 3:
            x, y, z = value
            if type(x) is type(y) is type(z) is FLOAT:
                return value  # type: ignore[no-any-return]  # seen
    elif kind is ARRAY and value.shape == ONE_POSE and value.dtype is DOUBLE:
        pose: Sequence[float] = value.tolist()
        return pose
    return ()


def margins_one(pose: Sequence[float], k: PoseConstants) -> tuple[float, ...]:
    """Return what ``margins_pose`` does if the pose is plainly within reach, else nothing."""
    x, y, z = pose
    try:
        measured = kernels.margins_pose(x, z, k)
    except ValueError:  # a square root has failed
        return ()
    strut, h, _, _ = measured
    if strut >= 0.0 and abs(h) <= k.l2 and y - y == 0.0:
        return measured
    return ()


def triple(first: float, second: float, third: float) -> FloatArray:
    """Return an array of three numbers, in less time than from a tuple."""
    array = EMPTY(3)
    array[0] = first
    array[1] = second
    array[2] = third
    return array


def as_batch(value: ArrayLike, name: str, last_axis: str = "(x, y, z)") -> FloatArray:
    """Convert ``value`` to shape (..., 3); the compiled loops look for NaN and infinity themselves.

    Raises:
        InputError: Not real numbers, not three in the last axis; not finite, if the batch is small.
    """
    if isinstance(value, np.ndarray) and value.dtype == DOUBLE and value.shape[-1:] == (3,):
        array: FloatArray = value
        if compiles(array):
            return array
    return as_triples(value, name, last_axis)


def compiles(array: FloatArray) -> bool:
    """Whether a batch is large enough for the compiled loops; they check that it is finite."""
    return _pays(array.size // 3)


def _pays(poses: int) -> bool:
    """Whether compiled loops pay for so many poses, loading them included."""
    loaded = _compiled.cache_info().currsize > 0
    return poses >= WORTH_CALLING and (loaded or _Answered.poses >= WORTH_LOADING)


def _run(
    loop: Callable[..., int], array: FloatArray, k: PoseConstants | CarriageConstants
) -> tuple[FloatArray, bool]:
    out = np.empty(array.shape)
    failed = _compiled(loop)(_flat(array), out.reshape(-1), k)
    return out, failed == 0


def _flat(array: FloatArray) -> FloatArray:
    return np.ascontiguousarray(array).reshape(-1)


@cache
def _compiled(loop: Callable[..., int]) -> Any:
    """Compile a loop, or load it from numba's cache."""
    register_kernels()
    return compiled(loop, nogil=True)


@cache
def register_kernels() -> None:
    """Let compiled code call the kernels, which stay plain functions for everyone else."""
    share(kernels.inverse_pose, kernels.forward_pose, kernels.margins_pose, kernels.legs_pose)
