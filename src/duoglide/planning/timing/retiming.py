"""The quickest retiming of a motion: a convex problem in the time of the motion itself.

A motion along the path is retimed by theta(t), where theta is its own time. Near a rest the motion
is sigma ~ theta^3, so that retiming it never meets the infinite slopes that path speed as a
function of sigma has there; and where the motion is the quickest, alpha = 1, beta = 0 is exact.

Velocity and acceleration limits are linear in (alpha, beta) of ``rows``. A jerk limit,

    |q' d beta/d theta + 3 q'' beta + q''' alpha| <= J / sqrt(alpha),

is made linear by the tangent of 1/sqrt(alpha) at the last alpha: an inner approximation, because
1/sqrt is convex. So each solution is feasible for the next, and the sequence only gets quicker.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.motion.profile import ACCELERATION, SIGMA, SPEED, TIME, Profile
from duoglide.planning.timing.rows import POINTS
from duoglide.planning.timing.solver import Limits, Nodes, solve
from duoglide.planning.timing.timed_curve import CellMotion, TimedCurve

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_SAME = 1e-9  # of the motion's way; a knot that much beside a break stands at it


@dataclass(frozen=True, slots=True, eq=False)
class Retiming:
    """A solution of the retiming problem.

    Attributes:
        alpha: (d theta/dt)^2 at each node, (n + 1,).
        beta: d2 theta/dt2 at each node [1/s], (n + 1,).
        converged: Whether the solver reached its tolerance.
        kept: Windows of a long one in which it did not, so that they keep what they had.
    """

    alpha: FloatArray
    beta: FloatArray
    converged: bool = True
    kept: int = 0

    def resample(self, times: FloatArray, at: FloatArray) -> Retiming:
        """Return the same retiming on another grid.

        Args:
            times: Its own nodes, (n + 1,) [s].
            at: The nodes of the other grid, from the same start to the same end [s].
        """
        cell = np.searchsorted(times, at[:-1], side="right") - 1
        delta = np.diff(times)
        u, h = (at[:-1] - times[cell]) / delta[cell], delta[cell]
        c0, c1, c2, c3 = self._cubics(delta)[:, cell]
        alpha = c0 + u * (c1 + u * (c2 + u * c3))
        beta = 0.5 * (c1 + u * (2.0 * c2 + 3.0 * u * c3)) / h
        return Retiming(np.append(alpha, self.alpha[-1]), np.append(beta, self.beta[-1]))

    def _cubics(self, delta: FloatArray) -> FloatArray:
        """Return the coefficients of alpha in powers of the share of each cell, (4, n)."""
        rise, both = self.alpha[1:] - self.alpha[:-1], 2.0 * delta
        b0, b1 = both * self.beta[:-1], both * self.beta[1:]
        result = np.empty((4, delta.size))
        result[0], result[1] = self.alpha[:-1], b0
        result[2] = 3.0 * rise - 2.0 * b0 - b1
        result[3] = b0 + b1 - 2.0 * rise
        return result

    def durations(self, delta: FloatArray) -> FloatArray:
        """Integrate 1/sqrt(alpha) over each cell."""
        c0, c1, c2, c3 = self._cubics(delta)[:, :, None]
        u = 0.5 * (1.0 + _NODES)
        alpha = c0 + u * (c1 + u * (c2 + u * c3))
        alpha = np.maximum(
            alpha, np.finfo(float).tiny
        )  # a draft may dip below: it then lasts for ever
        result: FloatArray = 0.5 * delta * ((1.0 / np.sqrt(alpha)) @ _WEIGHTS)
        return result


@dataclass(frozen=True, slots=True, eq=False)
class RetimingProblem:
    """A motion on a grid, and what its retiming may ask of the carriages.

    Attributes:
        base: The motion to improve; its knots are the grid.
        delta: Length of each cell in the time of ``base`` [s], (n,).
        speed: See ``rows.make_limit_rows``.
        acceleration: See there.
        jerk: See there.
        force: See there.
        from_rest: Whether the motion begins at rest; else it begins as ``base`` does.
    """

    base: Profile
    delta: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    force: FloatArray
    from_rest: bool = True

    @classmethod
    def on(cls, timed: TimedCurve, base: Profile) -> RetimingProblem:
        """Evaluate the limits along ``base``; none of its pieces crosses a break of the curve."""
        motion = CellMotion.of(timed, base, POINTS)
        speed = (motion.carriages[..., 0, :] ** 2).max(axis=-1)
        # cell, point, carriage, derivative; each row over the limit of its highest derivative
        terms = np.swapaxes(motion.carriages * timed.limits, -1, -2)
        acceleration = terms[..., :2] / timed.limits[1, :, None]
        if motion.caps is not None:
            speed = np.maximum(speed, motion.caps.speed**2)
            acceleration = np.concatenate([acceleration, motion.caps.rows], axis=2)
        jerk = np.ascontiguousarray(terms / timed.limits[2, :, None])
        delta = np.diff(base.knots[:, TIME])
        force = np.empty((*speed.shape, 0, 3)) if motion.forces is None else motion.forces.rows
        return cls(base, delta, speed, np.ascontiguousarray(acceleration), jerk, force)

    def uniform(self) -> Retiming:
        """Return the quickest retiming by one factor that is feasible at the nodes."""
        v = self.speed.max()
        a = np.abs(self.acceleration[..., 1]).max()
        j = np.abs(self.jerk[..., 2]).max()
        f = self.force[..., 1:].clip(0.0).sum(axis=-1).max(initial=0.0)
        count = self.delta.size + 1
        most = max(v, a, np.cbrt(j) ** 2, f, f * f)
        return Retiming(np.full(count, 1.0 / most), np.zeros(count))

    def follow(self, motion: Profile) -> Retiming:
        """Return the retiming with the speeds of a motion, where one node's jerk allows them.

        Args:
            motion: Along the same sigma, from rest to rest.
        """
        from scipy.interpolate import PchipInterpolator

        knots, own = self.base.knots, np.abs(self.jerk[..., 2])
        most = np.full(len(knots), np.inf)
        with np.errstate(divide="ignore", invalid="ignore"):
            for part, at in ((most[:-1], own[:, 0]), (most[1:], own[:, -1])):
                np.minimum(part, at.max(axis=-1) ** (-2.0 / 3.0), out=part)
            times = [motion.time_at(sigma) for sigma in knots[:, SIGMA].tolist()]
            alpha = (motion.at(times)[:, 1] / knots[:, SPEED]) ** 2
        alpha = np.fmin(alpha, most)
        # slopes with which no cubic dips between its nodes
        slopes = PchipInterpolator(knots[:, TIME], alpha).derivative()(knots[:, TIME])
        return Retiming(alpha, 0.5 * slopes)

    def improve(self, start: Retiming, rounds: int, tolerance: float) -> Retiming:
        """Return the retiming after ``rounds`` tangents, each problem solved to ``tolerance``."""
        now = start
        for _ in range(rounds):
            now = self._solve(now, tolerance)
        return now

    def settle(self, start: Retiming, rounds: int, tolerance: float) -> Retiming:
        """Return the retiming after ``rounds`` tangents and as many more as still gain much."""
        now = self.improve(start, rounds, tolerance)
        last = float(now.durations(self.delta).sum())
        for _ in range(30):  # far more than there ever are
            again = self._solve(now, tolerance)
            duration = float(again.durations(self.delta).sum())
            if not again.converged or duration >= last:
                break
            gain, now, last = last / duration - 1.0, again, duration
            if gain < 0.02:  # another tangent is not worth its time
                break
        return now

    def _solve(self, start: Retiming, tolerance: float) -> Retiming:
        limits = Limits(self.delta, self.speed, self.acceleration, self.jerk, self.force)
        found = solve(limits, Nodes(start.alpha, start.beta), tolerance, self.from_rest)
        return Retiming(*found.nodes, found.converged, found.kept)

    def tighten(self, use: FloatArray) -> RetimingProblem:
        """Return this problem with the limits lowered where a solution overshoots them.

        Args:
            use: Largest use of each limit in each cell, as ``CellMotion.uses``, (n, 3 or 4, rows).
        """
        force = self.force
        over = _at_points(np.maximum(use, 1.0))
        rows = self.acceleration.shape[2]
        acceleration = over[:, :, 1, :]
        if rows > acceleration.shape[2]:  # the tool's polygon
            tool = np.repeat(acceleration[..., 3:], rows - 3, axis=2)
            acceleration = np.concatenate([acceleration[..., :3], tool], axis=2)
        if force.size:
            force = force * np.tile(over[:, :, 3, :3], 2)[..., None]
        return replace(
            self,
            force=force,
            speed=self.speed * over[:, :, 0].max(axis=-1) ** 2,
            acceleration=self.acceleration * acceleration[..., :rows, None],
            jerk=self.jerk * over[:, :, 2, :3, None],
        )

    def profile(self, retiming: Retiming) -> Profile:
        """Return the retimed motion."""
        alpha, beta = retiming.alpha, retiming.beta
        knots = self.base.knots.copy()
        knots[:, ACCELERATION] = knots[:, ACCELERATION] * alpha + knots[:, SPEED] * beta
        knots[:, SPEED] *= np.sqrt(alpha)
        knots[1:, TIME] = np.cumsum(retiming.durations(self.delta))
        return Profile(knots)


def _at_points(over: FloatArray) -> FloatArray:
    """Spread what each cell asks for to its points; a node takes the more from its two cells.

    Args:
        over: Of each cell, (n, limits, rows).

    Returns:
        The same at the points of the cells, (n, points, limits, rows).
    """
    result = np.repeat(over[:, None], POINTS, axis=1)
    node = np.maximum(over[1:], over[:-1])
    result[1:, 0], result[:-1, -1] = node, node
    return result


def on_grid(base: Profile, times: FloatArray, breaks: FloatArray) -> Profile:
    """Return ``base`` with its knots at ``times``, and sigma exactly at the breaks among them.

    Args:
        base: A motion; its own knots with a jump of the third derivative are among ``times``.
        times: The grid [s], from 0 to the end.
        breaks: Sigma that some knot must hit exactly [mm].
    """
    knots = np.empty((times.size, 4))
    knots[:, TIME], knots[:, SIGMA:] = times, base.at(times)[:, :3]
    knots[0, SIGMA:], knots[-1, SIGMA:] = base.knots[0, SIGMA:], base.knots[-1, SIGMA:]
    near = np.searchsorted(knots[:, SIGMA], breaks)
    same = _SAME * (base.end - base.knots[0, SIGMA]) + 16.0 * np.spacing(np.abs(breaks))
    for shift in (-1, 0):
        k = np.minimum(np.maximum(near + shift, 0), len(knots) - 1)
        hit = np.abs(knots[k, SIGMA] - breaks) <= same
        knots[k[hit], SIGMA] = breaks[hit]
    return Profile(knots)
