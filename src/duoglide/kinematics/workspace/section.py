"""The exact boundary of a cross-section: arcs and one quartic, with its exact area."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, sqrt

import numpy as np

from duoglide.arrays import BoolArray, FloatArray, IndexArray
from duoglide.kinematics.constants import PoseConstants, pose_constants
from duoglide.kinematics.kernels import in_numpy, margins_pose
from duoglide.kinematics.modes import WORKING, WorkingMode
from duoglide.kinematics.workspace.constraints import Constraints
from duoglide.kinematics.workspace.curves import Curve, CurveKind
from duoglide.machine import Geometry

SAMPLES = 401  # places along x at which the order of the curves is looked at
PARTS, ROUNDS = 16, 9  # 2^36 steps in a cell, 16 times finer at a time
SHARES = np.linspace(0.0, 1.0, PARTS + 1)
CHANGES_PER_CELL = 4
SLIVER = 1e-9  # [mm], below which a stretch is rounding

_margins_columns = in_numpy(margins_pose)


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of the region between two curves, for x from ``start`` to ``end`` [mm]."""

    start: float
    end: float
    low: Curve
    high: Curve

    @property
    def area(self) -> float:
        """Its area [mm^2], in closed form."""
        return self.high.integral(self.start, self.end) - self.low.integral(self.start, self.end)


@dataclass(frozen=True, eq=False)
class Section:
    """A region of the xz plane as stretches between curves.

    Attributes:
        pieces: The stretches, in rising x.
    """

    pieces: tuple[Piece, ...]

    @cached_property
    def area(self) -> float:
        """Area of the region [mm^2]."""
        return sum(piece.area for piece in self.pieces)

    @property
    def curves(self) -> frozenset[Curve]:
        """The curves that bound the region."""
        return frozenset(curve for piece in self.pieces for curve in (piece.low, piece.high))

    def outline(self, points: int = 200) -> list[tuple[Curve, FloatArray]]:
        """Return each boundary curve's stretches as polylines of (x, z), shape (points, 2)."""
        lines = []
        for piece in self.pieces:
            way = 0.5 * (1.0 - np.cos(np.pi * np.linspace(0.0, 1.0, points)))  # dense at the ends
            x = piece.start + (piece.end - piece.start) * way
            lines += [(c, np.stack([x, c.z(x)], axis=-1)) for c in (piece.low, piece.high)]
        return lines


@dataclass(frozen=True, slots=True)
class _Bounds:
    """Levels of the legs and of the strut between which the region lies."""

    rise: tuple[float, float]
    radius: tuple[float, float]


def section(
    geometry: Geometry,
    constraints: Constraints | None = None,
    y: float = 0.0,
    mode: WorkingMode = WORKING,
) -> Section:
    """Find the exact cross-section of the workspace at ``y``.

    Links, case 2, travel and carriage width count: their boundaries are arcs and one quartic.
    Clearance, angles and interference do not; for those there is the grid.

    Args:
        geometry: Dimensions of the robot.
        constraints: What limits the workspace; None: the links alone.
        y: Where to cut [mm]; matters on finite rails only.
        mode: Which of the inverse solutions, on its side m = +1.
    """
    limits = constraints or Constraints()
    bounds = _find_levels(geometry, limits, y, mode)
    if bounds is None:
        return Section(())
    k = pose_constants(geometry, mode)
    order = _Order(_collect_curves(geometry, bounds, mode.v), bounds, k, limits.beyond_case_2)
    middle, reach = k.cx, k.l6
    x = np.unique(np.append(np.linspace(middle - reach, middle + reach, SAMPLES), middle))
    breaks = np.concatenate([x[:1], _find_changes(order, x), x[-1:]])
    pieces = []
    for start, end in pairwise(breaks.tolist()):
        if end - start < SLIVER:
            continue
        between = order.pairs(0.5 * (start + end))
        pieces += [Piece(start, end, low, high) for low, high in between]
    return Section(tuple(_merge(pieces)))


def volume(
    geometry: Geometry,
    constraints: Constraints,
    mode: WorkingMode = WORKING,
    tolerance: float = 1e-4,
) -> float:
    """Integrate exact sections along y [mm^3], adaptively.

    Infinite on unlimited rails that reach anything.

    Args:
        geometry: Dimensions of the robot.
        constraints: What limits the workspace; clearance, angles and interference do not count.
        mode: Which of the inverse solutions.
        tolerance: Relative error to stop at.
    """
    from scipy.integrate import quad

    if constraints.travel == inf:
        return inf if section(geometry, constraints, 0.0, mode).area > 0.0 else 0.0

    def area(y: float) -> float:
        return section(geometry, constraints, y, mode).area

    low, high = _find_support(geometry, constraints, mode)
    return float(quad(area, low, high, epsrel=tolerance, epsabs=0.0)[0]) if high > low else 0.0


def _find_support(g: Geometry, c: Constraints, mode: WorkingMode) -> tuple[float, float]:
    """Return the y between which the rails leave anything [mm]."""
    y = np.linspace(-c.travel, c.travel, 2001)
    open_ = [at for at in y.tolist() if _find_levels(g, c, at, mode) is not None]
    spacing = float(y[1] - y[0])
    return (open_[0] - spacing, open_[-1] + spacing) if open_ else (0.0, 0.0)


