"""How a carriage trails what its drive is told: the model of a drive, and how it is learned.

A closed position loop that is fed a smooth setpoint r is behind it by lag * r' + bend * r'': the
first is what the speed costs (what velocity feed-forward leaves of it, and any delay on the way),
the second what the acceleration does (1 / (2 pi f)^2 for a loop of f Hz). Both are learned from
cycles, by least squares. Here they are counted in cycles, so that the stream compares increments.
"""

from __future__ import annotations

_SPREAD = 100.0  # what is usual between model and feedback [increments]
_LAG_PRIOR = (_SPREAD / 0.5) ** 2  # with lags of up to about half a cycle beyond what is known ...
_BEND_PRIOR = (_SPREAD / 2.0) ** 2  # ... and bends of about two squared cycles


def step_of(before: float, after: float) -> float:
    """Return the speed of a setpoint, from those one cycle before and after [increments/cycle]."""
    return 0.5 * (after - before)


def bend_of(before: float, here: float, after: float) -> float:
    """Return the acceleration of a setpoint, likewise [increments/cycle^2]."""
    return after - 2.0 * here + before


class TrailFit:
    """Least squares of ``off = offset - lag * step - bend * bend_of`` over cycles in motion.

    Where the cycles tell little, what is learned stays near zero: near what is known already.

    Args:
        memory: How many cycles count; older ones fade. 0: all of them.
    """

    __slots__ = ("_keep", "_n", "_r", "_ra", "_rv", "_v", "_va", "_vv", "_a", "_aa")

    def __init__(self, memory: float = 0.0) -> None:
        self._keep = 1.0 - 1.0 / memory if memory else 1.0
        self._n = self._v = self._a = self._vv = self._va = self._aa = 0.0
        self._r = self._rv = self._ra = 0.0

    @property
    def cycles(self) -> float:
        """How many cycles count."""
        return self._n

    def add(self, off: float, step: float, bend: float) -> None:
        """Take a cycle.

        Args:
            off: Actual position less where it was expected [increments].
            step: Speed of the setpoint [increments/cycle].
            bend: Its acceleration [increments/cycle^2].
        """
        keep = self._keep
        self._n = keep * self._n + 1.0
        self._v = keep * self._v + step
        self._a = keep * self._a + bend
        self._vv = keep * self._vv + step * step
        self._va = keep * self._va + step * bend
        self._aa = keep * self._aa + bend * bend
        self._r = keep * self._r + off
        self._rv = keep * self._rv + off * step
        self._ra = keep * self._ra + off * bend

    def solve(self) -> tuple[float, float, float]:
        """Return lag [cycles], bend [cycles^2] and offset [increments]; zeros where nothing came."""
        n = self._n
        if not n:
            return 0.0, 0.0, 0.0
        v, a, r = self._v / n, self._a / n, self._r / n
        vv = self._vv - v * self._v + _LAG_PRIOR
        aa = self._aa - a * self._a + _BEND_PRIOR
        va = self._va - v * self._a
        rv, ra = self._rv - r * self._v, self._ra - r * self._a
        whole = vv * aa - va * va
        lag = (ra * va - rv * aa) / whole
        bend = (rv * va - ra * vv) / whole
        return lag, bend, r + lag * v + bend * a
