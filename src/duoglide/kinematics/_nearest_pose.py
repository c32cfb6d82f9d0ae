"""The nearest surface of one pose in plain floats: what ``nearest_surface`` does for many.

numpy would spend most of its time on being called. Both are tested against each other.
"""

from __future__ import annotations

from math import copysign, hypot, sqrt
from typing import TypeAlias

from duoglide.kinematics._case2 import COARSE, STEPS, Case2Curve, Piece
from duoglide.kinematics.constants import Constants
from duoglide.kinematics.kernels import case2_point

Found: TypeAlias = tuple[float, float, float, str]  # distance, the direction away, the family


def nearest_of_pose(x: float, z: float, k: Constants, curve: Case2Curve) -> Found:
    """Find the nearest surface of a reachable pose.

    Args:
        x: Coordinate of the platform [mm].
        z: The same.
        k: As ``pose_constants`` gives them.
        curve: The curve of case 2 of the same geometry and sign of sin(beta).
    """
    cx, base, l6, l2, _half, xb, zb, l9, v, *_ = k
    u, X, Z = x - cx, x - xb, z - zb
    radius = sqrt(X * X + Z * Z)
    best: Found = (max(l6 - abs(u), 0.0), -copysign(1.0, u), 0.0, "arm_flat")
    if l9 - radius < best[0]:
        away = (-X / radius, -Z / radius) if radius > 0.0 else (1.0, 0.0)
        best = (max(l9 - radius, 0.0), *away, "strut")
    for side in (-1.0, 0.0, 1.0):
        w = z - base - side * l2
        around = sqrt(u * u + w * w)
        if v * w >= 0.0 and abs(around - l6) < best[0]:
            outward = -side * v if side else (1.0 if around >= l6 else -1.0)
            turn = outward / around if around > 0.0 else 0.0
            best = (abs(around - l6), turn * u, turn * w, "legs_vertical" if side else "legs_flat")
    if curve.line and curve.line[0] <= Z <= curve.line[1] and abs(X) < best[0]:
        best = (abs(X), copysign(1.0, X), 0.0, "arm_strut")
    for piece in curve.pieces:
        for cell in _near_samples(piece, X, Z, best[0]):
            best = min(best, _refined(curve, piece, cell, (X, Z)))
    return best


def _near_samples(piece: Piece, X: float, Z: float, best: float) -> list[int]:
    """List the samples about which a piece may come nearer than ``best``: local minima.

    Neighbours are at most ``spacing`` apart, so that a far sample tells how many to leave out.
    """
    x_low, x_high, z_low, z_high = piece.box
    if hypot(max(x_low - X, X - x_high, 0.0), max(z_low - Z, Z - z_high, 0.0)) > best:
        return []
    samples, spacing = piece.samples, piece.spacing
    best = min(best, *(hypot(X - sx, Z - sz) for sx, sz in samples[::COARSE]))
    cells, i, last = [], 0, len(samples) - 1
    while i <= last:
        here = hypot(X - samples[i][0], Z - samples[i][1])
        if here > best + spacing:
            i += max(int((here - best) / spacing) - 1, 1)
            continue
        best = min(best, here)
        before = samples[max(i - 1, 0)]
        after = samples[min(i + 1, last)]
        if here <= hypot(X - before[0], Z - before[1]) and here <= hypot(
            X - after[0], Z - after[1]
        ):
            cells.append(i)
        i += 1
    return cells


def _refined(curve: Case2Curve, piece: Piece, cell: int, pose: tuple[float, float]) -> Found:
    """Minimise the distance about a sample: Newton within a closing bracket."""
    X, Z = pose
    last = len(piece.samples) - 1
    low, delta, high = (
        float(piece.delta[i]) for i in (max(cell - 1, 0), cell, min(cell + 1, last))
    )
    for _ in range(STEPS):
        cx, cz, tx, tz, bx, bz = case2_point(delta, curve.F1, curve.l6, curve.v)
        dx, dz = cx - X, cz - Z
        slope = dx * tx + dz * tz
        bend = tx * tx + tz * tz + dx * bx + dz * bz
        low, high = (low, delta) if slope > 0.0 else (delta, high)
        following = delta - slope / bend if bend > 0.0 else delta
        if not low < following < high:
            following = 0.5 * (low + high)
        step, delta = abs(following - delta), following
        if step * hypot(tx, tz) <= 1e-9 * curve.l6:
            break
    cx, cz, tx, tz, *_ = case2_point(delta, curve.F1, curve.l6, curve.v)
    side = copysign(1.0 / hypot(tx, tz), (cz - Z) * tx - (cx - X) * tz)
    return hypot(X - cx, Z - cz), side * tz, -side * tx, "arm_strut"
