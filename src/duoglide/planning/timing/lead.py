"""Time a span that begins in motion: where the last trajectory of a program hands over.

The state in which the span begins is given, so that nothing may be slowed as a whole at the end.
So the limits are lowered a little beforehand, by what a timing may be off between its knots; and
the way to rest that the last trajectory has from there shows the solver where to look. That way
keeps one per cent of every limit in reserve (``TimedCurve.ahead``): where a motion slows down with
all it has, the smallest change of its knots would leave no way at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.motion.path.rounded import SpeedCap
from duoglide.motion.profile import ACCELERATION, SIGMA, SPEED, TIME, Profile
from duoglide.planning.timing.ask_ruckig import End, Start, ask_ruckig
from duoglide.planning.timing.retiming import Retiming, RetimingProblem
from duoglide.planning.timing.timed_curve import SigmaCap, TimedCurve
from duoglide.planning.tolerances import ALIKE, ROUNDING

ALLOWED = 1.5e-3  # A timing may exceed the lowered velocity limits by this share.


class _Leading(NamedTuple):
    """How a motion that is under way already is led on, and on to rest.

    Attributes:
        early: Cells in which half of ``ALLOWED`` is granted, as what comes before may have
            used it.
        spare: Times the acceleration at the start, and times what it still adds to the
            speed.
        tries: Each with twice the acceleration of the last one.
        softer: Share of its jerk that the last phase of a way to rest takes.
        looks: Samples of a way to rest.
        close: Share of a cell; knots nearer together are thinned out.
    """

    early: int = 3
    spare: float = 1.05
    tries: int = 12
    softer: float = 0.8
    looks: int = 401
    close: float = 0.4


_LEAD = _Leading()


@dataclass(frozen=True, slots=True, eq=False)
class Lead:
    """How a timing begins, in a program that goes on.

    Attributes:
        way: A way to rest that is known, from the state in which the timing begins, sigma from 0;
            None: the timing begins at rest.
        ahead: From where on the timing is only a way to rest, and keeps a reserve of every limit
            [mm].
    """

    way: Profile | None = None
    ahead: float = inf

    @property
    def speed(self) -> float:
        """D sigma/dt at the start [mm/s]."""
        return 0.0 if self.way is None else float(self.way.knots[0, SPEED])

    @property
    def acceleration(self) -> float:
        """d2 sigma/dt2 at the start [mm/s^2]."""
        return 0.0 if self.way is None else float(self.way.knots[0, ACCELERATION])

    def lift(self, cap: SigmaCap) -> SigmaCap:
        """Return a cap that the known way to rest keeps."""
        if self.way is None:
            return cap
        _, motion = self._samples(self.way)
        known = np.interp(cap.sigma, motion[:, 0], motion[:, 1] * (1.0 + ALIKE), right=0.0)
        return SigmaCap(cap.sigma, np.maximum(cap.speed, known))

    def find_known_part(self, problem: RetimingProblem) -> Profile:
        """Return the known way until it is as slow as no limit minds anywhere."""
        _, base = self._samples(problem.base)
        return self._level_off(base[:, 0], np.sqrt(problem.uniform().alpha[0]) * base[:, 1])

    def _level_off(self, sigma: FloatArray, slow: FloatArray) -> Profile:
        """Return the known way, with its last deceleration ended early: at the speeds ``slow``."""
        assert self.way is not None
        times, motion = self._samples(self.way)
        s, v, a = motion[:, :3].T
        last = -1 - _LEAD.looks // 50
        jerk = (
            _LEAD.softer * a[last] ** 2 / (2.0 * v[last])
        )  # of the last phase, where v = a^2 / 2 j
        jerk = max(jerk, v[last] / self.way.duration**2)
        low = (a < 0.0) & (v - a * a / (2.0 * jerk) <= np.interp(s, sigma, slow))
        k = int(np.argmax(low)) if low.any() else last
        begin, (s0, v0, a0, _) = float(times[k]), motion[k].tolist()
        h = min(abs(a0) / jerk, v0 / max(abs(a0), 1e-300))  # at the latest at half the speed
        h = max(h, ROUNDING * self.way.duration)
        end = (begin + h, s0 + h * (v0 + h * a0 / 3.0), v0 + 0.5 * h * a0, 0.0)
        kept = self.way.knots[self.way.knots[:, TIME] < begin]
        return Profile(np.array([*kept, (begin, s0, v0, a0), end]))

    @staticmethod
    def _samples(way: Profile) -> tuple[FloatArray, FloatArray]:
        times = np.linspace(0.0, way.duration, _LEAD.looks)
        return times, way.at(times)

    def grant(self, problem: RetimingProblem) -> RetimingProblem:
        """Return a problem that begins in motion, with a little more speed allowed early on."""
        speed = problem.speed.copy()
        speed[: _LEAD.early] /= (1.0 + 0.5 * ALLOWED) ** 2
        return replace(problem, speed=speed, from_rest=False)

    def find_first_motion(self, start: float, end: float, bounds: tuple[float, ...]) -> Profile:
        """Return a motion from this state to rest that never turns back.

        Args:
            start: Sigma at the start [mm].
            end: Where to come to rest [mm].
            bounds: Of the three derivatives of sigma, about; exceeded where there is need.

        Raises:
            LimitError: There is none.
        """
        length = end - start
        speed = max(bounds[0], self.speed)
        rate = max(bounds[1], _LEAD.spare * abs(self.acceleration), self.speed**2 / length)
        third = max(bounds[2], 2.0 * self.acceleration**2 / self.speed, rate**2 / speed)
        for _ in range(_LEAD.tries):
            more = _LEAD.spare * max(self.acceleration, 0.0) ** 2 / (2.0 * third)
            begin = Start(start, self.speed, self.acceleration)
            found = ask_ruckig(begin, End(end), (max(speed, self.speed + more), rate, third))
            if found is not None:
                return found
            rate, third = 2.0 * rate, 4.0 * third
        raise LimitError(
            f"no motion from {self.speed:g} mm/s to rest within {length:g} mm that does not turn"
        )


def continue_known(known: Profile, problem: RetimingProblem) -> Retiming:
    """Return the retiming that makes the base of a problem ``known``, and goes on as slowly."""
    knots = problem.base.knots[:-1]
    sigma, speed, rate = knots[:, SIGMA], knots[:, SPEED], knots[:, ACCELERATION]
    last = problem.base.at_time(problem.base.time_at(known.end))[1]
    share = float(known.knots[-1, SPEED]) / last if last > 0.0 else 1.0
    motion = known.at([known.time_at(at) for at in sigma.tolist()])
    on = sigma <= known.end
    alpha = np.where(on, motion[:, 1] / speed, share) ** 2
    beta = np.where(on, (motion[:, 2] - rate * alpha) / speed, 0.0)
    alpha[0], beta[0] = 1.0, 0.0
    return Retiming(np.append(alpha, alpha[-1]), np.append(beta, 0.0))


def thin(known: Profile, breaks: FloatArray, cells: int) -> FloatArray:
    """Return the knots of a profile that stand close neither together nor to a break, (n, 4).

    Args:
        known: The profile.
        breaks: Sigma where there are knots anyway, the start among them [mm].
        cells: How many cells there are to be, about.
    """
    least = _LEAD.close * known.duration / cells
    taken = np.array([known.time_at(sigma) for sigma in breaks[breaks <= known.end].tolist()])
    kept: list[FloatArray] = []
    before = 0.0
    for knot in known.knots[1:-2]:
        if knot[TIME] - before > least and np.abs(knot[TIME] - taken).min() > least:
            kept.append(knot)
            before = knot[TIME]
    return np.array([*kept, *known.knots[-2:]])  # between the last two it levels out


def lower_limits(timed: TimedCurve, ahead: float) -> TimedCurve:
    """Return what is to be timed with every limit and cap lowered, as if time went slower.

    Args:
        timed: What is to be timed.
        ahead: From where on there is to be a reserve beside that [mm].
    """
    share = 1.0 / (1.0 + ALLOWED)
    limits = timed.machine.limits
    lower = replace(
        limits,
        force=limits.force * share**2,
        velocity=limits.velocity * share,
        acceleration=limits.acceleration * share**2,
        jerk=limits.jerk * share**3,
    )
    caps = tuple(SpeedCap(cap.start, cap.end, cap.speed * share) for cap in timed.speed_caps)
    tool = timed.tool_acceleration
    return replace(
        timed,
        machine=replace(timed.machine, limits=lower),
        speed_caps=caps,
        tool_acceleration=None if tool is None else tool * share**2,
        ahead=ahead,
    )
