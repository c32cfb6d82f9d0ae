"""A bound from below on how long a motion takes: toppra's optimum without any limit of jerk.

On a grid, toppra's duration is above its own limit, by an error that halves with the step. Two
grids give the error, and a half more of it is taken off than that.

toppra is asked in units in which a motion is about 1 long and takes about 1: it has tolerances of
its own, and with limits far from usual ones returns a duration that is no bound.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.motion.motion import Motion
from duoglide.motion.path.carriage import CarriagePath

GRIDS = (200, 400)  # cells between two rests
_OFF = 1.5  # times the difference of both grids, to come below the limit


def lower_bound(motion: Motion) -> float:
    """Return the least duration under velocity and acceleration limits alone: see ``Trajectory``.

    Dwells count in full. Ends in motion, as in a program, are passed at the trajectory's speed.
    """
    knots = motion.profile.knots
    still = np.diff(knots[:, 1]) == 0.0
    dwells = float(np.diff(knots[:, 0])[still].sum())
    path = motion.path
    rests = path.curve.rests if isinstance(path, CarriagePath) else ()
    last = _End(float(knots[-1, 1]), float(knots[-1, 2]))
    inner = [_End(rest, 0.0) for rest in rests if rest < last.sigma]
    spans = pairwise((_End(0.0, float(knots[0, 2])), *inner, last))
    return dwells + sum(_bound_span(motion, start, end) for start, end in spans)


class _End(NamedTuple):
    """An end of a span: sigma [mm], and d sigma/dt there [mm/s]."""

    sigma: float
    speed: float


def _bound_span(motion: Motion, start: _End, end: _End) -> float:
    """Return a bound on the duration between two ends."""
    coarse, fine = (_on_grid(motion, start, end, cells) for cells in GRIDS)
    return fine - _OFF * max(0.0, coarse - fine)


def _on_grid(motion: Motion, first: _End, last: _End, cells: int) -> float:
    """Return toppra's duration between two ends on a grid."""
    import toppra
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

    start, end = first.sigma, last.sigma
    limits, length = motion.machine.limits, end - start
    second = float(
        np.maximum(length / limits.velocity, (length / limits.acceleration) ** 0.5).max()
    )
    velocity = limits.velocity * (second / length)
    acceleration = limits.acceleration * (second * second / length)
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, cells + 1))
    path = motion.path
    breaks = path.curve.breaks if isinstance(path, CarriagePath) else np.zeros(0)
    inner = breaks[(breaks > start + 1e-6) & (breaks < end - 1e-6)] - start
    points = np.unique(np.concatenate([share, inner / length]))
    solver = toppra.algorithm.TOPPRA(
        [
            JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
            JointAccelerationConstraint(np.stack([-acceleration, acceleration], axis=1)),
        ],
        _Geometric(motion, start, length),
        gridpoints=points,
    )
    unit = second / length
    solver.compute_parameterization(first.speed * unit, last.speed * unit)
    data = solver.problem_data
    if data.return_code != toppra.algorithm.ParameterizationReturnCode.Ok or data.sd_vec is None:
        raise LimitError(f"toppra finds no bound: {data.return_code}")
    speeds: FloatArray = data.sd_vec
    return second * float(np.sum(2.0 * np.diff(points) / (speeds[1:] + speeds[:-1])))


class _Geometric:
    """The carriages between two rests, as toppra asks for a path (structurally its interface).

    Both the parameter and the carriages count in lengths of the path.
    """

    def __init__(self, motion: Motion, start: float, length: float) -> None:
        self._path = motion.path
        self._start, self._length = start, length
        self.path_interval = np.array([0.0, 1.0])
        self.duration = 1.0
        self.dof = 3
        self.waypoints = None

    def __call__(self, path_positions: FloatArray, order: int = 0) -> FloatArray:
        sigma = np.asarray(path_positions, dtype=np.float64) * self._length + self._start
        return self._path.derivatives(sigma)[..., order, :] * self._length ** (order - 1)
