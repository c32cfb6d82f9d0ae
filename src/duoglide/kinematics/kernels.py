"""The closed forms, once: for one pose in floats, and for columns of poses in arrays.

Every ``_pose`` is plain arithmetic and ``sqrt``, and serves one pose as it stands. ``in_numpy``
gives the same code functions that take arrays. ``batch`` has numba compile the ``_loop``s.
They run along flat arrays, so that the stride is a constant and the compiler can use vector
registers. All three agree to the last bit.

Legend: with u = x - (b - d) = -l6 cos(beta), A = l6 sin(beta), X and Z from B3 to C3 in the xz
plane, h the rise of the legs, p and q the strokes of legs and strut along y (PAPER, short form).
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin, sqrt
from types import FunctionType
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import FAINT, CarriageConstants, PoseConstants

SINGULAR = 1e-9  # [mm], below which a pose counts as lying on a singular surface


def inverse_pose(x: float, y: float, z: float, k: PoseConstants) -> tuple[float, float, float]:
    """Carriages of one pose, Eqs. 13-15 with L3 corrected."""
    l6, l2, l9, half = k.l6, k.l2, k.l9, k.half_l3
    u = x - k.cx
    X = x - k.xb
    Z = z - k.zb
    h = z - k.base - k.v * sqrt((l6 - u) * (l6 + u))
    p = sqrt((l2 - h) * (l2 + h))
    q = sqrt(l9 * l9 - (X * X + Z * Z))
    return y - half + k.w1 * p, y + half + k.w2 * p, y + k.w3 * q


def jacobian_pose(x: float, z: float, k: PoseConstants) -> tuple[float, float, float, float]:
    """Slopes of one pose: of p by x and by z, and of q by x and by z."""
    l6, l2, l9 = k.l6, k.l2, k.l9
    u = x - k.cx
    X = x - k.xb
    Z = z - k.zb
    A = k.v * sqrt((l6 - u) * (l6 + u))
    h = z - k.base - A
    slope = -h / sqrt((l2 - h) * (l2 + h))
    q = sqrt(l9 * l9 - (X * X + Z * Z))
    return slope * (u / A), slope, -X / q, -Z / q


def margins_pose(x: float, z: float, k: PoseConstants) -> tuple[float, float, float, float]:
    """Margins of one pose: strut, legs flat (h), arm in line with strut, arm flat."""
    l6 = k.l6
    u = x - k.cx
    X = x - k.xb
    Z = z - k.zb
    A = k.v * sqrt((l6 - u) * (l6 + u))
    h = z - k.base - A
    return k.l9 - sqrt(X * X + Z * Z), h, (X * A - Z * u) / l6, l6 - abs(u)


def legs_pose(h: float, k: PoseConstants) -> tuple[float, float]:
    """Margins that the rise of the legs alone decides: legs vertical and legs parallel (|B|)."""
    l2 = k.l2
    return l2 - abs(h), abs(k.w2 - k.w1) * sqrt((l2 - h) * (l2 + h))


def forward_pose(
    a1: float, a2: float, a3: float, k: CarriageConstants
) -> tuple[float, float, float, bool]:
    """Platform position for one triple of carriages, Eqs. 8-11 without their quotients.

    C3 lies on a circle of radius l6 about (F1, F3) and on one about B3; n names the intersection.

    Returns:
        x, y, z; and whether they are certainly far from every singularity.
    """
    l2, l9, F1 = k.l2, k.l9, k.F1
    B = a2 - a1 - k.l3
    half_B = 0.5 * B
    rise = (l2 - half_B) * (l2 + half_B)
    y = 0.5 * (a1 + a2)
    F2 = y - a3
    F3 = k.lift + k.m * sqrt(rise)
    E = k.F1F1 + F3 * F3
    R = (l9 - F2) * (l9 + F2)
    K = 0.5 * (R + E - k.l6l6)
    cross = R * E - K * K
    turn = k.n * sqrt(cross)
    share = 1.0 / E
    X = (F1 * K - F3 * turn) * share
    Z = (F3 * K + F1 * turn) * share
    sure = (B * B > FAINT) & (rise > k.faint_rise) & (cross > k.faint_cross)
    return X + k.xb, y, Z + k.zb, sure


def case2_point(delta: float, F1: float, l6: float, v: float) -> tuple[float, ...]:
    """Point of the curve of case 2 seen from B3, X and Z, and its first and second derivatives."""
    s, c = sin(delta), cos(delta)
    pole = F1 / s
    return (
        F1 - l6 * s,
        v * c * (l6 - pole),
        -l6 * c,
        v * (pole / s - l6 * s),
        l6 * s,
        -v * c * (l6 + 2.0 * pole / (s * s)),
    )


def inverse_loop(flat: FloatArray, out: FloatArray, k: PoseConstants) -> int:
    """Run ``inverse_pose`` along x, y, z, x, y, z, ...; return how many poses it cannot answer."""
    failed = 0
    for i in range(flat.size // 3):
        a1, a2, a3 = inverse_pose(flat[3 * i], flat[3 * i + 1], flat[3 * i + 2], k)
        out[3 * i] = a1
        out[3 * i + 1] = a2
        out[3 * i + 2] = a3
        total = a1 + a3
        failed += total - total != 0.0  # infinite or NaN
    return failed


def forward_loop(flat: FloatArray, out: FloatArray, k: CarriageConstants) -> int:
    """Run ``forward_pose`` along carriages 1, 2, 3, 1, ...; return how many are not sure."""
    failed = 0
    for i in range(flat.size // 3):
        x, y, z, sure = forward_pose(flat[3 * i], flat[3 * i + 1], flat[3 * i + 2], k)
        out[3 * i] = x
        out[3 * i + 1] = y
        out[3 * i + 2] = z
        failed += not sure
    return failed


def margins_loop(flat: FloatArray, out: FloatArray, k: PoseConstants) -> int:
    """Run ``margins_pose`` along x, y, z, x, ...; return how many poses are not within reach."""
    failed = 0
    n = flat.size // 3
    leg = k.l2
    for i in range(n):
        y = flat[3 * i + 1]
        strut, h, in_line, arm = margins_pose(flat[3 * i], flat[3 * i + 2], k)
        out[i] = strut
        out[n + i] = h
        out[2 * n + i] = in_line
        out[3 * n + i] = arm
        failed += not ((strut >= 0.0) & (abs(h) <= leg) & (y - y == 0.0))
    return failed


def legs_loop(rise: FloatArray, out: FloatArray, k: PoseConstants) -> int:
    """Run ``legs_pose`` along the rises of the legs; one half of ``out`` after the other."""
    n = rise.size
    for i in range(n):
        left, spread = legs_pose(rise[i], k)
        out[i] = left
        out[n + i] = spread
    return 0


def in_numpy(kernel: Callable[..., Any], **called: Callable[..., Any]) -> Callable[..., Any]:
    """Return the same code with functions that take arrays.

    Args:
        kernel: Plain arithmetic with the functions below.
        called: Other kernels that it calls, by their name, as this function returned them.
    """
    assert isinstance(kernel, FunctionType)
    elementwise: dict[str, Callable[..., Any]] = {"sqrt": np.sqrt, "sin": np.sin, "cos": np.cos}
    elementwise |= {"max": np.maximum, "min": np.minimum}
    return FunctionType(kernel.__code__, {**kernel.__globals__, **elementwise, **called})
