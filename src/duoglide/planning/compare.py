"""Compare floats where a search decides by them, so that rounding never does.

Two candidates often are equal in truth: corners without room have the same blends whatever is asked
for, a path may be its own mirror image. Their numbers then differ by rounding, which differs from
computer to computer. So what is not clearly better is not better: the plainer candidate, which a
search names first, stays.
"""

from __future__ import annotations

from math import ceil, inf

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.planning.tolerances import ALIKE, ROUNDING


def less(one: float, other: float, within: float = 0.0) -> bool:
    """Whether ``one`` is less than ``other``, by more than rounding makes.

    Args:
        one: A number, or infinity.
        other: What it is compared with.
        within: Differences up to this are none, besides those below ``ALIKE`` times ``other``.
    """
    if other == inf:
        return one < inf
    return one < other - max(within, ALIKE * abs(other))


def first_least(values: FloatArray, axis: int = 0, within: float = 0.0) -> IndexArray:
    """Return the first index along an axis whose value is not clearly above the least one.

    Args:
        values: Without NaN; at least one along the axis.
        axis: Which.
        within: See ``less``.
    """
    least = values.min(axis=axis, keepdims=True)
    with np.errstate(invalid="ignore"):  # of infinity, which equals itself
        close = values <= least + np.maximum(within, ALIKE * np.abs(least))
    first: IndexArray = np.argmax(close | (values == least), axis=axis)
    return first


def whole(parts: float) -> int:
    """Return into how many parts to cut what holds ``parts`` of them: a whole number stays itself.

    The parts may be longer than asked for, by as little as rounding makes.
    """
    return ceil(parts - ROUNDING * max(1.0, abs(parts)))
