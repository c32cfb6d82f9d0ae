"""Why three carriages give no pose: diagnosis for ``forward``, with the noise of rounding."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import SingularityError, UnreachableError
from duoglide.kinematics.constants import CarriageConstants
from duoglide.kinematics.kernels import SINGULAR

EPSILON = 2.0**-52
INDETERMINATE = {
    "parallel": (
        "legs_parallel",
        "carriages 1 and 2 stand the coupler's length apart, so the legs are parallel and swing",
    ),
    "flat": ("legs_flat", "the legs lie flat (h = 0 mm), so the coupler can go up or down"),
    "in_line": (
        "arm_strut",
        "arm and strut are in line (X sin(beta) + Z cos(beta) = 0 mm), so the platform can go"
        " either way",
    ),
}


@dataclass(frozen=True, slots=True)
class Loops:
    """Both loops at some carriages, each array of the leading shape of the carriages.

    Attributes:
        B: yA2 - yA1 - l3 [mm].
        offset: |F2|, from carriage 3 to the platform along y [mm].
        centre: Distance of the arm's circle from B3 in the xz plane [mm].
        parallel: B cannot be told from 0.
        legs_short: The legs do not reach each other.
        flat: The legs do not rise, as far as can be told.
        open: Arm and strut do not reach each other.
        in_line: Arm and strut are in line, as far as can be told.
    """

    B: FloatArray
    offset: FloatArray
    centre: FloatArray
    parallel: BoolArray
    legs_short: BoolArray
    flat: BoolArray
    open: BoolArray
    in_line: BoolArray


def loops_of(carriages: FloatArray, k: CarriageConstants) -> Loops:
    """Evaluate both loops; a square near 0 is held against what rounding the carriages makes of it.

    The formulas are those of ``forward_pose``, up to its square roots of what may be negative here.
    """
    l2, l3, F1, l6, l9 = k.l2, k.l3, k.F1, k.l6, k.l9
    a1, a2, a3 = (carriages[..., i] for i in range(3))
    noise = EPSILON * (np.abs(a1) + np.abs(a2) + np.abs(a3) + l3 + l2 + l9)
    B = a2 - a1 - l3
    rise = (l2 - 0.5 * B) * (l2 + 0.5 * B)
    rise_noise = np.maximum(l2 * noise, SINGULAR**2)
    h = k.m * np.sqrt(np.maximum(rise, 0.0))
    h_noise = noise * l2 / np.maximum(np.abs(h), np.sqrt(rise_noise))
    F2 = 0.5 * (a1 + a2) - a3
    F3 = k.lift + h
    E = F1 * F1 + F3 * F3
    R = (l9 - F2) * (l9 + F2)
    K = 0.5 * (R + E - l6 * l6)
    cross = R * E - K * K
    cross_noise = (
        2.0 * np.abs(E - K) * np.abs(F2) * noise
        + 2.0 * np.abs(R - K) * np.abs(F3) * h_noise
        + 4.0 * EPSILON * (np.abs(R) * E + np.abs(K) * (np.abs(R) + E + l6 * l6))
    )
    cross_noise = np.maximum(cross_noise, (SINGULAR * l6) ** 2)
    return Loops(
        B=B,
        offset=np.abs(F2),
        centre=np.sqrt(E),
        parallel=np.abs(B) < np.maximum(SINGULAR, noise),
        legs_short=rise < -rise_noise,
        flat=~(rise >= rise_noise),
        open=(cross < -cross_noise) | (np.abs(F2) > l9 + noise),
        in_line=~(cross >= cross_noise),
    )


def require_forward(carriages: FloatArray, k: CarriageConstants) -> None:
    """Refuse the first triple of finite carriages that gives no pose, or no definite one.

    Raises:
        UnreachableError: The links do not close.
        SingularityError: They close in more than one way at once.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        loops = loops_of(carriages, k)
    bad = loops.parallel | loops.flat | loops.in_line | loops.open
    if not bad.any():
        return
    index = tuple(int(i) for i in np.argwhere(bad)[0])
    where = f"carriages[{', '.join(map(str, index))}]" if index else "carriages"
    triple = ", ".join(f"{value:.6g}" for value in carriages[index].tolist())
    start = f"{where} ({triple}) mm: "
    if loops.legs_short[index]:
        raise _legs_too_short(start, index, float(loops.B[index]), k)
    for family in ("parallel", "open", "flat", "in_line"):
        if getattr(loops, family)[index]:
            break
    if family == "open":
        raise _loop_open(start, index, (float(loops.offset[index]), float(loops.centre[index])), k)
    name, text = INDETERMINATE[family]
    text = f"{start}{text}; the position is indeterminate"
    raise SingularityError(text, index=index, family=name)


def _legs_too_short(
    start: str, index: tuple[int, ...], B: float, k: CarriageConstants
) -> UnreachableError:
    l2, l3 = k.l2, k.l3
    short = 0.5 * abs(B) - l2
    return UnreachableError(
        f"{start}the legs are {short:.6g} mm too short; yA2 - yA1 must be from"
        f" {l3 - 2.0 * l2:.6g} to {l3 + 2.0 * l2:.6g} mm",
        index=index,
        link="legs",
        shortfall=short,
    )


def _loop_open(
    start: str, index: tuple[int, ...], sides: tuple[float, float], k: CarriageConstants
) -> UnreachableError:
    """Say which of arm and strut is too short; ``sides`` are the offset and the centre."""
    offset, centre = sides
    l6, l9 = k.l6, k.l9
    if offset > l9:
        link, short = "strut", offset - l9
        remedy = f"carriage 3 must stand within {l9:.6g} mm of the platform along y"
    else:
        radius = sqrt((l9 - offset) * (l9 + offset))
        strut, arm = abs(centre - l6) - radius, radius - centre - l6
        link, short = ("strut", strut) if strut >= arm else ("arm", arm)
        remedy = "it and the other do not meet in the xz plane"
    return UnreachableError(
        f"{start}the {link} is {short:.6g} mm too short; {remedy}",
        index=index,
        link=link,
        shortfall=short,
    )
