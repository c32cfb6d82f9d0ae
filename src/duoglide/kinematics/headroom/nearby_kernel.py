"""How the platform moves about a pose while the carriages are within bounds: one loop, compiled."""

from __future__ import annotations

from math import inf, sqrt
from typing import TypeAlias

from duoglide.arrays import FloatArray
from duoglide.kinematics.compiled import compiled, inlined
from duoglide.kinematics.constants import CarriageConstants

Two: TypeAlias = tuple[float, float]
Four: TypeAlias = tuple[float, float, float, float]
Arrays: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


@inlined
def leg(hypotenuse: float, side: float) -> float:
    """Return the other short side of a right triangle [mm]."""
    return sqrt((hypotenuse - side) * (hypotenuse + side))


@inlined
def third_side(one: float, other: float, cosine: float) -> float:
    """Return at most |v| times the sine between n and e, for |n v| <= one and |e v| <= other."""
    return sqrt(one * one + other * other + 2.0 * one * other * cosine)


@inlined
def find_steepest(fixed: Two, foot: Two, rho: Two) -> float:
    """Return the largest |cos| of the angle between arm and strut, (l6^2 + rho^2 - E) / 2 l6 rho.

    Args:
        fixed: l6 and F1.
        foot: Lowest and highest F3; E = F1^2 + F3^2 is the square of the arm's foot's distance.
        rho: Least and largest projection of the strut.
    """
    (l6, F1), (below, above), (low, high) = fixed, foot, rho
    nearest = 0.0 if below * above < 0.0 else min(below * below, above * above)
    rest = l6 * l6 - F1 * F1
    most, least = rest - nearest, rest - max(below * below, above * above)
    turn = min(max(sqrt(max(least, 0.0)), low), high)
    largest = max(low + most / low, high + most / high)
    return max(abs(largest), abs(turn + least / turn)) / (2.0 * l6)


@inlined
def slopes(pose: Four, k: CarriageConstants) -> Four:
    """Slopes of the platform by B in x and z, and by D.

    Args:
        pose: B, D, and x and z of C3 from B3.
        k: As ``carriage_constants`` gives them.
    """
    B, D, X, Z = pose
    h, rho = leg(k.l2, 0.5 * B), sqrt(X * X + Z * Z)
    n_x, n_z, e_x, e_z = (X - k.F1) / k.l6, (Z - k.lift - h) / k.l6, X / rho, Z / rho
    sine = n_z * e_x - n_x * e_z
    by_h, by_rho = -0.25 * B / h * n_z / sine, -D / rho / sine
    return -e_z * by_h, e_x * by_h, n_z * by_rho, -n_x * by_rho


@inlined
def find_farthest(pose: Two, far: Two, k: CarriageConstants) -> tuple[float, float]:
    """Bound how far the platform goes, and how far it goes off its slopes; NaN if not at all.

    Args:
        pose: B and D.
        far: How far they may be from there.
        k: As ``carriage_constants`` gives them.
    """
    (B, D), (far_B, far_D) = pose, far
    l2, F1, lift, l6, l9 = k.l2, k.F1, k.lift, k.l6, k.l9
    most_B, most_D = abs(B) + far_B, abs(D) + far_D
    h_low, rho_low = leg(l2, 0.5 * most_B), leg(l9, most_D)
    h_high = leg(l2, 0.5 * max(abs(B) - far_B, 0.0))
    rho_high = leg(l9, max(abs(D) - far_D, 0.0))
    cosine = find_steepest((l6, F1), (lift + h_low, lift + h_high), (rho_low, rho_high))
    sine = sqrt((1.0 - cosine) * (1.0 + cosine))
    dh, drho = 0.25 * most_B * far_B / h_low, most_D * far_D / rho_low
    way = third_side(dh, drho, cosine) / sine
    ddh = (0.25 * far_B * far_B + dh * dh) / h_low
    ddrho = (far_D * far_D + drho * drho) / rho_low
    turn, swing = ddh + (way + dh) * (way + dh) / l6, ddrho + way * way / rho_low
    return way, 0.5 * third_side(turn, swing, cosine) / sine


@compiled
def swing(patch: Arrays, position: FloatArray, k: CarriageConstants, out: Arrays) -> None:
    """Carry patches of carriages to the platform.

    Args:
        patch: Middles (n, 3), ways (n, k, 3) and what is beyond these (n, 5).
        position: Platform in the middle, (n, 3).
        k: As ``carriage_constants`` gives them.
        out: Where the ways lead in x and z, (n, k, 2); how far off these the platform may be, and
            how far from the middle at most, (n,) each; inf where that is not known.
    """
    middle, ways, beyond = patch
    across, off, reach = out
    for i in range(middle.shape[0]):
        B, D = middle[i, 1] - middle[i, 0] - k.l3, middle[i, 2] - position[i, 1]
        xB, zB, xD, zD = slopes((B, D, position[i, 0] - k.xb, position[i, 2] - k.zb), k)
        far_B, far_D = beyond[i, 3], beyond[i, 4]
        for w in range(ways.shape[1]):
            one, two, three = ways[i, w, 0], ways[i, w, 1], ways[i, w, 2]
            dB, dD = two - one, three - 0.5 * (one + two)
            across[i, w, 0] = xB * dB + xD * dD
            across[i, w, 1] = zB * dB + zD * dD
            far_B += abs(dB)
            far_D += abs(dD)
        reach[i], bow = find_farthest((B, D), (far_B, far_D), k)
        off[i] = bow + beyond[i, 3] * sqrt(xB * xB + zB * zB)
        off[i] += beyond[i, 4] * sqrt(xD * xD + zD * zD)
        if not off[i] < inf:
            off[i] = inf
        if not reach[i] < inf:
            reach[i] = inf
