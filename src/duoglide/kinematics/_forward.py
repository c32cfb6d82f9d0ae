"""Why three carriages give no pose: diagnosis for ``forward``, with the noise of rounding."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import SingularityError, UnreachableError
from duoglide.kinematics._kernels import SINGULAR, Constants

EPSILON = 2.0**-52


def require_forward(carriages: FloatArray, k: Constants) -> None:
    """Refuse the first triple of finite carriages that gives no pose, or no definite one.

    A square root near zero is held against what rounding the carriages alone can make of it.

    Raises:
        UnreachableError: The links do not close.
        SingularityError: They close in more than one way at once.
    """
    l2, l3, F1, lift, l6, l9, _xb, _zb, m, _n = k
    a1, a2, a3 = (carriages[..., i] for i in range(3))
    noise = EPSILON * (np.abs(a1) + np.abs(a2) + np.abs(a3) + l3 + l2 + l9)
    B = a2 - a1 - l3
    rise = (l2 - 0.5 * B) * (l2 + 0.5 * B)
    rise_noise = np.maximum(l2 * noise, SINGULAR**2)
    h = m * np.sqrt(np.maximum(rise, 0.0))
    F2 = 0.5 * (a1 + a2) - a3
    F3 = lift + h
    E = F1 * F1 + F3 * F3
    R = (l9 - F2) * (l9 + F2)
    K = 0.5 * (R + E - l6 * l6)
    cross = R * E - K * K
    h_noise = noise * l2 / np.maximum(np.abs(h), np.sqrt(rise_noise))
    cross_noise = (
        2.0 * np.abs(E - K) * np.abs(F2) * noise
        + 2.0 * np.abs(R - K) * np.abs(F3) * h_noise
        + 4.0 * EPSILON * (np.abs(R) * E + K * K)
    )
    cross_noise = np.maximum(cross_noise, (SINGULAR * l6) ** 2)
    parallel = np.abs(B) < np.maximum(SINGULAR, noise)
    legs_short = rise < -rise_noise
    flat = ~(rise >= rise_noise)
    open_loop = (cross < -cross_noise) | (np.abs(F2) > l9 + noise)
    in_line = ~(cross >= cross_noise)
    bad = parallel | flat | in_line
    if not bad.any():
        return
    index = tuple(int(i) for i in np.argwhere(bad)[0])
    where = f"carriages[{', '.join(map(str, index))}]" if index else "carriages"
    triple = ", ".join(f"{value:.6g}" for value in carriages[index].tolist())
    start = f"{where} ({triple}) mm: "
    if legs_short[index]:
        raise _legs_too_short(start, index, float(B[index]), l2, l3)
    if parallel[index]:
        raise SingularityError(
            f"{start}carriages 1 and 2 stand a coupler ({l3:.6g} mm) apart, so the legs are"
            " parallel and free to swing; the position is indeterminate",
            index=index,
            family="legs_parallel",
        )
    if open_loop[index]:
        centre = float(np.sqrt(E[index]))
        raise _loop_open(start, index, abs(float(F2[index])), centre, k)
    if flat[index]:
        raise SingularityError(
            f"{start}the legs lie flat (h = 0 mm), so the coupler can go up or down;"
            " the position is indeterminate",
            index=index,
            family="legs_flat",
        )
    raise SingularityError(
        f"{start}arm and strut are in line (X sin(beta) + Z cos(beta) = 0 mm), so the platform can"
        " go either way; the position is indeterminate",
        index=index,
        family="arm_strut",
    )


def _legs_too_short(
    start: str, index: tuple[int, ...], B: float, l2: float, l3: float
) -> UnreachableError:
    short = 0.5 * abs(B) - l2
    apart = sorted((l3 - 2.0 * l2, l3 + 2.0 * l2))
    return UnreachableError(
        f"{start}the legs are {short:.6g} mm too short; carriage 2 must stand"
        f" {apart[0]:.6g} to {apart[1]:.6g} mm beyond carriage 1",
        index=index,
        link="legs",
        shortfall=short,
    )


def _loop_open(
    start: str, index: tuple[int, ...], offset: float, centre: float, k: Constants
) -> UnreachableError:
    """Say which of arm and strut is too short; ``centre`` is the distance of the arm's pivot."""
    l6, l9 = k[4], k[5]
    if offset > l9:
        link, short = "strut", offset - l9
    else:
        radius = float(np.sqrt((l9 - offset) * (l9 + offset)))
        strut, arm = max(centre - l6, l6 - centre) - radius, radius - centre - l6
        link, short = ("strut", strut) if strut >= arm else ("arm", arm)
    return UnreachableError(
        f"{start}the {link} is {short:.6g} mm too short for the second loop to close",
        index=index,
        link=link,
        shortfall=short,
    )
