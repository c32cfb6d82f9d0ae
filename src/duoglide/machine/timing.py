"""Which method finds how fast to go along a path."""

from __future__ import annotations

from enum import StrEnum


class Timing(StrEnum):
    """How a path is timed; see the page on planning for which to take when.

    Attributes:
        NEAR_OPTIMAL: The quickest motion under all limits, to about 1 %.
        TOPPRA: The quickest motion under limits of velocity and acceleration, by toppra; under a
            jerk limit the retiming that begins from it.
        RUCKIG: Constant limits on each stretch of the path, by ruckig: planned in a few
            milliseconds, and a slower motion.
    """

    NEAR_OPTIMAL = "near-optimal"
    TOPPRA = "toppra"
    RUCKIG = "ruckig"
