"""Cells of drive stops: which instant of a plan they begin at, how late, and how long ago.

A drive that stops by itself takes carriage i to q + v c + G(v, t): q and v are those of the plan at
the instant u of the last setpoint, c is how long the drive has gone on then, t how long it has
braked since. G is once continuously differentiable: dG/dv is how long the carriage would have moved
at v, dG/dt the velocity that is left. So a cell is a patch: the slopes by u, c and t take the
carriages straight to its sides, and second derivatives bound what is off these ways. While braking
those of G are (d2G/dt2, d2G/dv dt, d2G/dv2) = (-+d, 1, 0), at rest (0, 0, +-1/d), with d the
deceleration. Where two carriages do the same, so that the platform goes along the rails, the bounds
of their difference are those of what they do not do together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.kinematics.headroom.nearby import Patch, with_pairs
from duoglide.machine import Machine
from duoglide.planning.braking.carriage_bounds import CarriageBounds
from duoglide.planning.braking.kernel import brake_patches

IndexArray: TypeAlias = NDArray[np.intp]

_SHORTEST = 1e-9  # s of the plan: nothing shorter is cut to get bounds
PARTS = 4  # into which a cell is cut
_CURVED = 100.0  # mm: radius to which ways of the carriages bend those of the platform, about


@dataclass(frozen=True, slots=True, eq=False)
class DriveStops:
    """Stops of all three drives at once, each by itself.

    Attributes:
        machine: Whose drives brake.
        q: Carriages when the stop begins [mm], shape (n, 3).
        v: Their velocities then [mm/s], shape (n, 3).
        coast: How long they go on at these velocities first [s], shape (n,).
    """

    machine: Machine
    q: FloatArray
    v: FloatArray
    coast: FloatArray

    @property
    def slowing(self) -> FloatArray:
        """How long each carriage takes to stop, (n, 3)."""
        deceleration = np.array(self.machine.drives.quick_stop_deceleration, dtype=np.float64)
        times: FloatArray = np.abs(self.v) / deceleration
        return times

    @property
    def lasting(self) -> FloatArray:
        """How long it takes until all stand, (n,)."""
        times: FloatArray = self.coast + self.slowing.max(axis=-1)
        return times

    def at(self, fraction: FloatArray) -> FloatArray:
        """Return carriages after fractions (n,) of the time until all stand, shape (n, 3)."""
        tau, coast = (fraction * self.lasting)[:, None], self.coast[:, None]
        slowing = self.slowing
        braked = np.clip(tau - coast, 0.0, slowing)
        share = np.divide(braked, slowing, out=np.zeros_like(slowing), where=slowing > 0.0)
        return self.q + self.v * (np.minimum(tau, coast) + braked * (1.0 - 0.5 * share))


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Intervals of a plan.

    Attributes:
        u: Instants in the middle [s], shape (n,).
        half: Half the length of each [s].
        q: Carriages in the middle [mm], shape (n, 3).
        v: Their velocities [mm/s].
        a: Their accelerations [mm/s^2].
        most_a: Bounds on the accelerations of carriages 1 to 3, B and D in the whole interval,
            shape (n, 5).
        most_j: Bounds on the third derivatives [mm/s^3].
    """

    u: FloatArray
    half: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    most_a: FloatArray
    most_j: FloatArray

    @classmethod
    def of(cls, bounds: CarriageBounds, u: FloatArray, half: FloatArray) -> Columns:
        """Evaluate the plan in the middle of intervals, and bound it in the whole of them."""
        state = bounds.motion.at(u)
        second, third = bounds.within(u - half, u + half)
        near = np.abs(with_pairs(state.acceleration)) + third * half[:, None]
        most = np.minimum(near, second)
        return cls(u, half, state.carriages, state.velocity, state.acceleration, most, third)

    @classmethod
    def between(cls, bounds: CarriageBounds, edges: FloatArray) -> Columns:
        """Evaluate the parts of a plan between edges [s], cut until all of them have bounds."""
        while True:
            columns = cls.of(bounds, 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges))
            unknown = ~np.isfinite(columns.most_a).all(axis=-1) & (columns.half > _SHORTEST)
            if not unknown.any():
                return columns
            edges = np.sort(np.concatenate([edges, columns.u[unknown]]))

    def lasting(self, deceleration: tuple[float, float, float]) -> FloatArray:
        """Return how long it takes at most until all carriages stand [s], shape (n,)."""
        speed = np.abs(self.v) + self.most_a[:, :3] * self.half[:, None]
        times: FloatArray = (speed / np.array(deceleration)).max(axis=-1)
        return times