def _find_levels(g: Geometry, c: Constraints, y: float, mode: WorkingMode) -> _Bounds | None:
    """Turn travel and carriage width into levels of h and of the strut's projection."""
    half = g.coupler_length / 2.0
    p_low, p_high = 0.0, g.leg_length
    q_low, q_high = 0.0, g.strut_length
    for offset, w in ((-half, mode.w1), (half, mode.w2)):
        reach = sorted((w * (-c.travel - y - offset), w * (c.travel - y - offset)))
        p_low, p_high = max(p_low, reach[0]), min(p_high, reach[1])
    spread = mode.w2 - mode.w1
    if spread > 0:
        p_low = max(p_low, (c.carriage_width - g.coupler_length) / spread)
    elif spread < 0:
        p_high = min(p_high, (g.coupler_length - c.carriage_width) / -spread)
    elif g.coupler_length < c.carriage_width:
        return None
    reach = sorted((mode.w3 * (-c.travel - y), mode.w3 * (c.travel - y)))
    q_low, q_high = max(q_low, reach[0]), min(q_high, reach[1])
    if p_low >= p_high or q_low >= q_high:
        return None
    return _Bounds(
        rise=(_find_other_side(g.leg_length, p_high), _find_other_side(g.leg_length, p_low)),
        radius=(_find_other_side(g.strut_length, q_high), _find_other_side(g.strut_length, q_low)),
    )


def _find_other_side(hypotenuse: float, side: float) -> float:
    """Return the other side of a right triangle."""
    return sqrt((hypotenuse - side) * (hypotenuse + side))


def _collect_curves(g: Geometry, bounds: _Bounds, v: int) -> tuple[Curve, ...]:
    """Return every curve that may bound the region."""
    strut = [
        Curve(g, kind, radius, v)
        for radius in bounds.radius
        if radius > 0.0
        for kind in (CurveKind.STRUT_TOP, CurveKind.STRUT_BOTTOM)
    ]
    legs = [Curve(g, CurveKind.LEGS, rise, v) for rise in bounds.rise]
    return (*legs, *strut, Curve(g, CurveKind.CASE_2, 0.0, v))


@dataclass(frozen=True, slots=True)
class _Order:
    """Which curves bound the region, in rising z, as a function of x."""

    curves: tuple[Curve, ...]
    bounds: _Bounds
    constants: PoseConstants
    beyond_case_2: bool

    def signatures(self, x: FloatArray) -> IndexArray:
        """Return what tells apart places with another order of curves, shape (curves, n)."""
        heights = np.stack([curve.z(x) for curve in self.curves])
        heights = np.where(np.isfinite(heights), heights, inf)
        ranks = heights.argsort(axis=0, kind="stable")
        heights = np.take_along_axis(heights, ranks, axis=0)
        with np.errstate(invalid="ignore"):
            inside = self._inside(x, 0.5 * (heights[:-1] + heights[1:]))
        inside &= np.isfinite(heights[1:]) & (heights[1:] > heights[:-1])
        signature = 2 * ranks
        signature[:-1] += inside
        return np.where(np.isfinite(heights), signature, -1)

    def _inside(self, x: FloatArray, z: FloatArray) -> BoolArray:
        """Whether points of the plane belong to the region."""
        strut, h, in_line, _ = _margins_columns(x, z, self.constants)
        radius = self.curves[0].geometry.strut_length - strut
        inside: BoolArray = (self.bounds.rise[0] <= h) & (h <= self.bounds.rise[1])
        inside &= (self.bounds.radius[0] <= radius) & (radius <= self.bounds.radius[1])
        if not self.beyond_case_2:
            inside &= in_line >= 0.0
        return inside

    def pairs(self, x: float) -> list[tuple[Curve, Curve]]:
        """Return the pairs of curves that enclose the region at ``x``, from below to above."""
        signature = self.signatures(np.array([x]))[:, 0].tolist()
        found: list[list[int]] = []
        for here, above in pairwise(signature):
            if here < 0 or here % 2 == 0:
                continue
            if found and found[-1][1] == here // 2:
                found[-1][1] = above // 2
            else:
                found.append([here // 2, above // 2])
        return [(self.curves[low], self.curves[high]) for low, high in found]


def _find_changes(order: _Order, x: FloatArray) -> FloatArray:
    """Find where the order of the curves changes, to rounding, in ever finer steps."""
    found: list[FloatArray] = []
    signatures = order.signatures(x)
    changed = (signatures[:, :-1] != signatures[:, 1:]).any(axis=0)
    low, high = x[:-1][changed], x[1:][changed]
    last = signatures[:, 1:][:, changed]
    for _ in range(CHANGES_PER_CELL):
        end, first = high.copy(), order.signatures(low)[..., None]
        for _ in range(ROUNDS):
            between = low[:, None] + (high - low)[:, None] * SHARES
            signature = order.signatures(between.ravel()).reshape(-1, *between.shape)
            same = (signature == first).all(axis=0)
            same[:, 0], same[:, -1] = True, False
            at = same.argmin(axis=1)[:, None]
            low = np.take_along_axis(between, at - 1, axis=1)[:, 0]
            high = np.take_along_axis(between, at, axis=1)[:, 0]
        found.append(high)
        more = (order.signatures(high) != last).any(axis=0) & (high < end)
        low, high, last = high[more], end[more], last[:, more]
        if not more.any():
            break
    return np.unique(np.concatenate(found)) if found else np.empty(0)


def _merge(pieces: list[Piece]) -> list[Piece]:
    """Join neighbouring pieces between the same curves."""
    done: list[Piece] = []
    for piece in pieces:
        for i, before in enumerate(done):
            same = (before.low, before.high) == (piece.low, piece.high)
            if same and abs(before.end - piece.start) < 1e-6:
                done[i] = Piece(before.start, piece.end, piece.low, piece.high)
                break
        else:
            done.append(piece)
    return done
