"""The curve of case 2, X sin(beta) + Z cos(beta) = 0, in the xz plane: points and distance.

With delta = pi/2 - v beta, so that cos(beta) = sin(delta) and sin(beta) = v cos(delta), and with
F1 = 2 (b - d), the curve is X = F1 - l6 sin(delta), Z = v (l6 cos(delta) - F1 cot(delta)). Along it
h = -F1 tan(beta) - (l4 + l7 - l8) and the strut's projection is |F1 / cos(beta) - l6|, both
monotonous on each side of the pole delta = 0: what lies within reach is at most one piece per side.
For F1 = 0 (b = d) the pole becomes a line X = 0 of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import atan2, inf, sqrt

import numpy as np

from duoglide.arrays import FloatArray, IndexArray, read_only
from duoglide.kinematics.constants import Plane
from duoglide.kinematics.kernels import case2_point, in_numpy
from duoglide.kinematics.singularity.nearest_pose import (
    COARSE,
    STEPS,
    CurveNumbers,
    Extent,
    PieceNumbers,
)
from duoglide.machine import Geometry

STEPS_PER_LENGTH = 150.0  # cells of the sampled curve for one strut length
TURN = 0.1  # [rad], by which the tangent turns at most in one cell
_point_columns = in_numpy(case2_point)

NEAR_POLE = 1e-9  # [rad], where the line X = 0 takes over


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A stretch of the curve within reach, sampled.

    Attributes:
        delta: Parameter at the samples, rising, shape (n,).
        X: Coordinate along x of the samples [mm].
        Z: Coordinate along z of the samples [mm].
        spacing: Greatest length of the curve between neighbours [mm], with a reserve.
        box: Least and greatest X and Z [mm] that the piece comes to, with a reserve.
    """

    delta: FloatArray
    X: FloatArray
    Z: FloatArray
    spacing: float
    box: Extent

    def squares(self, X: FloatArray, Z: FloatArray, step: int) -> FloatArray:
        """Return the squared distances of poses to every ``step``-th sample, shape (n, samples)."""
        dx = X[:, None] - self.X[None, ::step]
        dz = Z[:, None] - self.Z[None, ::step]
        squares: FloatArray = dx * dx + dz * dz
        return squares

    def box_squares(self, X: FloatArray, Z: FloatArray) -> FloatArray:
        """Return less than the squared distances of poses to the piece, shape (n,)."""
        box = self.box
        dx, dz = X - np.clip(X, box.x_low, box.x_high), Z - np.clip(Z, box.z_low, box.z_high)
        squares: FloatArray = dx * dx + dz * dz
        return squares


