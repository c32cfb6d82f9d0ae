"""Cells of brakes: which instants of a plan they begin at, and how long ago, each in an interval.

A brake takes carriage i to q + G(v, t) with q and v those of the plan at the instant u at which it
begins. G is once continuously differentiable: dG/dv is how long the carriage would have moved at
its first velocity, dG/dt the velocity that is left. So a cell is a patch: the slopes by u and t
take the carriages straight to its sides, and second derivatives bound what is off these ways. While
coasting those are (d2G/dt2, d2G/dv dt, d2G/dv2) = (0, 1, 0), while braking (-+d, 1, 0), at rest
(0, 0, +-1/d), with d the deceleration. Where two carriages do the same, so that the platform goes
along the rails, the bounds of their difference are those of what they do not do together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import FloatArray
from duoglide.machine import Machine
from duoglide.planning._brake_kernel import brake_patches
from duoglide.planning._carriage_bounds import CarriageBounds
from duoglide.planning._nearby import Patch, with_pairs

IndexArray: TypeAlias = NDArray[np.intp]

_UNEVEN = 3.0  # times as far along one side of a cell as along the other: cut that one only


@dataclass(frozen=True, slots=True, eq=False)
class Brakes:
    """Brakes of all three drives at once, each by itself.

    Attributes:
        machine: Whose drives brake.
        q: Carriages when the brake begins [mm], shape (n, 3).
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
        state = bounds.trajectory.at(u)
        second, third = bounds.within(u - half, u + half)
        near = np.abs(with_pairs(state.acceleration)) + third * half[:, None]
        most = np.minimum(near, second)
        return cls(u, half, state.carriages, state.velocity, state.acceleration, most, third)

    def lasting(self, deceleration: tuple[float, float, float]) -> FloatArray:
        """Return how long it takes at most until all carriages stand [s], shape (n,)."""
        speed = np.abs(self.v) + self.most_a[:, :3] * self.half[:, None]
        times: FloatArray = (speed / np.array(deceleration)).max(axis=-1)
        return times


@dataclass(frozen=True, slots=True, eq=False)
class BrakeCells:
    """Cells of brakes: all that begin in an interval of the plan, in an interval of the brake.

    Attributes:
        bounds: Of the plan.
        columns: Intervals of the plan, m of them.
        column: Which of them each cell belongs to, shape (n,).
        coast: How long the drives go on first [s].
        t: Time since the brake began, in the middle [s].
        half: Half the length of the cell along ``t`` [s].
    """

    bounds: CarriageBounds
    columns: Columns
    column: IndexArray
    coast: FloatArray
    t: FloatArray
    half: FloatArray

    @classmethod
    def cover(cls, bounds: CarriageBounds, edges: FloatArray, phases: int) -> BrakeCells:
        """Cover the brakes that begin within ``edges`` [s], at once and one cycle late."""
        drives = bounds.trajectory.machine.drives
        columns = Columns.of(bounds, 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges))
        lasting = columns.lasting(drives.quick_stop_deceleration)
        count = len(lasting)
        column = np.repeat(np.arange(count), 2 * phases)
        coast = np.tile(np.repeat([0.0, drives.cycle], phases), count)
        half = 0.5 * (coast + lasting[column]) / phases
        t = half * (2.0 * np.tile(np.arange(phases), 2 * count) + 1.0)
        return cls(bounds, columns, column, coast, t, half)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def u(self) -> FloatArray:
        """Instants of the plan in the middle of the cells [s], shape (n,)."""
        return self.columns.u[self.column]

    def cut(self, rows: IndexArray, patch: Patch) -> BrakeCells:
        """Cut some cells into four: the longer side by four, or both sides by two.

        Args:
            rows: Which.
            patch: What ``patch`` returns.
        """
        sides = np.abs(patch.ways[rows]).max(axis=-1)
        half_u, half_t = self.columns.half[self.column[rows]], self.half[rows]
        most = self.columns.most_a[self.column[rows], :3].max(axis=-1)
        along = sides[:, 0] + 0.5 * most * half_u * half_u
        drives = self.bounds.trajectory.machine.drives
        moves = (
            self.t - self.half - self.coast
            < self.columns.lasting(drives.quick_stop_deceleration)[self.column]
        )[rows]
        bow = 0.5 * max(drives.quick_stop_deceleration) * half_t * half_t
        across = sides[:, 1] + np.where(moves, bow, 0.0)
        parts = np.where(along > _UNEVEN * across, 4, np.where(across > _UNEVEN * along, 1, 2))
        parent = np.repeat(rows, 4)
        pieces, child = np.repeat(parts, 4), np.tile(np.arange(4), len(rows))
        layers = 4 // pieces
        which_u, which_t = child // layers, child % layers
        half = self.half[parent] / layers
        t = self.t[parent] + half * (2 * which_t + 1 - layers)
        key = (self.column[parent] * 3 + pieces // 2) * 4 + which_u
        _, first, column = np.unique(key, return_index=True, return_inverse=True)
        old, cuts = self.column[parent][first], pieces[first]
        half_u = self.columns.half[old] / cuts
        u = self.columns.u[old] + half_u * (2 * which_u[first] + 1 - cuts)
        columns = Columns.of(self.bounds, u, half_u)
        return BrakeCells(self.bounds, columns, column, self.coast[parent], t, half)

    def patch(self) -> Patch:
        """Return where the carriages are in each cell."""
        columns, count = self.columns, len(self)
        middle, ways, beyond = np.empty((count, 3)), np.empty((count, 2, 3)), np.empty((count, 5))
        plan = columns.half, columns.q, columns.v, columns.a, columns.most_a, columns.most_j
        cells = self.column, self.coast, self.t, self.half
        drives = self.bounds.trajectory.machine.drives
        brake_patches(plan, cells, drives.quick_stop_deceleration, (middle, ways, beyond))
        return Patch(middle, ways, beyond)
