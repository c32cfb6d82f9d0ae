"""The nearest surface of one pose in plain floats: what ``nearest_surface`` does for many.

numpy would spend most of its time on being called. Both are tested against each other.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any, NamedTuple, TypeAlias

from duoglide.kinematics.constants import Constants
from duoglide.kinematics.kernels import case2_point

ARM_FLAT, STRUT, LEGS_FLAT, ARM_STRUT = 0, 1, 3, 5  # places in ``SURFACES``
SURFACES = ("arm_flat", "strut", "legs_vertical", "legs_flat", "legs_vertical", "arm_strut")
COARSE = 16  # every so many samples for a first look
STEPS = 60  # bisection alone would then be down to rounding

Found: TypeAlias = tuple[float, float, float, int]  # distance, the direction away, the surface


class CurveNumbers(NamedTuple):
    """The sampled curve of case 2, in tuples for plain code.

    Attributes:
        F1: 2 (b - d) [mm].
        l6: Arm length [mm].
        v: Sign of sin(beta).
        low: Least Z of the line X = 0 where F1 = 0, above ``high`` where there is none [mm].
        high: Greatest Z of it [mm].
        pieces: Of each piece its first sample and the one after its last, its ``spacing`` and its
            ``box``, as in ``Piece``: seven numbers, one piece after the other.
        samples: Of each sample its parameter, X and Z, one after the other.
    """

    F1: float
    l6: float
    v: float
    low: float
    high: float
    pieces: Any
    samples: Any


def nearest_of_pose(x: float, z: float, k: Constants, curve: CurveNumbers, within: float) -> Found:
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
    cx, base, l6, l2, _half, xb, zb, l9, v, _w1, _w2, _w3 = k
    u, X, Z = x - cx, x - xb, z - zb
    radius = sqrt(X * X + Z * Z)
    best, away_x, away_z, surface = max(l6 - abs(u), 0.0), -copysign(1.0, u), 0.0, ARM_FLAT
    if l9 - radius < best:
        best, surface = max(l9 - radius, 0.0), STRUT
        away_x, away_z = (-X / radius, -Z / radius) if radius > 0.0 else (1.0, 0.0)
    for side in range(-1, 2):
        w = z - base - side * l2
        around = sqrt(u * u + w * w)
        if v * w >= 0.0 and abs(around - l6) < best:
            best, surface = abs(around - l6), LEGS_FLAT + side
            outward = -side * v if side != 0 else (1.0 if around >= l6 else -1.0)
            turn = outward / around if around > 0.0 else 0.0
            away_x, away_z = turn * u, turn * w
    if curve.low <= Z <= curve.high and abs(X) < best:
        best, away_x, away_z, surface = abs(X), copysign(1.0, X), 0.0, ARM_STRUT
    for piece in range(len(curve.pieces) // 7):
        distance, ahead, up = nearest_on_piece(X, Z, curve, piece, min(best, within))
        if distance < best:
            best, away_x, away_z, surface = distance, ahead, up, ARM_STRUT
    return best, away_x, away_z, surface


def nearest_on_piece(
    X: float, Z: float, curve: CurveNumbers, piece: int, best: float
) -> tuple[float, float, float]:
    """Find the nearest point of a piece of the curve, if it is nearer than ``best``.

    Neighbours are at most ``spacing`` apart, so that a far sample tells how many to leave out. The
    others are looked at closely where one is no farther than its neighbours.

    Returns:
        The distance, or ``best`` again, and the direction away.
    """
    away_x, away_z, row, pieces = 0.0, 0.0, 7 * piece, curve.pieces
    start, end, spacing = int(pieces[row]), int(pieces[row + 1]), pieces[row + 2]
    dx = max(pieces[row + 3] - X, X - pieces[row + 4], 0.0)
    dz = max(pieces[row + 5] - Z, Z - pieces[row + 6], 0.0)
    if dx * dx + dz * dz > best * best:
        return best, away_x, away_z
    bound = best
    for i in range(start, end, COARSE):
        bound = min(bound, sample_gap(X, Z, curve.samples, i))
    i = start
    while i < end:
        here = sample_gap(X, Z, curve.samples, i)
        if here > bound + spacing:
            i += max(int((here - bound) / spacing) - 1, 1)
            continue
        bound = min(bound, here)
        before, after = max(i - 1, start), min(i + 1, end - 1)
        beside = sample_gap(X, Z, curve.samples, before), sample_gap(X, Z, curve.samples, after)
        if here <= beside[0] and here <= beside[1]:
            distance, ahead, up = refined(X, Z, curve, (before, i, after))
            if distance < best:
                best, away_x, away_z = distance, ahead, up
        i += 1
    return best, away_x, away_z


def sample_gap(X: float, Z: float, samples: Any, i: int) -> float:
    """Measure the distance of a pose to a sample."""
    dx, dz = X - samples[3 * i + 1], Z - samples[3 * i + 2]
    return sqrt(dx * dx + dz * dz)


def refined(
    X: float, Z: float, curve: CurveNumbers, cell: tuple[int, int, int]
) -> tuple[float, float, float]:
    """Minimise the distance about a sample: Newton within a closing bracket.

    Returns:
        The distance, and the direction away.
    """
    before, here, after = cell
    samples = curve.samples
    low, delta, high = samples[3 * before], samples[3 * here], samples[3 * after]
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
