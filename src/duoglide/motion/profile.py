"""Path speed: how far along its curve a motion is at every instant.

A profile is given by knots: time, path parameter sigma, and its first two derivatives. Between two
knots sigma is the one polynomial of degree 5 that meets both, so that sigma is twice continuously
differentiable by construction, and the knots alone, as float64, say everything.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import ulp
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_floats, read_only
from duoglide.errors import InputError

Polynomial: TypeAlias = tuple[float, float, float, float, float, float]

_NEWTON_STEPS = 8

TIME, SIGMA, SPEED, ACCELERATION = range(4)  # columns of the knots


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """sigma(t) through knots, in pieces of degree 5, C2.

    Attributes:
        knots: One row a knot: time [s], sigma [mm], d sigma/dt [mm/s], d2 sigma/dt2 [mm/s^2];
            shape (n + 1, 4). The first time is 0, times increase, sigma never falls.

    Raises:
        InputError: Not such an array.
    """

    knots: FloatArray
    _polynomials: FloatArray = field(init=False, repr=False)
    _times: list[float] = field(init=False, repr=False)
    _rows: list[Polynomial] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        knots = read_only(as_floats(self.knots, "knots"))
        if knots.ndim != 2 or knots.shape[1] != 4 or len(knots) < 2:
            raise InputError(f"knots must have shape (n + 1, 4) with n >= 1, got {knots.shape}")
        steps = knots[1:] - knots[:-1]
        if knots[0, TIME] != 0.0 or (steps[:, TIME] <= 0.0).any():
            raise InputError("times of knots must begin at 0 and increase")
        if (steps[:, SIGMA] < 0.0).any():
            raise InputError("sigma must not fall from knot to knot")
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            polynomials = join_states(knots)
        if not np.isfinite(polynomials).all():
            raise InputError("knots: numbers between which no motion can be reckoned")
        store = object.__setattr__
        store(self, "knots", knots)
        store(self, "_polynomials", polynomials)
        store(self, "_times", knots[:-1, TIME].tolist())
        store(self, "_rows", [tuple(row) for row in polynomials.tolist()])

    def __repr__(self) -> str:
        return f"Profile({self.duration:.4f} s, {self.end:.4g} mm, {len(self.knots)} knots)"

    @property
    def polynomials(self) -> FloatArray:
        """Coefficients of each piece in rising powers of time since its knot, (n, 6)."""
        return self._polynomials

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return float(self.knots[-1, TIME])

    @property
    def end(self) -> float:
        """Sigma at the end [mm]."""
        return float(self.knots[-1, SIGMA])

    def at(self, t: ArrayLike) -> FloatArray:
        """Return sigma and its three time derivatives, shape (..., 4); clamped to both ends.

        At a knot, where the third derivative may jump, it is the later piece's.
        """
        time = np.minimum(np.maximum(np.asarray(t, dtype=np.float64), 0.0), self.duration)
        piece = self.knots[1:-1, TIME].searchsorted(time, side="right")
        return evaluate(self._polynomials[piece], time - self.knots[piece, TIME])

    def at_time(self, t: float) -> tuple[float, float, float, float]:
        """Do what ``at`` does for one time, without numpy: for the stream's cycle."""
        t = min(max(t, 0.0), self.duration)
        piece = max(bisect_right(self._times, t) - 1, 0)
        u = t - self._times[piece]
        return quintic(self._rows[piece], u)

    def time_at(self, sigma: float) -> float:
        """Return the first time at which sigma is reached [s]; clamped to both ends."""
        column = self.knots[:, SIGMA]
        if sigma <= column[0]:
            return 0.0
        if sigma > column[-1]:
            return self.duration
        high = int(np.searchsorted(column, sigma, side="left"))
        if column[high] == sigma:
            return float(self.knots[high, TIME])
        low, top = (float(self.knots[k, TIME]) for k in (high - 1, high))
        guess = 0.5 * (low + top)
        for _ in range(_NEWTON_STEPS):
            here, speed, *_rest = self.at_time(guess)
            low, top = (guess, top) if here < sigma else (low, guess)
            ahead = guess + (sigma - here) / speed if speed > 0.0 else low
            if not low < ahead < top:
                break
            guess = ahead
        for side in (guess - 4.0 * ulp(guess), guess + 4.0 * ulp(guess)):
            if low < side < top:
                low, top = (side, top) if self.at_time(side)[0] < sigma else (low, side)
        while True:
            middle = 0.5 * (low + top)
            if not low < middle < top:
                return top
            low, top = (middle, top) if self.at_time(middle)[0] < sigma else (low, middle)

    def stretch(self, factor: float) -> Profile:
        """Return the same motion with every time multiplied by ``factor``."""
        return Profile(self.knots * np.array([factor, 1.0, 1.0 / factor, 1.0 / factor**2]))

    def until(self, knot: int) -> Profile:
        """Return the same motion up to a knot, to the last bit."""
        return Profile(self.knots[: knot + 1])

    @staticmethod
    def join(parts: Sequence[Profile]) -> Profile:
        """Return one profile after the other; each begins in the state where the last one ends."""
        rows = [parts[0].knots]
        for part in parts[1:]:
            later = part.knots[1:].copy()
            later[:, TIME] += rows[-1][-1, TIME]
            rows.append(later)
        return Profile(np.concatenate(rows))

    @staticmethod
    def rest(sigma: float, seconds: float) -> Profile:
        """Return a dwell at ``sigma``."""
        return Profile(np.array([[0.0, sigma, 0.0, 0.0], [seconds, sigma, 0.0, 0.0]]))

    @staticmethod
    def steady(duration: float) -> Profile:
        """Return the profile of a curve whose parameter is the time itself."""
        return Profile(np.array([[0.0, 0.0, 1.0, 0.0], [duration, duration, 1.0, 0.0]]))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Profile) and self.knots.tobytes() == other.knots.tobytes()

    def __hash__(self) -> int:
        return hash(self.knots.tobytes())