@dataclass(frozen=True, slots=True, eq=False)
class Case2Curve:
    """The curve for one geometry and one sign of sin(beta).

    Attributes:
        F1: 2 (b - d) [mm].
        l6: Arm length [mm].
        v: Sign of sin(beta).
        pieces: What of it lies within reach.
        line: Z at the two ends of the line X = 0 where F1 = 0; empty otherwise.
    """

    F1: float
    l6: float
    v: int
    pieces: tuple[Piece, ...]
    line: tuple[float, ...]

    def nearest(
        self, X: FloatArray, Z: FloatArray, best: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Find the nearest point of the curve where it is nearer than ``best``.

        Args:
            X: Poses seen from B3 [mm], shape (n,).
            Z: The same.
            best: Distance to the other surfaces [mm], shape (n,).

        Returns:
            Distance, infinite where it is not below ``best``; the direction away, 0 there.
        """
        distance, away_x, away_z = np.full_like(X, inf), np.zeros_like(X), np.zeros_like(X)
        if self.line:
            low, high = self.line
            np.copyto(distance, np.abs(X), where=(low <= Z) & (high >= Z))
            np.copyto(away_x, np.copysign(1.0, X))
        for piece in self.pieces:
            limit = np.minimum(best, distance)
            row, cell = _candidates(piece, X, Z, limit)
            if row.size == 0:
                continue
            found = np.stack(self._refine(piece, cell, X[row], Z[row]))
            order = np.argsort(-found[0], kind="stable")  # the nearest of a row is written last
            order = order[found[0, order] < limit[row[order]]]
            distance[row[order]], away_x[row[order]], away_z[row[order]] = found[:, order]
        return distance, away_x, away_z

    def _refine(
        self, piece: Piece, cell: IndexArray, X: FloatArray, Z: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Minimise the distance about samples ``cell``: Newton within a closing bracket."""
        last = piece.delta.size - 1
        low = piece.delta[np.maximum(cell - 1, 0)]
        high = piece.delta[np.minimum(cell + 1, last)]
        delta = piece.delta[cell]
        active = np.arange(delta.size)
        for _ in range(STEPS):
            here = delta[active]
            cx, cz, tx, tz, bx, bz = self.point(here)
            dx, dz = cx - X[active], cz - Z[active]
            slope = dx * tx + dz * tz
            bend = tx * tx + tz * tz + dx * bx + dz * bz
            high[active] = np.where(slope > 0.0, here, high[active])
            low[active] = np.where(slope > 0.0, low[active], here)
            newton = here - slope / np.where(bend > 0.0, bend, inf)
            inside = (newton > low[active]) & (newton < high[active])
            following = np.where(inside, newton, 0.5 * (low[active] + high[active]))
            delta[active] = following
            active = active[np.abs(following - here) * np.hypot(tx, tz) > 1e-9 * self.l6]
            if active.size == 0:
                break
        cx, cz, tx, tz, *_ = self.point(delta)
        length = np.hypot(tx, tz)
        nx, nz = -tz / length, tx / length
        side = np.where((X - cx) * nx + (Z - cz) * nz < 0.0, -1.0, 1.0)
        return np.hypot(X - cx, Z - cz), side * nx, side * nz

    def point(self, delta: FloatArray) -> tuple[FloatArray, ...]:
        """Return X, Z and their first and second derivatives by delta."""
        columns: tuple[FloatArray, ...] = _point_columns(delta, self.F1, self.l6, self.v)
        return columns


def _candidates(
    piece: Piece, X: FloatArray, Z: FloatArray, best: FloatArray
) -> tuple[IndexArray, IndexArray]:
    """List the poses and samples about which the curve may come nearer than ``best``."""
    rows = np.flatnonzero(piece.box_squares(X, Z) <= best**2)
    table = np.empty((0, 0))
    for step in (COARSE, 1):
        if rows.size == 0:
            return rows, rows
        table = piece.squares(X[rows], Z[rows], step)
        near = table.min(axis=1) <= (best[rows] + step * piece.spacing) ** 2
        rows, table = rows[near], table[near]
    padded = np.pad(table, ((0, 0), (1, 1)), constant_values=inf)
    least = (table <= padded[:, :-2]) & (table <= padded[:, 2:])
    least &= table <= (best[rows, None] + piece.spacing) ** 2
    row, cell = np.nonzero(least)
    return rows[row], cell


@lru_cache(maxsize=32)
def curve_of(g: Geometry, v: int) -> Case2Curve:
    """Return the curve of a geometry, sampled once."""
    plane = Plane.of(g)
    line: tuple[float, ...] = ()
    if plane.F1 == 0.0:
        middle = plane.lift + v * g.arm_length
        low = max(middle - g.leg_length, -g.strut_length)
        high = min(middle + g.leg_length, g.strut_length)
        line = (low, high) if low <= high else ()
    curve = Case2Curve(F1=plane.F1, l6=g.arm_length, v=v, pieces=(), line=line)
    ends = (_ends(g, v, side) for side in (1, -1))
    step = g.strut_length / STEPS_PER_LENGTH
    pieces = tuple(_sample(curve, (min(pair), max(pair)), step) for pair in ends if pair)
    return replace(curve, pieces=pieces)


@lru_cache(maxsize=32)
def plain_curve(g: Geometry, v: int) -> CurveNumbers:
    """Return the curve of a geometry in tuples: plain code is quicker with them than arrays."""
    curve = curve_of(g, v)
    low, high = curve.line or (inf, -inf)
    pieces = (
        PieceNumbers(
            spacing=piece.spacing,
            box=piece.box,
            delta=tuple(piece.delta.tolist()),
            X=tuple(piece.X.tolist()),
            Z=tuple(piece.Z.tolist()),
        )
        for piece in curve.pieces
    )
    return CurveNumbers(curve.F1, curve.l6, float(v), low, high, tuple(pieces))


def _ends(g: Geometry, v: int, side: int) -> tuple[float, ...]:
    """Return the two values of delta between which one side of the pole is within reach."""
    plane, l2, l6, l9 = Plane.of(g), g.leg_length, g.arm_length, g.strut_length
    lift, slope = plane.lift, -plane.F1 * side
    low, high = 0.0, inf  # |tan(beta)|
    if slope == 0.0:
        if abs(lift) > l2 or l6 > l9:
            return ()
    else:  # |h| <= l2 with h = v slope |tan(beta)| - lift, then |F1 / cos(beta) - l6| <= l9
        first, second = sorted(((lift - l2) / (v * slope), (lift + l2) / (v * slope)))
        low, high = max(low, first), min(high, second)
        first, second = sorted(((l9 - l6) / slope, -(l9 + l6) / slope))
        if second < 1.0:
            return ()
        low = max(low, sqrt(max(first, 1.0) ** 2 - 1.0))
        high = min(high, sqrt(second**2 - 1.0))
    if low >= high:
        return ()
    return side * atan2(1.0, low), side * (NEAR_POLE if high == inf else atan2(1.0, high))


def _sample(curve: Case2Curve, ends: tuple[float, float], step: float) -> Piece:
    """Halve cells until each is short and nearly straight."""
    delta = np.linspace(*ends, 65)
    for _ in range(STEPS):
        x, z, tx, tz, *_ = curve.point(delta)
        chord = np.hypot(np.diff(x), np.diff(z))
        angle = np.unwrap(np.arctan2(tz, tx))
        split = (chord > step) | ((np.abs(np.diff(angle)) > TURN) & (chord > 1e-7 * step))
        if not split.any():
            break
        middle = 0.5 * (delta[:-1] + delta[1:])
        delta = np.sort(np.concatenate([delta, middle[split]]))
    spacing = 1.01 * float(chord.max())
    return Piece(
        delta=read_only(delta),
        X=read_only(x),
        Z=read_only(z),
        spacing=spacing,
        box=Extent(
            x_low=float(x.min()) - spacing,
            x_high=float(x.max()) + spacing,
            z_low=float(z.min()) - spacing,
            z_high=float(z.max()) + spacing,
        ),
    )
