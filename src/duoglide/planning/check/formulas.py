"""The formulas of the check, once: plain arithmetic for one part of a curve or columns of parts.

On a part of a curve a margin is bounded from below by Taylor's theorem: value, slope and a bound on
the second derivative that holds on the whole part. The clearance is a distance to a set, which
gives more: from any anchor C, clearance(p) >= clearance(C) - |p - C|. With C at the sample that is
the Lipschitz bound; with C further away from the surface it is one of second order, and asks
nothing else of the surface.

Legend, as in the kinematics: u = x - (b - d), A = l6 sin(beta), h the rise of the legs, p and q the
strokes of legs and strut along y. In pairs x comes before z.
"""

from __future__ import annotations

from math import sqrt
from typing import TypeAlias

from duoglide.kinematics.constants import Constants

FARTHEST_ANCHOR = 0.25  # of the leg's length
NEAREST_ANCHOR = 1e-3  # [mm]

Pair: TypeAlias = tuple[float, float]
Links: TypeAlias = tuple[float, float, float, float]  # A, h, p, q
Strokes: TypeAlias = tuple[float, float, float, float]  # slope and bound on the bend, of p and of q


def root_part(  # noqa: PLR0917  # the numbers of one formula
    length: float, root: float, square: float, rate: float, bend: float, half: float
) -> Pair:
    """Differentiate R = sqrt(L^2 - w) twice.

    Args:
        length: L.
        root: R at the sample.
        square: w at the sample.
        rate: w' / 2 there.
        bend: Bound on |w''| / 2 on the whole part.
        half: Half the length of the part.

    Returns:
        R' at the sample, and a bound on |R''| on the whole part; NaN where R may vanish.
    """
    steepest = abs(rate) + bend * half
    low = sqrt(length * length - (square + 2.0 * abs(rate) * half + bend * half * half))
    steep = steepest / low
    return -rate / root, bend / low + steep * steep / low


def strokes_part(  # noqa: PLR0917  # a part of a curve is a point, three bounds and a length
    at: Pair, slope: Pair, first: Pair, second: Pair, half: float, links: Links, k: Constants
) -> Strokes:
    """Slopes of the strokes by sigma at the sample, and bounds on their second derivatives."""
    cx, _base, l6, l2, _half, xb, zb, l9, _v, _w1, _w2, _w3 = k
    (x, z), (dx, dz), (vx, vz), (ax, az) = at, slope, first, second
    A, h, p, q = links
    u, X, Z = x - cx, x - xb, z - zb
    bend = vx * vx + (abs(u) + vx * half) * ax
    slope_a, bend_a = root_part(l6, A, u * u, u * dx, bend, half)
    dh, ah = dz - slope_a, az + bend_a
    vh = abs(dh) + ah * half
    bend = vh * vh + (abs(h) + vh * half) * ah
    slope_p, bend_p = root_part(l2, p, h * h, h * dh, bend, half)
    bend = vx * vx + vz * vz + (abs(X) + vx * half) * ax + (abs(Z) + vz * half) * az
    slope_q, bend_q = root_part(l9, q, X * X + Z * Z, X * dx + Z * dz, bend, half)
    return slope_p, bend_p, slope_q, bend_q


def travel_pose(
    y: float, p: float, q: float, limit: float, k: Constants
) -> tuple[float, float, float, float, float, float, float]:
    """Places of the carriages, their travel that is left, and the way from carriage 1 to 2."""
    half_coupler, w1, w2, w3 = k[4], k[9], k[10], k[11]
    one, two, three = y - half_coupler + w1 * p, y + half_coupler + w2 * p, y + w3 * q
    gap = 2.0 * half_coupler + (w2 - w1) * p
    return one, two, three, limit - abs(one), limit - abs(two), limit - abs(three), gap


def travel_part(
    speed: float, bend: float, half: float, strokes: Strokes, k: Constants
) -> tuple[float, float, float, float]:
    """How much less travel 1 to 3 and the way from carriage 1 to 2 may be on the whole part.

    Args:
        speed: y' at the sample.
        bend: Bound on y''.
        half: Half the length of the part.
        strokes: As ``strokes_part`` gives them.
        k: The kinematics' constants.
    """
    w1, w2, w3 = k[9], k[10], k[11]
    slope_p, bend_p, slope_q, bend_q = strokes
    square = 0.5 * half * half
    return (
        abs(speed + w1 * slope_p) * half + (bend + bend_p) * square,
        abs(speed + w2 * slope_p) * half + (bend + bend_p) * square,
        abs(speed + w3 * slope_q) * half + (bend + bend_q) * square,
        abs(w2 - w1) * (abs(slope_p) * half + bend_p * square),
    )


def clear_part(away: Pair, slope: Pair, second: Pair, half: float) -> tuple[float, float, float]:
    """How far a part leads: from the sample, toward the surface, and from its own chord."""
    (nx, nz), (dx, dz), (ax, az) = away, slope, second
    return (
        sqrt(dx * dx + dz * dz) * half,
        abs(dx * nx + dz * nz) * half,
        0.5 * sqrt(ax * ax + az * az) * half * half,
    )


def anchor_part(away: Pair, chord: Pair, spare: float, leg: float) -> Pair:
    """Offset of an anchor from the sample, away from the nearest surface.

    The anchor is twice as far away as the chord's length asks for: with the offset l, the bound is
    short of the true value by about w^2 / (2 l) at a distance w along the surface.

    Args:
        away: Unit vector away from the surface.
        chord: Half of the part's chord [mm].
        spare: What the bound of first order leaves [mm], above 0.
        leg: Length of the legs [mm].
    """
    (nx, nz), (wx, wz) = away, chord
    offset = min(max((wx * wx + wz * wz) / spare, NEAREST_ANCHOR), FARTHEST_ANCHOR * leg)
    return offset * nx, offset * nz


def chord_part(offset: Pair, chord: Pair) -> float:
    """Distance of the anchor to the farther end of the chord."""
    (ox, oz), (wx, wz) = offset, chord
    ahead = (ox - wx) * (ox - wx) + (oz - wz) * (oz - wz)
    behind = (ox + wx) * (ox + wx) + (oz + wz) * (oz + wz)
    return sqrt(max(ahead, behind))
