"""A first motion along a curve: rest to rest in seven phases of constant third derivative.

Why not toppra's motion, which is closer to the optimum? Its acceleration jumps at rest, which no
retiming takes away: it must be smoothed first, and is then slower to begin from. Measured in
``tests/benchmarks/planner.py``: the motions come out some 0.5 % longer, after 1.4 times the time.
toppra gives the bound from below (``motion/lower_bound.py``).
"""

from __future__ import annotations

from math import cbrt, sqrt

import numpy as np

from duoglide.motion.profile import SIGMA, Profile, integrate_jerks


def plan_seven_phases(start: float, end: float, bounds: tuple[float, float, float]) -> Profile:
    """Return the quickest motion from rest to rest under constant bounds.

    Args:
        start: Where it begins [mm].
        end: Where it ends, further on [mm].
        bounds: Of the three derivatives of sigma [mm/s, mm/s^2, mm/s^3].
    """
    speed, acceleration, jerk = bounds
    length = end - start
    full = acceleration / jerk
    ramp = min(full, sqrt(speed / jerk), cbrt(length / (2.0 * jerk)))
    top = min(acceleration, jerk * ramp)
    # The longest plateau of acceleration that neither speed nor length forbids.
    by_speed = speed / top - ramp
    by_length = 0.5 * (sqrt(ramp * ramp + 4.0 * length / top) - 3.0 * ramp)
    plateau = max(0.0, min(by_speed, by_length)) if ramp == full else 0.0
    reached = top * (ramp + plateau)
    cruise = max(0.0, length / reached - (2.0 * ramp + plateau))
    third = (jerk, 0.0, -jerk, 0.0, -jerk, 0.0, jerk)
    lasts = (ramp, plateau, ramp, cruise, ramp, plateau, ramp)
    shortest = 1e-9 * sum(lasts)
    phases = [(j, h) for j, h in zip(third, lasts, strict=True) if h > shortest]
    knots = integrate_jerks((start, 0.0, 0.0), phases, end)
    knots[:, SIGMA] = np.minimum(knots[:, SIGMA], end)  # rounding takes no knot beyond it
    return Profile(knots)
