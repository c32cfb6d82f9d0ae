"""A drive that brakes by itself: where it is, and where it will be when the next setpoint acts.

Its deceleration is known, and the cycle in which it began to brake; the instant within that cycle
is not. What its feedback says of both is weighed as a Kalman filter does. Places are those of its
demand: the lag of its carriage is taken off, because the others trail their setpoints alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

_SINCE = 0.5  # cycles since it began, at the end of the cycle in which it did: anything up to 1
_SPREAD = 0.29  # standard deviation of that
_FEEDBACK = 0.05  # [mm] by which a place may be wrong once the carriage has settled ...
_TRANSIENT = 0.3  # ... and share of what its acceleration costs, before that
_SETTLING = 4  # cycles that this takes
_LAST_OFF = 0.1  # share of its deceleration that may be wrong
_CREDIBLE = 5.0  # standard deviations, with a reserve of ...
_RESERVE = 0.5  # ... [mm], beyond which a place is not one of a drive that brakes
_FEWEST, _LIKE = 3, 0.6  # places, and [mm] by which each may be off, that show that one brakes
_HARDER = (1.0, 4.0, 16.0, 1e3)  # times its deceleration: one whose carriage is held stands at once
_LONGEST_AGO = 10  # cycles ago that it may have heard its last setpoint ...
_COASTS = (0.0, 0.5, 1.0, 2.0)  # ... and cycles for which it may then have gone on


class Trailing(NamedTuple):
    """How a carriage trails its demand.

    Attributes:
        lag: Cycles of velocity.
        bend: Squared cycles of acceleration.
    """

    lag: float
    bend: float


class BrakingDrive:
    """Place and velocity of a drive's demand since it began to brake [mm, mm/cycle].

    Args:
        place: Where its demand would be at the end of the cycle in which it began [mm].
        velocity: Of its demand, in that cycle [mm/cycle].
        deceleration: What it brakes with [mm/cycle^2].
        trailing: Of its carriage.
    """

    __slots__ = ("_age", "_d", "_pp", "_pv", "_trailing", "_vv", "place", "velocity")

    def __init__(
        self, place: float, velocity: float, deceleration: float, trailing: Trailing
    ) -> None:
        self._d, self._trailing, self._age = deceleration, trailing, 0
        back = _signed(deceleration, velocity)
        self.place, self.velocity = place - 0.5 * _SINCE**2 * back, velocity - _SINCE * back
        self._vv = (_SPREAD * deceleration) ** 2
        self._pv, self._pp = _SINCE * self._vv, _SINCE**2 * self._vv
        if abs(velocity) <= deceleration:  # it has come to rest within a cycle
            rest = 0.5 * velocity * abs(velocity) / deceleration
            self.place, self.velocity = place - 0.5 * velocity + rest, 0.0
            self._pp, self._pv, self._vv = velocity * velocity / 12.0, 0.0, 0.0

    @property
    def stands(self) -> bool:
        """Whether it has come to rest."""
        return self.velocity == 0.0

    @property
    def is_slow(self) -> bool:
        """Whether it comes to rest within two cycles."""
        return abs(self.velocity) <= 2.0 * self._d

    def rest(self) -> None:
        """Take it that it has come to rest; where, its feedback says."""
        self.velocity, self._pv, self._vv = 0.0, 0.0, 0.0
        self._pp += (2.0 * self._d) ** 2

    @classmethod
    def recognise(
        cls,
        due: Sequence[float],
        places: Sequence[float],
        deceleration: float,
        trailing: Trailing,
    ) -> BrakingDrive | None:
        """Return the drive that has left its setpoints and brakes or stands; None for others.

        One that hears no setpoints any more, and has not said so yet, goes on for a while and then
        brakes. When it began is found out by trying. One whose carriage is held brakes harder.

        Args:
            due: Setpoints of the newest cycles, the newest last [mm].
            places: Where its carriage was [mm].
            deceleration: What it brakes with [mm/cycle^2].
            trailing: Of its carriage.
        """
        last = len(due) - 1
        best, found = _LIKE, None
        starts = range(max(1, last - _LONGEST_AGO), last - _FEWEST + 1)
        for harder, k, coast in product(_HARDER, starts, _COASTS):
            velocity, since = due[k] - due[k - 1], k + coast
            begin, d = due[k] + velocity * coast, deceleration * harder
            worst = 0.0
            for j in range(last, last - _FEWEST, -1):
                place, speed = _brake(begin, velocity, d, j - since)
                worst = max(worst, abs(place - trailing.lag * speed - places[j]))
                if worst >= best:
                    break
            else:
                best, found = worst, (d, *_brake(begin, velocity, d, last - since))
        if found is None:
            return None
        d, place, velocity = found
        drive = cls(place, 0.0, d if velocity else deceleration, trailing)
        drive.velocity, drive._age = velocity, _SETTLING
        drive._pp, drive._vv = _LIKE**2, (_SPREAD * d) ** 2 if velocity else 0.0
        return drive

    def pass_cycle(self) -> None:
        """Let a cycle pass."""
        self.place, self.velocity = self.after(1)
        self._age += 1
        off = (_LAST_OFF * self._d) ** 2
        self._pp += 2.0 * self._pv + self._vv + 0.25 * off
        self._pv += self._vv + 0.5 * off
        self._vv += off

    def after(self, cycles: float) -> tuple[float, float]:
        """Return place and velocity so many cycles later."""
        return _brake(self.place, self.velocity, self._d, cycles)

    def see(self, actual: float) -> bool:
        """Weigh in where its carriage is now [mm]; whether that is credible."""
        lag, bend = self._trailing
        settled = min(self._age / _SETTLING, 1.0)
        slowing = 0.0 if self.stands else _signed(self._d, self.velocity)
        measured = actual + lag * self.velocity - bend * slowing * settled
        off = measured - self.place
        noise = _FEEDBACK + _TRANSIENT * bend * self._d * (1.0 if settled < 1.0 else 0.2)
        spread = self._pp + noise * noise
        if abs(off) > _CREDIBLE * spread**0.5 + _RESERVE:
            return False
        gain, other = self._pp / spread, self._pv / spread
        self.place += gain * off
        if not self.stands:
            self.velocity += other * off
        self._vv -= other * self._pv
        self._pv *= 1.0 - gain
        self._pp *= 1.0 - gain
        return True


def _brake(place: float, velocity: float, deceleration: float, t: float) -> tuple[float, float]:
    """Return place and velocity ``t`` cycles after it has begun to brake."""
    lasting = min(max(t, 0.0), abs(velocity) / deceleration)
    back = _signed(deceleration, velocity)
    later = velocity - back * lasting if lasting >= t else 0.0
    return place + velocity * min(t, lasting) - 0.5 * back * lasting * lasting, later


def _signed(amount: float, like: float) -> float:
    return amount if like > 0.0 else -amount
