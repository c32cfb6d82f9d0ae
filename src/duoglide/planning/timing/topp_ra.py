"""Time a span with toppra: the quickest motion under velocity and acceleration limits alone.

toppra gives the speed at the nodes of a grid and, in each cell, a constant second derivative of
sigma. These jump from node to node; a profile is C2. So neighbouring cells meet in the mean of both
values, and where that is far from either, a cell begins or ends with a short ramp. A cell still
takes sigma and speed at both of its nodes as toppra has them, and its length in time follows.

toppra is asked in units in which the span is 1 long and takes about 1. Its parametrizers are not
used: they exceed accelerations by 20 % (splines) or jump (constant acceleration).

With a jerk limit, toppra's motion is where the retiming begins: see ``time_from_topp_ra``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import toppra
from numpy.typing import NDArray
from toppra.constraint import LinearConstraint
from toppra.constraint.linear_constraint import canlinear_colloc_to_interpolate

from duoglide.arrays import FloatArray
from duoglide.errors import LimitError
from duoglide.motion.profile import SIGMA, SPEED, TIME, Profile
from duoglide.motion.timing_report import TimingMethod
from duoglide.planning.timing.lead import ALLOWED, Lead
from duoglide.planning.timing.span import Effort, Span, find_marks, make_span, time_span
from duoglide.planning.timing.timed_curve import RESERVED, TimedCurve
from duoglide.planning.timing.use import find_largest_use, find_stretch

CELLS = 400  # of a span, about: toppra converges with the first power of their length
_PER_PIECE = 8  # of the curve, at least
_CLOSE = 2e-6  # of the span; nodes nearer than that are one
_NEAR = 0.2  # of a part of a piece; nodes nearer than that to a break are left out
_RAMP = 0.004  # of a cell's time, in which a second derivative that jumps is reached
_RAMP_ROOM = 0.2  # of a cell's time, that a ramp takes at most
_SHORTEST = 2e-7  # [s] of a ramp; in less of it, rounding of sigma would be felt
_SMOOTH = 0.02  # of the larger value; two cells whose values differ by less need no ramps
_TURNS = 4  # in which limits are lowered where the motion exceeds them between nodes
_FINE = 2e-4  # of the duration; a motion that exceeds its limits by less is slowed as a whole
_ROUNDING = 1e-6
_STANDING = 1e-9  # of the largest speed; toppra's motion must not stand still on the way


def time_span_topp_ra(
    timed: TimedCurve, start: float, end: float, lead: Lead | None = None
) -> Span:
    """Time a part of a curve from rest, or from the state of a lead, to rest, whatever the jerk.

    Args:
        timed: The curve.
        start: Where the part begins [mm].
        end: Where it comes to rest [mm].
        lead: How it begins, if in motion; ``timed`` has its limits lowered then.

    Raises:
        LimitError: toppra finds none; or none that begins like this.
    """
    grid = divide_span(timed, start, end)
    rows = SpanRows.of(timed, grid)
    moving = lead if lead is not None and lead.way is not None else None
    begin = (0.0, 0.0) if moving is None else (moving.speed, moving.acceleration)
    best, least = None, np.inf
    for _ in range(_TURNS):
        speeds = rows.find_speeds(begin[0])
        rows = replace(rows, near=speeds)
        profile, cells = ramp_cells(grid, speeds, begin[1])
        use = find_largest_use(timed, profile)
        use[:, 2] = 0.0  # there is no limit of jerk
        factor = find_stretch(use)
        if moving is not None and factor < 1.0 + ALLOWED:
            return Span(profile, TimingMethod.TOPPRA)
        if moving is None and profile.duration * factor < least:
            best, least = profile, profile.duration * factor
        if moving is None and factor < 1.0 + _FINE:
            break
        rows = rows.tighten(use, cells)
    if best is None:
        raise LimitError(f"toppra finds no timing that begins at {begin[0]:g} mm/s")
    return Span(best.stretch(least / best.duration * (1.0 + _ROUNDING)), TimingMethod.TOPPRA)


def time_from_topp_ra(timed: TimedCurve, start: float, end: float, effort: Effort) -> Span:
    """Time a part of a curve from rest to rest under a jerk limit, beginning from toppra's motion.

    toppra's acceleration jumps at rest, which no retiming takes away. So the simple motion of
    ``time_span`` is retimed here too; but where its knots stand, and the retiming at which the
    jerk limit is made linear first, are those of toppra's motion.
    """
    try:
        grid = divide_span(timed, start, end)
        motion, _ = ramp_cells(grid, SpanRows.of(timed, grid).find_speeds())
    except LimitError as error:
        span = time_span(timed, start, end, effort)
        return make_span(span.profile, str(error), span.reason)
    span = time_span(timed, start, end, effort, motion)
    return span if span.reason else Span(span.profile, TimingMethod.TOPPRA)


def divide_span(timed: TimedCurve, start: float, end: float) -> FloatArray:
    """Return the nodes of a span [mm]: closer to its ends, where sigma goes with time squared."""
    marks = find_marks(timed, start, end)
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, CELLS + 1))
    parts = np.arange(1, _PER_PIECE) / _PER_PIECE
    pieces = (marks[:-1, None] + np.diff(marks)[:, None] * parts).ravel()
    wished = np.unique(np.concatenate([start + (end - start) * share, pieces]))
    after = np.searchsorted(marks, wished).clip(1, marks.size - 1)
    gap = np.minimum(wished - marks[after - 1], marks[after] - wished)
    least = np.minimum(
        _NEAR / _PER_PIECE * (marks[after] - marks[after - 1]), _CLOSE * (end - start)
    )
    kept = wished[gap > least]
    apart = np.diff(kept, prepend=start) > _CLOSE * (end - start)
    grid: FloatArray = np.union1d(kept[apart], marks)
    return grid


@dataclass(frozen=True, slots=True, eq=False)
class SpanRows:
    """What toppra is asked: limits at the nodes of a grid.

    Attributes:
        grid: The nodes, ascending [mm], (n + 1,).
        second: Unit of time in which the span takes about 1 [s].
        square: The largest square of d sigma/dt at each node [mm^2/s^2], (n + 1,).
        by_rate: Factors of d2 sigma/dt2 in each acceleration over its limit, (n + 1, rows).
        by_square: Factors of the square of d sigma/dt in the same, (n + 1, rows).
        force: Factors of d2 sigma/dt2, of the square of d sigma/dt and of d sigma/dt in each force
            along one direction over what there is of it, (n + 1, 6 or none, 3).
        near: About d sigma/dt at each node, where its square's root is made linear [mm/s].
    """

    grid: FloatArray
    second: float
    square: FloatArray
    by_rate: FloatArray
    by_square: FloatArray
    force: FloatArray
    near: FloatArray

    @classmethod
    def of(cls, timed: TimedCurve, grid: FloatArray) -> SpanRows:
        """Evaluate limits and caps at the nodes; a node between two caps has the lower one."""
        unit = np.zeros((grid.size, 4))
        unit[:, SIGMA - 1], unit[:, SPEED - 1] = grid, 1.0
        pieces = timed.pieces_between(grid)
        uses = timed.motion(unit, pieces)
        reserve = np.where(grid > timed.ahead, RESERVED[1] / RESERVED[0], 1.0)[:, None]
        by_rate = uses[:, 0] * timed.limits[0] / timed.limits[1] * reserve
        by_square = uses[:, 1]
        speed = np.abs(uses[:, 0]).max(axis=-1)
        if timed.has_caps:
            middle = 0.5 * (grid[1:] + grid[:-1])
            caps = timed.caps(unit[:, None], pieces[:, None], np.append(middle, middle[-1]))
            before = timed.caps(unit[1:, None], pieces[1:, None], middle)
            speed = np.maximum(speed, caps.speed[:, 0])
            speed[1:] = np.maximum(speed[1:], before.speed[:, 0])
            by_rate = np.concatenate([by_rate, caps.rows[:, 0, :, 0]], axis=1)
            by_square = np.concatenate([by_square, caps.rows[:, 0, :, 1]], axis=1)
        length = grid[-1] - grid[0]
        rates = np.abs(by_rate[:, :3]).max() / length
        second = length * max(float(speed.max()), (rates / length) ** 0.5)
        force = np.empty((grid.size, 0, 3))
        if timed.limits_force:
            force = timed.forces(unit[None], pieces[None]).rows[0]
        near = (0.5**0.5) / speed
        return cls(grid, second, speed**-2.0, by_rate, by_square, force, near)

    def find_speeds(self, begin: float = 0.0) -> FloatArray:
        """Return d sigma/dt at the nodes [mm/s], (n + 1,).

        Args:
            begin: The same at the first node.

        Raises:
            LimitError: toppra finds none, or one that stands still on the way.
        """
        length = float(self.grid[-1] - self.grid[0])
        unit = length / self.second
        points = (self.grid - self.grid[0]) / length
        points[-1] = 1.0
        near = np.maximum(self.near, _STANDING * self.near.max())[:, None]
        slowed = 0.5 * self.force[..., 2]
        pushes = np.stack(
            [
                self.force[..., 0] * (unit / self.second),
                (self.force[..., 1] + slowed / near) * unit**2,
                slowed * near,
            ]
        )
        scaled = _Limits(
            self.by_rate * (unit / self.second),
            self.by_square * unit**2,
            self.square / unit**2,
            pushes,
        )
        solver = toppra.algorithm.TOPPRA([scaled], _Line(), gridpoints=points)
        solver.compute_parameterization(begin / unit, 0.0)
        data = solver.problem_data
        if data.return_code != toppra.algorithm.ParameterizationReturnCode.Ok:
            raise LimitError(f"toppra finds no motion: {data.return_code}")
        speeds: FloatArray = data.sd_vec * unit
        speeds[0], speeds[-1] = begin, 0.0
        if not speeds[1:-1].min(initial=np.inf) > _STANDING * speeds.max():
            raise LimitError("toppra's motion stands still on the way")
        return speeds

    def tighten(self, use: FloatArray, cells: NDArray[np.intp]) -> SpanRows:
        """Return this with the limits lowered at both nodes of each cell that exceeds them.

        Args:
            use: Of each piece of a profile, (m, 3 or 4, carriages, then the tool).
            cells: The cell that each piece belongs to, ascending, (m,).
        """
        firsts = np.searchsorted(cells, np.arange(self.grid.size - 1))
        over = np.maximum(np.maximum.reduceat(use, firsts, axis=0), 1.0)
        none = np.ones_like(over[:1])
        over = np.maximum(np.concatenate([over, none]), np.concatenate([none, over]))
        rows = self.by_rate.shape[1]
        tool = np.repeat(over[:, 1, 3:], max(rows - 3, 0), axis=1)[:, : rows - 3]
        rates = np.concatenate([over[:, 1, :3], tool], axis=1)
        force = self.force
        if force.size:
            force = force * np.tile(over[:, 3, :3], 2)[..., None]
        return replace(
            self,
            force=force,
            square=self.square / over[:, 0].max(axis=-1) ** 2,
            by_rate=self.by_rate * rates,
            by_square=self.by_square * rates,
        )


class _Limits(LinearConstraint):  # type: ignore[misc]  # toppra has no types
    """Limits at the nodes, in toppra's form: F (a u + b x + c) <= g, and x within bounds."""

    def __init__(
        self, by_rate: FloatArray, by_square: FloatArray, square: FloatArray, pushes: FloatArray
    ) -> None:
        super().__init__()
        self.identical = True
        self._terms = by_rate, by_square, square, pushes

    def compute_constraint_params(
        self, path: object, gridpoints: FloatArray, *_args: object, **_others: object
    ) -> tuple[FloatArray | None, ...]:
        by_rate, by_square, square, pushes = self._terms
        rows = by_rate.shape[1]
        every = np.eye(rows + pushes.shape[2])  # forces are limited along one direction each
        both = np.concatenate([every, -every[:rows]])
        bounds = np.stack([np.zeros(square.size), square], axis=1)
        pairs = zip((by_rate, by_square, np.zeros_like(by_rate)), pushes, strict=True)
        a, b, c = (np.concatenate(pair, axis=1) for pair in pairs)
        terms = a, b, c, both, np.ones(len(both)), None, bounds
        if gridpoints.size != square.size:
            raise LimitError("toppra asks for limits on another grid")
        converted: tuple[FloatArray | None, ...] = canlinear_colloc_to_interpolate(
            *terms[:5], bounds, None, gridpoints, identical=True
        )
        *rows_of, xbound, ubound = converted
        return *rows_of, ubound, xbound