@dataclass(frozen=True, slots=True, eq=False)
class BrakeCells:
    """Cells of drive stops: an interval of the plan, one of the time until all brake, one since.

    The last two are never both longer than nothing.

    Attributes:
        bounds: Of the plan.
        columns: Intervals of the plan, m of them.
        column: Which of them each cell belongs to, shape (n,).
        middle: How long the drives have gone on at their first velocity, and how long they have
            braked then, in the middle [s], shape (n, 2).
        half: Half the lengths of these intervals [s], shape (n, 2).
    """

    bounds: CarriageBounds
    columns: Columns
    column: IndexArray
    middle: FloatArray
    half: FloatArray

    @classmethod
    def cover(cls, bounds: CarriageBounds, edges: FloatArray, phases: int) -> BrakeCells:
        """Cover the stops out of ``edges`` [s]: at once, one cycle late, and that cycle."""
        drives = bounds.motion.machine.drives
        columns = Columns.between(bounds, edges)
        lasting = columns.lasting(drives.quick_stop_deceleration)
        column = np.repeat(np.arange(len(lasting)), 2 * phases + 1)
        middle, half = np.zeros((2, len(lasting), 2 * phases + 1, 2))
        middle[:, phases:-1, 0] = drives.cycle
        middle[:, -1, 0] = half[:, -1, 0] = 0.5 * drives.cycle
        half[:, :-1, 1] = 0.5 * lasting[:, None] / phases
        middle[:, :-1, 1] = half[:, :-1, 1] * np.tile(2.0 * np.arange(phases) + 1.0, 2)
        return cls(bounds, columns, column, middle.reshape(-1, 2), half.reshape(-1, 2))

    def __len__(self) -> int:
        return len(self.column)

    @property
    def times(self) -> FloatArray:
        """The middles [s]: of the plan, of going on, and of braking, shape (n, 3)."""
        return np.column_stack([self.columns.u[self.column], self.middle])

    @property
    def sides(self) -> FloatArray:
        """Half the lengths of the same intervals [s], shape (n, 3)."""
        return np.column_stack([self.columns.half[self.column], self.half])

    def within(self, times: FloatArray) -> FloatArray:
        """Return the nearest times that there are: within the plan, and one cycle; (n, 3)."""
        motion = self.bounds.motion
        most = np.array([motion.duration, motion.machine.drives.cycle, np.inf])
        return np.clip(times, 0.0, most)

    def carriages_at(self, times: FloatArray) -> FloatArray:
        """Return the carriages of single stops, times and places of shape (n, 3)."""
        motion, (u, coast, t) = self.bounds.motion, times.T
        state = motion.at(u)
        stops = DriveStops(motion.machine, state.carriages, state.velocity, coast)
        lasting = stops.lasting
        share = np.divide(coast + t, lasting, out=np.zeros_like(t), where=lasting > 0.0)
        return stops.at(np.minimum(share, 1.0))

    def cut(self, rows: IndexArray, patch: Patch) -> BrakeCells:
        """Cut some cells, each along the sides that bend most.

        Args:
            rows: Which.
            patch: What ``patch`` returns.
        """
        parts = _parts(self._sides(rows, patch))
        parent, parts = np.repeat(rows, PARTS), np.repeat(parts, PARTS, axis=0)
        child = np.tile(np.arange(PARTS), len(rows))
        along = child // (parts[:, 1] * parts[:, 2])
        inner = np.column_stack([child // parts[:, 2] % parts[:, 1], child % parts[:, 2]])
        half = self.half[parent] / parts[:, 1:]
        middle = self.middle[parent] + half * (2 * inner + 1 - parts[:, 1:])
        key = (self.column[parent] * (PARTS + 1) + parts[:, 0]) * PARTS + along
        _, first, column = np.unique(key, return_index=True, return_inverse=True)
        old, pieces = self.column[parent[first]], parts[first, 0]
        half_u = self.columns.half[old] / pieces
        u = self.columns.u[old] + half_u * (2 * along[first] + 1 - pieces)
        return BrakeCells(self.bounds, Columns.of(self.bounds, u, half_u), column, middle, half)

    def _sides(self, rows: IndexArray, patch: Patch) -> FloatArray:
        """Return about how far off its slopes each side of some cells is [mm], (n, 3)."""
        column, drives = self.column[rows], self.bounds.motion.machine.drives
        half_u, half_t = self.columns.half[column], self.half[rows, 1]
        lasting = self.columns.lasting(drives.quick_stop_deceleration)[column]
        slowest = 0.5 * max(drives.quick_stop_deceleration) * half_t * half_t
        ways = np.abs(patch.ways[rows]).max(axis=-1)
        sides: FloatArray = ways * ways / _CURVED
        sides[:, 0] += self.columns.most_a[column, :3].max(axis=-1) * half_u * half_u
        sides[:, 2] += np.where(self.middle[rows, 1] - half_t < lasting, slowest, 0.0)
        return sides

    def patch(self) -> Patch:
        """Return where the carriages are in each cell."""
        columns, count = self.columns, len(self)
        middle, ways, beyond = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 5))
        plan = columns.half, columns.q, columns.v, columns.a, columns.most_a, columns.most_j
        deceleration = self.bounds.motion.machine.drives.quick_stop_deceleration
        cells = self.column, self.middle, self.half
        brake_patches(plan, cells, deceleration, (middle, ways, beyond))
        return Patch(middle, ways, beyond)


def _parts(sides: FloatArray) -> IndexArray:
    """Return into how many parts to cut each side (n, 3): ``PARTS`` in all."""
    parts, bent = np.ones(sides.shape, dtype=np.intp), sides.copy()
    rows = np.arange(len(sides))
    for _ in range(PARTS.bit_length() - 1):
        longest = bent.argmax(axis=1)
        parts[rows, longest] *= 2
        bent[rows, longest] *= 0.25
    return parts
