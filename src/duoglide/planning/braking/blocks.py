"""Parts of a plan, and where the carriages may be when drives begin to stop in one of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from duoglide.arrays import BoolArray, FloatArray, IndexArray
from duoglide.machine import Machine
from duoglide.planning.braking.carriage_bounds import CarriageBounds
from duoglide.planning.braking.kernel import PARTS, spread


class _Cells(NamedTuple):
    """How finely a plan is cut into cells, and the plane of D into columns.

    Attributes:
        column: Width of a column of D, as a share of a leg's length.
        finest: Shortest cell, as a share of the reaction time.
        usual: Cell to begin with where the plan is fast, as a share of the reaction time.
        passed: Columns that a carriage may pass in one cell, to begin with.
        still: Columns: cells in which no carriage goes farther are not cut.
        halvings: By which cells of slow parts are longer than that, at most, in a short
            plan.
        tiles: Parts of a long plan whose cells are equally long, about.
    """

    column: float = 1.0 / 80.0
    finest: float = 1.0 / 16.0
    usual: float = 1.0 / 8.0
    passed: float = 1.0
    still: float = 0.0005
    halvings: int = 6
    tiles: int = 1000


_CELLS = _Cells()


class Brakes(NamedTuple):
    """When and how the drives of a machine may stop by themselves.

    Attributes:
        reaction: From the first drive that stops to the last one [s].
        coast: For how long a drive goes on at its last velocity where setpoints fail to come [s].
        decelerations: Least and largest of each drive [mm/s^2], shape (3, 2).
    """

    reaction: float
    coast: float
    decelerations: FloatArray

    @classmethod
    def of(cls, machine: Machine) -> Brakes:
        """Read them off the machine."""
        drives = machine.drives
        nominal = np.array(drives.quick_stop_deceleration)
        off = drives.quick_stop_tolerance
        band = np.stack([nominal * (1.0 - off), nominal * (1.0 + off)], axis=-1)
        return cls(machine.reaction_cycles * drives.cycle, drives.cycle, band)

    @property
    def step(self) -> float:
        """How long a cell of the plan is, to begin with, where it is fast [s]."""
        return max(self.reaction, self.coast) * _CELLS.usual


@dataclass(frozen=True, slots=True, eq=False)
class Footprint:
    """Which parts of the plane of D = yA2 - yA1 and S = yA1 + yA2 - 2 yA3 carriages may reach.

    The place of the platform in the xz plane follows from D and S alone.

    Attributes:
        machine: Whose carriages.
        smin: Least S in each column of D of each block [mm], shape (n, k); inf where none is.
        smax: Largest S, likewise; -inf where none is.
        left: Least D in each column, inf where none is.
        right: Largest D, likewise; -inf where none is.
        farthest: How far a carriage may be from the middle of its rail [mm], shape (n,).
        nearest: Least D [mm], shape (n,); -inf where the links cannot reach.
    """

    machine: Machine
    smin: FloatArray
    smax: FloatArray
    left: FloatArray
    right: FloatArray
    farthest: FloatArray
    nearest: FloatArray

    @classmethod
    def empty(cls, machine: Machine, count: int) -> Footprint:
        """Return a footprint of blocks in which nothing is yet."""
        columns = int(np.ceil(4.0 * machine.geometry.leg_length / column_width(machine)))
        shape = count, columns
        return cls(
            machine,
            smin=np.full(shape, np.inf),
            smax=np.full(shape, -np.inf),
            left=np.full(shape, np.inf),
            right=np.full(shape, -np.inf),
            farthest=np.full(count, -np.inf),
            nearest=np.full(count, np.inf),
        )

    def __len__(self) -> int:
        return len(self.nearest)

    def nearest_to(self, plane: FloatArray) -> int:
        """Return the block whose outline comes nearest to D and S, shape (2,)."""
        D, S = plane.tolist()
        if not np.isfinite(D):
            return 0
        j = int((D - lowest_column(self.machine)) / column_width(self.machine))
        j = min(max(j, 0), self.smin.shape[1] - 1)
        away = np.minimum(np.abs(self.smin[:, j] - S), np.abs(self.smax[:, j] - S))
        return int(np.argmin(away))

    def rails(self) -> tuple[FloatArray, FloatArray]:
        """Return what is left of travel, and of the distance of carriages 1 and 2 [mm], (n,)."""
        machine = self.machine
        travel = machine.geometry.rail_half_length - self.farthest
        return travel, self.nearest - machine.carriage_width

    def merged(self) -> Footprint:
        """Return the footprint of all blocks in one."""
        return Footprint(
            self.machine,
            self.smin.min(axis=0, keepdims=True),
            self.smax.max(axis=0, keepdims=True),
            self.left.min(axis=0, keepdims=True),
            self.right.max(axis=0, keepdims=True),
            self.farthest.max(keepdims=True),
            self.nearest.min(keepdims=True),
        )


def column_width(machine: Machine) -> float:
    """Return the width of a column of D [mm]."""
    return _CELLS.column * machine.geometry.leg_length


def lowest_column(machine: Machine) -> float:
    """Return the D at which columns begin [mm]: the legs reach no other."""
    return machine.geometry.coupler_length - 2.0 * machine.geometry.leg_length


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Parts of a plan, each with cells of its own length.

    Attributes:
        bounds: Of the plan.
        start: Path time at which each begins [s], shape (n,).
        step: Length of a cell of path time in each [s], shape (n,).
        rate: Path time per time: what the plan's velocities are multiplied by, (n,).
    """

    bounds: CarriageBounds
    start: FloatArray
    step: FloatArray
    rate: FloatArray

    @classmethod
    def cover(cls, bounds: CarriageBounds) -> Blocks:
        """Cover a plan, with longer cells where it is slow."""
        motion, brakes = bounds.motion, Brakes.of(bounds.motion.machine)
        finest, size = brakes.step, _CELLS.passed * column_width(motion.machine)
        most = max(
            _CELLS.halvings,
            int(np.log2(max(motion.duration / (finest * PARTS * _CELLS.tiles), 1.0))),
        )
        long = finest * PARTS * 2**most
        tiles = np.arange(max(int(np.ceil(motion.duration / long * (1.0 - 1e-12))), 1)) * long
        times = tiles[:, None] + long * np.linspace(0.0, 1.0, 65)
        speeds = np.abs(motion.at(np.minimum(times, motion.duration)).velocity).max(axis=(1, 2))
        fits = np.log2(size / np.maximum(speeds * finest, 1e-9 * size))
        cuts = 2 ** (most - np.clip(fits, 0, most).astype(np.intp))
        step = np.repeat(long / PARTS / cuts, cuts)
        first = np.cumsum(cuts) - cuts
        start = np.repeat(tiles, cuts) + (np.arange(step.size) - np.repeat(first, cuts)) * (
            PARTS * step
        )
        inside = (start < motion.duration) | (start == 0.0)
        return cls(bounds, start[inside], step[inside], np.ones(int(inside.sum())))

    def __len__(self) -> int:
        return len(self.start)

    @property
    def end(self) -> FloatArray:
        """Path time at which each ends [s], shape (n,)."""
        ends: FloatArray = self.start + PARTS * self.step
        return ends

    def __getitem__(self, rows: IndexArray | BoolArray | slice) -> Blocks:
        return Blocks(self.bounds, self.start[rows], self.step[rows], self.rate[rows])

    def may_be_cut(self) -> BoolArray:
        """Tell which of them may be cut once more: what is shorter says hardly more, shape (n,)."""
        motion = self.bounds.motion
        brakes = Brakes.of(motion.machine)
        times = self.start[:, None] + PARTS * self.step[:, None] * np.linspace(0.0, 1.0, 5)
        speed = np.abs(motion.at(np.minimum(times, motion.duration)).velocity).max(axis=(1, 2))
        finest = max(brakes.reaction, brakes.coast) * _CELLS.finest
        long = self.step * speed > _CELLS.still * column_width(motion.machine)
        return np.asarray((self.step > 1.5 * finest) & long)

    def cut(self) -> Blocks:
        """Cut each into two."""
        half = 0.5 * self.step
        start = np.column_stack([self.start, self.start + PARTS * half]).ravel()
        return Blocks(self.bounds, start, np.repeat(half, 2), np.repeat(self.rate, 2))

    @classmethod
    def within(cls, bounds: CarriageBounds, parts: FloatArray) -> Blocks:
        """Return one block for each part of the path time [s], (n, 2)."""
        step = (parts[:, 1] - parts[:, 0]) / PARTS
        return cls(bounds, parts[:, 0], step, np.ones(len(parts)))

    def at_rate(self, rate: FloatArray) -> Blocks:
        """Return the middles of the blocks, of a plan that is run at other rates (n,).

        They are the shorter, the slower it is, so that cells do not get longer than they usually
        are: they say what a rate would do there, and certify nothing.
        """
        step = np.minimum(self.step, rate * Brakes.of(self.bounds.motion.machine).step)
        start = self.start + 0.5 * PARTS * (self.step - step)
        return Blocks(self.bounds, start, step, rate)

    def footprint(self) -> Footprint:
        """Bound where the carriages may be until they stand, for each block."""
        return self._spread(False)[0]

    def boxes(self) -> FloatArray:
        """Return the intervals of the carriages in each cell of each block [mm], (n, k, 3, 2).

        Blocks with fewer cells than others have NaN in what is over.
        """
        return self._spread(True)[1]

    def _spread(self, with_boxes: bool) -> tuple[Footprint, FloatArray]:
        """Return the footprint and, if they are wanted, the intervals in every cell."""
        machine = self.bounds.motion.machine
        brakes = Brakes.of(machine)
        step = self.step / self.rate
        late = np.ceil(brakes.reaction / step - 1e-9).astype(np.intp)
        counts = PARTS + late + 1
        first = np.cumsum(counts) - counts
        node = np.arange(int(counts.sum())) - np.repeat(first, counts)
        times = np.repeat(self.start, counts) + node * np.repeat(self.step, counts)
        plan = self._nodes(times, np.repeat(self.step, counts), np.repeat(self.rate, counts))
        slowing = (np.abs(plan[1]) / brakes.decelerations[:, 0]).max(axis=-1)
        lasting = np.maximum.reduceat(slowing, first) + brakes.reaction + brakes.coast
        rows = PARTS + np.ceil(lasting / step).astype(np.intp) + 2
        out = Footprint.empty(machine, len(self))
        boxes = np.full((len(self), with_boxes * PARTS * int(rows.max()), 3, 2), np.nan)
        columns = lowest_column(machine), column_width(machine)
        arrays = out.smin, out.smax, out.left, out.right, out.farthest, out.nearest, boxes
        spread((first, step, rows), plan, tuple(brakes), columns, arrays)
        return out, boxes

    def _nodes(
        self, times: FloatArray, step: FloatArray, rate: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return carriages, velocities, and bounds on the acceleration up to the next node."""
        motion = self.bounds.motion
        start, end = (np.minimum(t, motion.duration) for t in (times, times + step))
        state = motion.at(start)
        second, third = self.bounds.within(start, end)
        near = np.abs(state.acceleration) + third[:, :3] * (end - start)[:, None]
        rates = rate[:, None]
        most = np.minimum(near, second[:, :3]) * rates * rates
        return state.carriages, state.velocity * rates, most
