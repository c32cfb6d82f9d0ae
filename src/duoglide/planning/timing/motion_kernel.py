"""The carriages of a motion along a curve, compiled: what the search for a timing asks for most.

The same as ``CarriagePath.derivatives`` and the chain rule; a test holds the two together.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.compiled import compiled, inlined, share
from duoglide.kinematics.derivatives import carriage_jets, root_jet
from duoglide.kinematics.dynamics.constants import MassConstants
from duoglide.kinematics.dynamics.dynamics import register_dynamics
from duoglide.kinematics.dynamics.kernels import (
    carriage_rates,
    distribute_pose,
    inertia_pose,
    levers_pose,
    weight_pose,
)
from duoglide.motion.curve.jets import evaluate_arc, evaluate_polynomial
from duoglide.motion.profile import quintic

# Called instead of inlined, they would take half as long again.
register_dynamics()
share(root_jet, carriage_jets, quintic, evaluate_arc, evaluate_polynomial, inline=True)


@inlined
def point(local: float, span: float, rate: float, c: FloatArray, out: FloatArray) -> None:
    """Write position and three derivatives by sigma of one piece of a curve, (4, 3)."""
    for axis in range(3):
        if rate > 0.0:
            out[0, axis], out[1, axis], out[2, axis], out[3, axis] = evaluate_arc(
                c[:, axis], local, span, rate
            )
        else:
            out[0, axis], out[1, axis], out[2, axis], out[3, axis] = evaluate_polynomial(
                c[:, axis], local, span
            )


@inlined
def carriages(r: FloatArray, constants: Any, q: FloatArray) -> bool:
    """Write the carriages and three derivatives, (4, 3); return whether the point is in reach."""
    first, second, third = carriage_jets(
        (r[0, 0], r[1, 0], r[2, 0], r[3, 0]),
        (r[0, 1], r[1, 1], r[2, 1], r[3, 1]),
        (r[0, 2], r[1, 2], r[2, 2], r[3, 2]),
        constants,
    )
    q[0, 0], q[1, 0], q[2, 0], q[3, 0] = first
    q[0, 1], q[1, 1], q[2, 1], q[3, 1] = second
    q[0, 2], q[1, 2], q[2, 2], q[3, 2] = third
    total = q[3, 0] + q[3, 2]
    return bool(total - total == 0.0)  # finite


@compiled
def carriage_motion(
    curve: Any, constants: Any, motion: FloatArray, piece: Any, out: FloatArray
) -> int:
    """Differentiate the carriages by time.

    Args:
        curve: Breaks, spans, rates and coefficients, as in ``Curve``.
        constants: As ``pose_constants`` gives them.
        motion: Sigma and its three time derivatives, (n, 4).
        piece: Piece of the curve that each belongs to, (n,).
        out: Velocity, acceleration and jerk of the carriages, (n, 3, 3), carriages last.

    Returns:
        The first row that is out of reach, -1 where none is.
    """
    breaks, spans, rates, coefficients = curve
    r = np.empty((4, 3))
    q = np.empty((4, 3))
    for i in range(piece.size):
        k = piece[i]
        point(motion[i, 0] - breaks[k], spans[k], rates[k], coefficients[k], r)
        if not carriages(r, constants, q):
            return i
        v = motion[i, 1]
        a = motion[i, 2]
        for j in range(3):
            out[i, 0, j] = q[1, j] * v
            out[i, 1, j] = q[1, j] * a + q[2, j] * v * v
            out[i, 2, j] = q[1, j] * motion[i, 3] + (3.0 * q[2, j] * a + q[3, j] * v * v) * v
    return -1


@compiled
def force_motion(curve: Any, machine: Any, motion: FloatArray, piece: Any, out: FloatArray) -> None:
    """Find the parts of the carriages' forces, friction aside, at points within reach.

    Args:
        curve: Breaks, spans, rates and coefficients, as in ``Curve``.
        machine: Constants as ``pose_constants`` gives them; ``MassConstants`` as a plain tuple,
            without the payload; and the payload of each row, (n,).
        motion: Sigma and its three time derivatives, (n, 4).
        piece: Piece of the curve that each belongs to, (n,).
        out: Force for each unit by which the time of the motion is made to accelerate, that of the
            motion itself, what holds it at rest [N], and the velocity [mm/s], (n, 4, 3).
    """
    breaks, spans, rates, coefficients = curve
    constants, plain, payload = machine
    none = (0.0, 0.0, 0.0)
    r = np.empty((4, 3))
    for i in range(piece.size):
        k = piece[i]
        point(motion[i, 0] - breaks[k], spans[k], rates[k], coefficients[k], r)
        m = MassConstants(*(*plain, payload[i]))
        v = motion[i, 1]
        a = motion[i, 2]
        first = (r[1, 0] * v, r[1, 1] * v, r[1, 2] * v)
        second = (
            r[1, 0] * a + r[2, 0] * v * v,
            r[1, 1] * a + r[2, 1] * v * v,
            r[1, 2] * a + r[2, 2] * v * v,
        )
        at = levers_pose(r[0, 0], r[0, 2], constants)
        moved = distribute_pose(at, inertia_pose(at, none, first, constants, m), constants)
        bent = distribute_pose(at, inertia_pose(at, first, second, constants, m), constants)
        held = distribute_pose(at, weight_pose(at, m), constants)
        speed = carriage_rates(at, first, constants)
        out[i, 0, 0], out[i, 0, 1], out[i, 0, 2] = moved
        out[i, 1, 0], out[i, 1, 1], out[i, 1, 2] = bent
        out[i, 2, 0], out[i, 2, 1], out[i, 2, 2] = held
        out[i, 3, 0], out[i, 3, 1], out[i, 3, 2] = speed


@compiled
def cell_states(
    knots: FloatArray, polynomials: FloatArray, breaks: FloatArray, motion: FloatArray, pieces: Any
) -> None:
    """Evaluate a profile at evenly spaced times of each of its cells, both ends included.

    Args:
        knots: As in ``Profile``, (n + 1, 4); no cell crosses a break of the curve.
        polynomials: Of each cell, in rising powers of the time since its knot, (n, 6).
        breaks: Of the curve, from which on the cells lie [mm].
        motion: Where to write sigma and its three time derivatives, (n, points, 4).
        pieces: Where to write how many breaks each cell is beyond the first, (n, points).
    """
    count, points = pieces.shape
    piece = 0
    for i in range(count):
        row = polynomials[i]
        c = (row[0], row[1], row[2], row[3], row[4], row[5])
        span = knots[i + 1, 0] - knots[i, 0]
        middle = quintic(c, 0.5 * span)[0]
        while piece < breaks.size - 2 and breaks[piece + 1] <= middle:
            piece += 1
        for j in range(points):
            u = span * (j / (points - 1.0))
            s, v, a, third = quintic(c, u)
            motion[i, j, 0] = s
            motion[i, j, 1] = v
            motion[i, j, 2] = a
            motion[i, j, 3] = third
            pieces[i, j] = piece
