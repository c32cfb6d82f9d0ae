"""The nearest surface of one pose in plain floats: what ``nearest_surface`` does for many.

numpy would spend most of its time on being called. Both are tested against each other.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import NamedTuple, TypeAlias

from duoglide.kinematics.constants import PoseConstants
from duoglide.kinematics.kernels import case2_point

ARM_FLAT, STRUT, LEGS_FLAT, ARM_STRUT = 0, 1, 3, 5  # places in ``SURFACES``
SURFACES = ("arm_flat", "strut", "legs_vertical", "legs_flat", "legs_vertical", "arm_strut")
COARSE = 16  # every so many samples for a first look
STEPS = 60  # bisection alone would then be down to rounding

Found: TypeAlias = tuple[float, float, float, int]  # distance, the direction away, the surface


class Extent(NamedTuple):
    """Least and greatest X and Z that a piece of the curve comes to, with a reserve [mm]."""

    x_low: float
    x_high: float
    z_low: float
    z_high: float


class PieceNumbers(NamedTuple):
    """A piece of the sampled curve, in tuples for plain code.

    Attributes:
        spacing: Greatest length of the curve between neighbours [mm], with a reserve.
        box: Where the piece is.
        delta: Parameter of the samples.
        X: Coordinate along x of them [mm].
        Z: Coordinate along z of them [mm].
    """

    spacing: float
    box: Extent
    delta: tuple[float, ...]
    X: tuple[float, ...]
    Z: tuple[float, ...]


class CurveNumbers(NamedTuple):
    """The sampled curve of case 2, in tuples for plain code.

    Attributes:
        F1: 2 (b - d) [mm].
        l6: Arm length [mm].
        v: Sign of sin(beta).
        low: Least Z of the line X = 0 where F1 = 0, above ``high`` where there is none [mm].
        high: Greatest Z of it [mm].
        pieces: What of it lies within reach.
    """

    F1: float
    l6: float
    v: float
    low: float
    high: float
    pieces: tuple[PieceNumbers, ...]


def nearest_of_pose(
    x: float, z: float, k: PoseConstants, curve: CurveNumbers, within: float
) -> Found:
    """Find the nearest surface of a reachable pose.

    Args:
        x: Coordinate of the platform [mm].
        z: The same.
        k: As ``pose_constants`` gives them.
        curve: The curve of case 2 of the same geometry and sign of sin(beta).
        within: Distance up to which the curve of case 2 is sought [mm].

    Returns:
        Distance [mm], x and z of the direction straight away, and place of it in ``SURFACES``.
    """
    l6, l2, l9, v = k.l6, k.l2, k.l9, k.v
    u, X, Z = x - k.cx, x - k.xb, z - k.zb
    radius = sqrt(X * X + Z * Z)
    best, away_x, away_z, surface = max(l6 - abs(u), 0.0), -copysign(1.0, u), 0.0, ARM_FLAT
    if l9 - radius < best:
        best, surface = max(l9 - radius, 0.0), STRUT
        away_x, away_z = (-X / radius, -Z / radius) if radius > 0.0 else (1.0, 0.0)
    for side in range(-1, 2):
        w = z - k.base - side * l2
        around = sqrt(u * u + w * w)
        if v * w >= 0.0 and abs(around - l6) < best:
            best, surface = abs(around - l6), LEGS_FLAT + side
            outward = -side * v if side != 0 else (1.0 if around >= l6 else -1.0)
            turn = outward / around if around > 0.0 else 0.0
            away_x, away_z = turn * u, turn * w
    if curve.low <= Z <= curve.high and abs(X) < best:
        best, away_x, away_z, surface = abs(X), copysign(1.0, X), 0.0, ARM_STRUT
    for piece in curve.pieces:
        distance, ahead, up = nearest_on_piece(X, Z, curve, piece, min(best, within))
        if distance < best:
            best, away_x, away_z, surface = distance, ahead, up, ARM_STRUT
    return best, away_x, away_z, surface


def nearest_on_piece(
    X: float, Z: float, curve: CurveNumbers, piece: PieceNumbers, best: float
) -> tuple[float, float, float]:
    """Find the nearest point of a piece of the curve, if it is nearer than ``best``.

    Neighbours are at most ``spacing`` apart, so that a far sample tells how many to leave out. The
    others are looked at closely where one is no farther than its neighbours.

    Returns:
        The distance, or ``best`` again, and the direction away.
    """
    away_x, away_z, box, spacing, end = 0.0, 0.0, piece.box, piece.spacing, len(piece.delta)
    dx = max(box.x_low - X, X - box.x_high, 0.0)
    dz = max(box.z_low - Z, Z - box.z_high, 0.0)
    if dx * dx + dz * dz > best * best:
        return best, away_x, away_z
    bound = best
    for i in range(0, end, COARSE):
        bound = min(bound, sample_gap(X, Z, piece, i))
    i = 0
    while i < end:
        here = sample_gap(X, Z, piece, i)
        if here > bound + spacing:
            i += max(int((here - bound) / spacing) - 1, 1)
            continue
        bound = min(bound, here)
        before, after = max(i - 1, 0), min(i + 1, end - 1)
        beside = min(sample_gap(X, Z, piece, before), sample_gap(X, Z, piece, after))
        if here <= beside:
            cell = piece.delta[before], piece.delta[i], piece.delta[after]
            distance, ahead, up = refine(X, Z, curve, cell)
            if distance < best:
                best, away_x, away_z = distance, ahead, up
        i += 1
    return best, away_x, away_z


def sample_gap(X: float, Z: float, piece: PieceNumbers, i: int) -> float:
    """Measure the distance of a pose to a sample."""
    dx, dz = X - piece.X[i], Z - piece.Z[i]
    return sqrt(dx * dx + dz * dz)


def refine(
    X: float, Z: float, curve: CurveNumbers, cell: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Minimise the distance about a sample: Newton within a closing bracket.

    Args:
        X: Pose seen from B3 [mm].
        Z: The same.
        curve: The curve.
        cell: Parameter of the sample before, of the sample, and of the one after.

    Returns:
        The distance, and the direction away.
    """
    low, delta, high = cell
    for _ in range(STEPS):
        cx, cz, tx, tz, bx, bz = case2_point(delta, curve.F1, curve.l6, curve.v)
        dx, dz = cx - X, cz - Z
        slope = dx * tx + dz * tz
        bend = tx * tx + tz * tz + dx * bx + dz * bz
        if slope > 0.0:
            high = delta
        else:
            low = delta
        following = delta - slope / bend if bend > 0.0 else delta
        if not low < following < high:
            following = 0.5 * (low + high)
        step, delta = abs(following - delta), following
        if step * sqrt(tx * tx + tz * tz) <= 1e-9 * curve.l6:
            break
    cx, cz, tx, tz, _, _ = case2_point(delta, curve.F1, curve.l6, curve.v)
    dx, dz = X - cx, Z - cz
    side = (-1.0 if dz * tx < dx * tz else 1.0) / sqrt(tx * tx + tz * tz)
    return sqrt(dx * dx + dz * dz), side * -tz, side * tx
