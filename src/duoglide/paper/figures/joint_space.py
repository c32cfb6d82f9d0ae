"""Singular surfaces in the space of the carriages.

Everything is the same along the direction (1, 1, 1), in which all carriages move together, so that
each surface stands on a curve of the plane of B = yA2 - yA1 - l3 and W = yA1 + yA2 - 2 yA3.
"""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.constants import Plane
from duoglide.machine import Geometry
from duoglide.paper.figures.scene import Panels
from duoglide.paper.figures.surfaces import COLOURS, quads

_POINTS = 61
_OPACITY = {"legs vertical": 0.45, "legs parallel": 0.4, "legs flat": 0.35, "strut": 0.6}


def joint_space_panels(geometry: Geometry, families: tuple[str, ...], half: float) -> list[Panels]:
    """Return the surfaces of ``families`` within a cube of half side ``half`` [mm]."""
    found = []
    for family in families:
        parts = [_along_diagonal(geometry, line, half) for line in _curves(geometry, family, half)]
        parts = [part for part in parts if len(part)]
        if parts:
            found.append(Panels(np.concatenate(parts), COLOURS[family], _OPACITY.get(family, 0.85)))
    return found


def _curves(g: Geometry, family: str, half: float) -> list[FloatArray]:
    """Return the curves of (B, W), shape (n, 2), on which a family's surface stands."""
    F1 = Plane.of(g).F1
    W = np.linspace(-4.0 * half, 4.0 * half, 2 * _POINTS)
    B = np.linspace(-1.0, 1.0, 2 * _POINTS) * 2.0 * g.leg_length
    match family:
        case "legs vertical" | "legs parallel":
            return [np.stack([np.zeros_like(W), W], axis=-1)]
        case "legs flat":
            sides = (-2.0 * g.leg_length, 2.0 * g.leg_length)
            return [np.stack([np.full_like(W, side), W], axis=-1) for side in sides]
        case "strut":
            return [np.stack([B, np.zeros_like(B)], axis=-1)]
        case "arm flat":
            radii = [
                np.hypot(F1 - side * g.arm_length, rise)
                for side in (-1, 1)
                for rise in _rises(g, B)
            ]
        case _:
            radii = [
                np.hypot(F1, rise) + side * g.arm_length
                for side in (-1, 1)
                for rise in _rises(g, B)
            ]
    lines = []
    for radius in radii:
        real = np.abs(radius) <= g.strut_length
        stroke = np.sqrt(np.maximum(g.strut_length**2 - radius**2, 0.0))
        parts = np.split(np.arange(len(B)), np.flatnonzero(np.diff(real.astype(int))) + 1)
        for part in parts:
            if real[part[0]] and len(part) > 1:
                stretch = np.stack([B[part], 2.0 * stroke[part]], axis=-1)
                stretch = np.concatenate([*_tips(B, radius, part.tolist(), g), stretch])
                stretch = stretch[stretch[:, 0].argsort()]
                lines += [stretch * np.array([1.0, sign]) for sign in (-1.0, 1.0)]
    return lines


def _tips(B: FloatArray, radius: FloatArray, part: list[int], g: Geometry) -> list[FloatArray]:
    """Return the ends of a stretch where the strut's stroke vanishes, each of shape (1, 2)."""
    longest = g.strut_length
    tips = []
    for last, beyond in ((part[0], part[0] - 1), (part[-1], part[-1] + 1)):
        if 0 <= beyond < len(B):
            inside, outside = longest - abs(radius[last]), longest - abs(radius[beyond])
            share = inside / (inside - outside)
            tips.append(np.array([[B[last] + share * (B[beyond] - B[last]), 0.0]]))
    return tips


def _rises(g: Geometry, B: FloatArray) -> list[FloatArray]:
    """Return F3 of Eq. 11 for m = +1 and, where it makes a difference, for m = -1."""
    lift = Plane.of(g).lift
    h = np.sqrt(np.maximum(g.leg_length**2 - 0.25 * B * B, 0.0))
    return [lift + h] if lift == 0.0 else [lift + h, lift - h]


def _along_diagonal(g: Geometry, line: FloatArray, half: float, slices: int = 4) -> FloatArray:
    """Extrude a curve of (B, W) along (1, 1, 1), cut by the cube, shape (n, 4, 3)."""
    offset = 0.5 * (line[:, 0] + g.coupler_length)
    offsets = np.stack([-offset, offset, -0.5 * line[:, 1]], axis=-1)
    low, high = -half - offsets.min(axis=-1), half - offsets.max(axis=-1)
    inside = low < high
    way = np.linspace(0.0, 1.0, slices + 1)
    shift = low[:, None] + way * (high - low)[:, None]
    grid = offsets[:, None, :] + shift[..., None]
    both = inside[:-1] & inside[1:]
    cells: FloatArray = quads(grid).reshape(len(line) - 1, slices, 4, 3)[both]
    return cells.reshape(-1, 4, 3)