def join_states(knots: FloatArray) -> FloatArray:
    """Return the coefficients of each piece in rising powers of time since its knot, (n, 6)."""
    h, rise, faster, harder = (knots[1:] - knots[:-1]).T
    v0, a0 = knots[:-1, SPEED], knots[:-1, ACCELERATION]
    way = rise - h * (v0 + 0.5 * h * a0)
    speed = h * (faster - h * a0)
    rate = 0.5 * h * h * harder
    result = np.empty((h.size, 6))
    result[:, :2] = knots[:-1, SIGMA:ACCELERATION]
    result[:, 2] = 0.5 * a0
    result[:, 3] = (10.0 * way - 4.0 * speed + rate) / h**3
    result[:, 4] = (-15.0 * way + 7.0 * speed - 2.0 * rate) / h**4
    result[:, 5] = (6.0 * way - 3.0 * speed + rate) / h**5
    return result


def evaluate(polynomials: FloatArray, u: FloatArray) -> FloatArray:
    """Return polynomials (..., 6) and three derivatives at ``u`` (...), shape (..., 4)."""
    return np.stack(quintic(np.moveaxis(polynomials, -1, 0), u), axis=-1)


def quintic(c: Any, u: Any) -> tuple[Any, Any, Any, Any]:
    """Evaluate a polynomial of degree 5 and three derivatives: of floats, arrays, or compiled.

    Args:
        c: Six coefficients, in rising powers.
        u: Where.
    """
    c0, c1, c2, c3, c4, c5 = c
    return (
        c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5)))),
        c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * (5.0 * c5)))),
        2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * (20.0 * c5))),
        6.0 * c3 + u * (24.0 * c4 + u * (60.0 * c5)),
    )


def integrate_jerks(
    state: tuple[float, float, float], phases: Iterable[tuple[float, float]], end: float
) -> FloatArray:
    """Integrate phases of constant third derivative up to rest.

    Args:
        state: Sigma and its first two derivatives at the start.
        phases: Jerk [mm/s^3] and how long it lasts [s], above 0.
        end: Where it comes to rest [mm], exactly.

    Returns:
        Knots of a profile, shape (n + 1, 4).
    """
    clock = 0.0
    knots = [(clock, *state)]
    for jerk, seconds in phases:
        clock += seconds
        state = advance_state(state, jerk, seconds)
        knots.append((clock, *state))
    knots[-1] = (clock, end, 0.0, 0.0)
    return np.array(knots)


def advance_state(
    state: tuple[float, float, float], jerk: float, seconds: float
) -> tuple[float, float, float]:
    """Return position, velocity and acceleration after some time of constant jerk."""
    position, velocity, acceleration = state
    return (
        position + seconds * (velocity + seconds * (0.5 * acceleration + seconds * jerk / 6.0)),
        velocity + seconds * (acceleration + 0.5 * seconds * jerk),
        acceleration + seconds * jerk,
    )
