"""Blends: the curves of continuous curvature that round a corner.

A blend is the polynomial of degree 5 in sigma that leaves the segment before the corner and joins
the one after it with equal position, first and second derivative. Three numbers are free: how far
before and after the corner it starts and ends, and how long it is in sigma. The last is given by
``shape``: as a Bezier curve its control points P1, P2 (and P3, P4) follow the segment's tangent at
distances h and 2 h with h = shape * min(before, after), and its span is 5 h.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TypeAlias

import numpy as np

from duoglide.arrays import FloatArray, as_number
from duoglide.errors import InputError

SHAPE = 0.45  # what check_path takes by itself; 0.5 bends hardest, and passes nearest the corner
_HERMITE = np.array(  # powers of u of the six Hermite conditions p, p', p'' at u = 0 and at u = 1
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
        [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
        [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
    ]
)
_EXPONENTS = np.arange(11.0)
_FOLD = (  # products of two polynomials of degree 5, as a matrix
    np.add.outer(np.arange(6), np.arange(6)).reshape(36, 1) == np.arange(11)
).astype(np.float64)
_GRID = np.linspace(0.0, 1.0, 65)
_GRID_POWERS = _GRID ** _EXPONENTS[:, None]
_NEWTON = 4
_STILL = 1e-12  # of u; a step this short is the last


@dataclass(frozen=True, slots=True)
class Blend:
    """How to round one corner.

    Attributes:
        before: Cut-back on the segment before the corner [mm].
        after: Cut-back on the segment after it [mm].
        shape: Span of the blend over five times the smaller cut-back, above 0 and below 1. Up to
            0.5 the blend of two lines never leaves their triangle.

    Raises:
        InputError: A value that is not finite or out of range.
    """

    before: float
    after: float
    shape: float = SHAPE

    def __post_init__(self) -> None:
        for name in ("before", "after", "shape"):
            number = as_number(getattr(self, name), f"blend {name}")
            if number <= 0.0:
                raise InputError(f"blend {name} = {number:g}: must be above 0")
            object.__setattr__(self, name, number)
        if self.shape >= 1.0:
            raise InputError(f"blend shape = {self.shape:g}: must be below 1")

    @classmethod
    def radius(cls, cut_back: float) -> Blend:
        """Return the blend with one cut-back on both sides [mm]."""
        return cls(cut_back, cut_back)

    def turned(self) -> Blend:
        """Return the same blend, travelled backwards."""
        return Blend(self.after, self.before, self.shape)

    def to_dict(self) -> dict[str, float]:
        """Return the fields."""
        return asdict(self)


def join_quintics(left: FloatArray, right: FloatArray, span: FloatArray) -> FloatArray:
    """Join states by polynomials of degree 5.

    Args:
        left: p, p', p'' by sigma where the blends start, shape (n, 3 or more, 3).
        right: The same where they end.
        span: Their length in sigma [mm], shape (n,).

    Returns:
        Coefficients of the powers of u = s / span, shape (n, 6, 3).
    """
    states = np.empty((span.size, 2, 3, 3))  # side, derivative, axis
    states[:, 0], states[:, 1] = left[:, :3], right[:, :3]
    # positions relative to the start, so that large coordinates cost no digits
    states[:, :, 0] -= left[:, None, 0]
    states[:, :, 1:] *= span[:, None, None, None]
    states[:, :, 2] *= span[:, None, None]
    coefficients: FloatArray = _HERMITE.T @ states.reshape(-1, 6, 3)
    coefficients[:, 0] += left[:, 0]
    return coefficients


def find_nearest(coefficients: FloatArray, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find where polynomials pass nearest to points.

    Args:
        coefficients: Powers of u on [0, 1], shape (n, 6, 3).
        point: Shape (n, 3) [mm].

    Returns:
        u and the distance [mm] there, each shape (n,).
    """
    shifted = coefficients.copy()
    shifted[:, 0] -= point
    squares = (shifted @ shifted.transpose(0, 2, 1)).reshape(-1, 36) @ _FOLD  # of the distance
    best = np.argmin(squares @ _GRID_POWERS, axis=1)
    low, high = _GRID[np.maximum(best - 1, 0)], _GRID[np.minimum(best + 1, _GRID.size - 1)]
    u, rates = _GRID[best], np.zeros((len(best), 2, _EXPONENTS.size - 1))  # of the square, by u
    rates[:, 0] = squares[:, 1:] * _EXPONENTS[1:]
    rates[:, 1, :-1] = rates[:, 0, 1:] * _EXPONENTS[1:-1]
    for _ in range(_NEWTON):  # on the derivative, kept in its bracket
        slope, bend = (rates @ (u[:, None] ** _EXPONENTS[:-1])[..., None])[..., 0].T
        rising = slope > 0.0
        high, low = np.where(rising, u, high), np.where(rising, low, u)
        step = u - slope / np.where(bend > 0.0, bend, np.inf)
        before, u = u, np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
        if (np.abs(u - before) < _STILL).all():
            break
    offset = ((u[:, None] ** _EXPONENTS[:6])[:, None] @ shifted)[:, 0]
    return u, np.sqrt((offset * offset).sum(axis=1))


Corner: TypeAlias = float | Blend  # a corner tolerance [mm], or how to round


def as_corner(corner: object) -> Corner:
    """Return a corner's tolerance or blend.

    Raises:
        InputError: Not a number from 0 on.
    """
    if isinstance(corner, Blend):
        return corner
    number = as_number(corner, "tolerance [mm]")
    if number < 0.0:
        raise InputError(f"tolerance = {number:g} mm: must be 0 or above")
    return number


def turn_corner(corner: Corner) -> Corner:
    """Return the corner as the way back finds it."""
    return corner.turned() if isinstance(corner, Blend) else corner
