"""Points of each singularity family, to tell true factors from spurious ones.

The points are complex: every component of a surface then has some, whether or not the robot reaches
it, and a polynomial that vanishes on a component vanishes on all of its complex points.
"""

from __future__ import annotations

from cmath import sqrt
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from duoglide.paper.elimination.families import Family

_Values = dict[str, complex]


@dataclass(frozen=True, slots=True)
class Shape:
    """Numbers for k = b - d, e = l4 + l7 - l8 and three lengths."""

    k: float
    e: float
    l2: float
    l6: float
    l9: float


def family_points(family: Family, shape: Shape, seed: int = 0) -> Iterator[_Values]:
    """Yield points (X, Z, B, W) on every component of the family's surface."""
    random = np.random.default_rng(seed)
    for signs in product((1, -1), repeat=3):
        for _ in range(2):
            a, b = complex(*random.normal(size=2)), complex(*random.normal(size=2))
            yield _point(family, shape, (0.3 * a, shape.l2 * 0.3 * b), signs)


def _point(
    family: Family, g: Shape, free: tuple[complex, complex], signs: tuple[int, ...]
) -> _Values:
    """Close the loops at a point of the family, from two free numbers and three signs."""
    cosine, h = free
    sign, leg, strut = signs
    if family is Family.ARM_FLAT:
        cosine = complex(sign)
    sine = sign * sqrt(1 - cosine * cosine)
    X = 2 * g.k - g.l6 * cosine
    rules: dict[Family, Callable[[], complex]] = {
        Family.LEGS_FLAT: lambda: 0j,
        Family.LEGS_VERTICAL: lambda: complex(sign * g.l2),
        Family.STRUT: lambda: strut * sqrt(g.l9**2 - X * X) - g.e - g.l6 * sine,
        Family.ARM_STRUT: lambda: -X * sine / cosine - g.e - g.l6 * sine,
    }
    h = rules.get(family, lambda: h)()
    Z = h + g.e + g.l6 * sine
    stroke = sqrt(g.l2**2 - h * h)
    y = 0j
    B = 2 * leg * stroke
    if family in (Family.LEGS_PARALLEL, Family.LEGS_VERTICAL):
        y, B = leg * stroke, 0j
    W = 2 * (strut * sqrt(g.l9**2 - X * X - Z * Z) - y) if family is not Family.STRUT else -2 * y
    return {"X": X, "Z": Z, "B": B, "W": W}
