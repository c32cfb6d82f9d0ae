"""A drive that brakes by itself: where it is, and where it will be when the next setpoint acts.

Its deceleration is known, and the cycle in which it began to brake; the instant within that cycle
is not. What its feedback says of both is weighed as a Kalman filter does. Places are those of its
demand: the lag of its carriage is taken off, because the others trail their setpoints alike.
"""

from __future__ import annotations

from typing import NamedTuple

_SINCE = 0.5  # cycles since it began, at the end of the cycle in which it did: anything up to 1
_SPREAD = 0.29  # standard deviation of that
_FEEDBACK = 0.05  # [mm] by which a place may be wrong once the carriage has settled ...
_TRANSIENT = 0.3  # ... and share of what its acceleration costs, before that
_SETTLING = 4  # cycles that this takes
_LAST_OFF = 0.1  # share of its deceleration that may be wrong
_CREDIBLE = 5.0  # standard deviations, with a reserve of ...
_RESERVE = 0.5  # ... [mm], beyond which a place is not one of a drive that brakes


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

    def pass_cycle(self) -> None:
        """Let a cycle pass."""
        self.place, self.velocity = self.after(1)
        self._age += 1
        off = (_LAST_OFF * self._d) ** 2
        self._pp += 2.0 * self._pv + self._vv + 0.25 * off
        self._pv += self._vv + 0.5 * off
        self._vv += off

    def after(self, cycles: int) -> tuple[float, float]:
        """Return place and velocity so many cycles later."""
        v, d = self.velocity, self._d
        t = min(float(cycles), abs(v) / d)
        back = _signed(d, v)
        later = v - back * t if t == cycles else 0.0
        return self.place + v * t - 0.5 * back * t * t, later

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


def _signed(amount: float, like: float) -> float:
    return amount if like > 0.0 else -amount
