"""How far a blend of two lines stays away from its corner, compiled: the choice asks it often."""

from __future__ import annotations

from math import sqrt

from duoglide.kinematics.compiled import compiled, inlined

_COARSE = 10  # parts of a blend in which its nearest point is looked for
_GOLDEN_STEPS = 18  # of the golden section there: to 2e-4 of two parts
_GOLDEN = 0.5 * (sqrt(5.0) - 1.0)


@inlined
def square_at(u: float, before: float, after: float, way: float, cosine: float) -> float:
    """Return the square of the distance at ``u``, by the blend's parts along both lines."""
    v = 1.0 - u
    x = v * v * v * (before * (1.0 + u * (3.0 + 6.0 * u)) - way * u * (1.0 + 3.0 * u))
    y = u * u * u * (after * (1.0 + v * (3.0 + 6.0 * v)) - way * v * (1.0 + 3.0 * v))
    return x * x + y * y - 2.0 * cosine * x * y


@compiled
def measure_deviation(before: float, after: float, shape: float, cosine: float) -> float:
    """Return how far the corner is from the blend of two lines [mm].

    Args:
        before: Cut-back before the corner [mm].
        after: The one after it [mm].
        shape: See ``Blend``.
        cosine: Of the angle by which the path turns.
    """
    way = 5.0 * shape * min(before, after)
    best, least = 1, square_at(1.0 / _COARSE, before, after, way, cosine)
    for k in range(2, _COARSE):
        here = square_at(k / _COARSE, before, after, way, cosine)
        if here < least:
            best, least = k, here
    low, high = (best - 1.0) / _COARSE, (best + 1.0) / _COARSE
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a = square_at(a, before, after, way, cosine)
    at_b = square_at(b, before, after, way, cosine)
    for _ in range(_GOLDEN_STEPS):
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = square_at(a, before, after, way, cosine)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = square_at(b, before, after, way, cosine)
    return sqrt(min(at_a, at_b))