class _Line:
    """A path from 0 to 1, as toppra asks for one: its limits say all that it needs."""

    path_interval = np.array([0.0, 1.0])
    duration, dof, waypoints = 1.0, 1, None

    def __call__(self, path_positions: FloatArray, order: int = 0) -> FloatArray:
        s = np.asarray(path_positions, dtype=np.float64)
        values = (s, np.ones_like(s), np.zeros_like(s))[order]
        return values[..., None]


def ramp_cells(
    grid: FloatArray, speeds: FloatArray, begin: float = 0.0
) -> tuple[Profile, NDArray[np.intp]]:
    """Return a profile that has given speeds at the nodes of a grid.

    Args:
        grid: The nodes, ascending [mm], (n + 1,).
        speeds: D sigma/dt at each [mm/s], (n + 1,).
        begin: D2 sigma/dt2 at the first node [mm/s^2]; at the last one it is 0.

    Returns:
        The profile, and the cell that each of its pieces belongs to.
    """
    way, middle = np.diff(grid), 0.5 * (speeds[1:] + speeds[:-1])
    steady = np.diff(speeds) * middle / way
    rates = np.concatenate([[begin], 0.5 * (steady[1:] + steady[:-1]), [0.0]])
    first, last = rates[:-1], rates[1:]
    size = np.maximum(np.abs(steady), 1e-300)
    off = np.maximum(np.abs(first - steady), np.abs(last - steady))
    ramped = (off > _SMOOTH * np.maximum(size, np.abs(steady).max() * _SMOOTH)) & (
        _RAMP_ROOM * way / middle > _SHORTEST
    )
    share = np.where(ramped, np.clip(_SHORTEST * middle / way, _RAMP, _RAMP_ROOM), 0.5)
    bend = (first - last) * (0.25 * share - share**2 / 6.0)
    h = 2.0 * way / (middle + np.sqrt(np.maximum(middle**2 + 4.0 * bend * way, 0.0)))
    level = (np.diff(speeds) / h - 0.5 * share * (first + last)) / (1.0 - share)
    times = np.concatenate([[0.0], np.cumsum(h)])
    w = share * h
    knots = np.column_stack([times, grid, speeds, rates])
    early = np.column_stack(
        [
            times[:-1] + w,
            grid[:-1] + w * (speeds[:-1] + w * (first / 3.0 + level / 6.0)),
            speeds[:-1] + 0.5 * w * (first + level),
            level,
        ]
    )
    late = np.column_stack(
        [
            times[1:] - w,
            grid[1:] - w * (speeds[1:] - w * (last / 3.0 + level / 6.0)),
            speeds[1:] - 0.5 * w * (last + level),
            level,
        ]
    )
    cells = np.arange(way.size)
    rows = np.concatenate([knots, early[ramped], late[ramped]])
    owner = np.concatenate([[*cells, cells[-1]], cells[ramped], cells[ramped]])
    order = np.argsort(rows[:, TIME], kind="stable")
    return Profile(rows[order]), owner[order][:-1]
