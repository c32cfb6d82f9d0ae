"""The quickest retiming of a motion: a convex problem in the time of the motion itself.

A motion along the path is retimed by theta(t), where theta is its own time. Near a rest the motion
is sigma ~ theta^3, so that retiming it never meets the infinite slopes that path speed as a
function of sigma has there; and where the motion is already the quickest, alpha = 1 and beta = 0 are exact.

Velocity and acceleration limits are linear in (alpha, beta) of ``_retiming_rows``. A jerk limit,

    |q' d beta/d theta + 3 q'' beta + q''' alpha| <= J / sqrt(alpha),

is made linear by the tangent of 1/sqrt(alpha) at the last alpha: an inner approximation, because
1/sqrt is convex. So each solution is feasible for the next, and the sequence only gets quicker.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.motion.carriage_path import CarriagePath
from duoglide.motion.profile import ACCELERATION, SIGMA, SPEED, TIME, Profile
from duoglide.planning import _interior_point, _retiming_rows
from duoglide.planning._retiming_rows import REST
from duoglide.planning.path_terms import limit_table, motion_within

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_SHRINK = 0.95  # of the last solution, to begin the next one strictly inside


@dataclass(frozen=True, slots=True, eq=False)
class Retiming:
    """A solution of the retiming problem.

    Attributes:
        coefficients: Of alpha in B-splines on the grid, (n + 2,).
        converged: Whether the solver reached its tolerance.
    """

    coefficients: FloatArray
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class RetimingProblem:
    """A motion from rest to rest on a grid, and what its retiming may ask of the carriages.

    Attributes:
        base: The motion to improve; its knots are the grid.
        delta: Length of each cell in the time of ``base`` [s], (n,).
        speed: See ``_retiming_rows.limit_rows``.
        acceleration: See there.
        jerk: See there.
    """

    base: Profile
    delta: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    @classmethod
    def on(cls, path: CarriagePath, base: Profile) -> RetimingProblem:
        """Evaluate the limits along ``base``; none of its pieces crosses a break of the curve."""
        ends = np.swapaxes(motion_within(path, base, 2), -1, -2)  # cell, end, carriage, derivative
        velocity, acceleration, jerk = limit_table(path.machine.limits)[:, :, None]
        nodes = np.concatenate([ends[:, 0], ends[-1:, 1]])
        return cls(
            base=base,
            delta=np.diff(base.knots[:, TIME]),
            speed=((nodes[..., :1] / velocity) ** 2).max(axis=(-1, -2)),
            acceleration=nodes[..., :2] / acceleration,
            jerk=ends / jerk,
        )

    def uniform(self) -> Retiming:
        """Return the quickest retiming by one factor that is feasible at the nodes."""
        v = self.speed.max()
        a = np.abs(self.acceleration[..., 1]).max()
        j = np.abs(self.jerk[..., 2]).max()
        alpha = 1.0 / max(v, a, np.cbrt(j) ** 2)
        return Retiming(np.full(self.delta.size + 2, alpha), converged=True)

    def improved(self, start: Retiming, rounds: int, tolerance: float) -> Retiming:
        """Return the retiming after ``rounds`` tangents, each problem solved to ``tolerance``."""
        count = self.delta.size + 2
        first, points, weights = _retiming_rows.duration_points(self.delta)
        _retiming_rows.tie(first, points, count, REST, REST)
        now = start
        for _ in range(rounds):
            tangent, _beta = _retiming_rows.nodes_of(self.delta, now.coefficients)
            row_first, rows, bounds = _retiming_rows.limit_rows(
                self.delta, self.speed, self.acceleration, self.jerk, tangent
            )
            _retiming_rows.tie(row_first, rows, count, REST, REST)
            x = _SHRINK * now.coefficients[REST : count - REST]
            converged = _interior_point.solve(
                row_first, rows, bounds, first, points, weights, x, 0, tolerance
            )[1]
            now = Retiming(np.pad(x, REST, mode="edge"), bool(converged))
        return now

    def tightened(self, use: FloatArray) -> RetimingProblem:
        """Return this problem with the limits lowered where a solution overshoots them.

        Args:
            use: Largest absolute derivative over its limit in each cell, (n, 3, 3), carriages last.
        """
        over = np.maximum(use, 1.0)
        beside = np.maximum(over[1:], over[:-1])
        nodes = np.concatenate([over[:1], beside, over[-1:]])
        return replace(
            self,
            speed=self.speed * nodes[:, 0].max(axis=-1) ** 2,
            acceleration=self.acceleration * nodes[:, 1, :, None],
            jerk=self.jerk * over[:, None, 2, :, None],
        )

    def profile(self, retiming: Retiming) -> Profile:
        """Return the retimed motion."""
        alpha, beta = _retiming_rows.nodes_of(self.delta, retiming.coefficients)
        knots = self.base.knots.copy()
        knots[:, ACCELERATION] = knots[:, ACCELERATION] * alpha + knots[:, SPEED] * beta
        knots[:, SPEED] *= np.sqrt(alpha)
        knots[1:, TIME] = np.cumsum(self._durations(alpha, beta))
        return Profile(knots)

    def _durations(self, alpha: FloatArray, beta: FloatArray) -> FloatArray:
        """Integrate 1/sqrt(alpha) over each cell."""
        slope = np.diff(beta) / self.delta
        u = 0.5 * self.delta[:, None] * (1.0 + _NODES)
        inside = alpha[:-1, None] + u * (2.0 * beta[:-1, None] + u * slope[:, None])
        result: FloatArray = 0.5 * self.delta * (inside**-0.5 @ _WEIGHTS)
        return result


def on_grid(base: Profile, times: FloatArray, breaks: FloatArray) -> Profile:
    """Return ``base`` with its knots at ``times``, and sigma exactly at the breaks among them.

    Args:
        base: A motion; its own knots with a jump of the third derivative are among ``times``.
        times: The grid [s], from 0 to the end.
        breaks: Sigma that some knot must hit exactly [mm].
    """
    knots = np.column_stack([times, base.at(times)[:, :3]])
    knots[0, SIGMA:], knots[-1, SIGMA:] = base.knots[0, SIGMA:], base.knots[-1, SIGMA:]
    near = np.searchsorted(knots[:, SIGMA], breaks)
    for shift in (-1, 0):
        k = np.clip(near + shift, 0, len(knots) - 1)
        hit = np.abs(knots[k, SIGMA] - breaks) <= 1e-9 * (1.0 + np.abs(breaks))
        knots[k[hit], SIGMA] = breaks[hit]
    return Profile(knots)
