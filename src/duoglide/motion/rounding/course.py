"""What is rounded in place of the programmed segments: dense points become a smooth curve.

A blend takes at most half of each line beside its corner. Where lines are shorter than the blends
that the tolerance allows, blends cannot use it, and the points are dense for it: they tell a curve.
Such runs are fitted (``fit.py``); the fit begins and ends on the longer lines beside the run.
Waypoints that nearly coincide are one corner. All other segments and corners stay as they are.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import BoolArray, FloatArray, IndexArray
from duoglide.motion.path.segments import COINCIDENT, Line, Point, Segment
from duoglide.motion.rounding.blend import Blend, Corner

if TYPE_CHECKING:
    from duoglide.motion.rounding.fit import Fit

SHARPEST = np.cos(np.radians(170.0))  # corners that turn back further than this are rests
_SHALLOW = 0.21875  # times cut-back and sine of half the turn: how far a blend is from its corner
_STRAIGHT = 1e-9  # sine of half a turn that needs no blend
_FEWEST = 4  # lines in a row that are too short for their blends make points dense
_ASIDE = COINCIDENT  # waypoints that are no farther beside a line are on it,
_ASIDE_SHARE = 0.01  # nor farther than this share of their tolerance
_NEAR = 0.25  # of the tolerance; waypoints that lie within it, and apart from others, are one
_LEAD_IN = 50.0  # tolerances; on so much of a longer line a fitted curve begins or ends at most,
_SHARE = 0.45  # and on no more than this share of it


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """A curve through dense points, in place of the lines between them.

    Attributes:
        fit: Its pieces.
        start: Where it begins [mm].
        end: Where it ends [mm].
    """

    fit: Fit
    start: Point
    end: Point


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Segments to be rounded, and what has become of the programmed waypoints.

    Attributes:
        segments: Each begins where the one before ends.
        corners: One per joint of two segments: a corner tolerance [mm] or a ``Blend``.
        halts: Joints at which something is done at rest, by index; 0 is the start.
        origin: Waypoint that each joint stands for, the ends included; -1: of none.
        joint: Joint that each waypoint has become; -1: none, it lies on a segment.
        inside: Segment that each of the other waypoints lies on; -1 for joints.
        offset: Sigma on that segment, of the place nearest to the waypoint [mm].
        points: The waypoints [mm], shape (n + 1, 3).
    """

    segments: tuple[Segment | Fitted, ...]
    corners: tuple[Corner, ...]
    halts: frozenset[int]
    origin: tuple[int, ...]
    joint: IndexArray
    inside: IndexArray
    offset: FloatArray
    points: FloatArray

    @property
    def is_plain(self) -> bool:
        """Whether it is what was programmed: every waypoint is a joint of its own."""
        return len(self.origin) == len(self.points) and min(self.origin) >= 0


def lay_course(
    segments: Sequence[Segment], corners: Sequence[Corner], halts: Collection[int]
) -> Course:
    """Join waypoints that nearly coincide, and fit the lines between dense ones."""
    count = len(segments) + 1
    chain = _Chain(segments, corners, halts, np.arange(count), np.arange(float(count)))
    return chain.join_near().join_straight().fit_dense(chain.points)


class _Chain:
    """Segments between vertices; a vertex stands for one programmed waypoint or more.

    Args:
        segments: The segments.
        corners: One per inner vertex.
        halts: Vertices at which something is done at rest.
        origin: The waypoint that each vertex stands for.
        where: For each waypoint its vertex; with a fraction, how far it is towards the next one.
    """

    def __init__(
        self,
        segments: Sequence[Segment],
        corners: Sequence[Corner],
        halts: Collection[int],
        origin: IndexArray,
        where: FloatArray,
    ) -> None:
        count = len(segments)
        self.segments, self.corners, self.halts = segments, corners, halts
        self.origin, self.where = origin, where
        self.points = np.array([segments[0].start, *(segment.end for segment in segments)])
        self.straight = np.array([isinstance(segment, Line) for segment in segments])
        way = np.diff(self.points, axis=0)
        self.lengths = np.linalg.norm(way, axis=1)
        unit = way / np.maximum(self.lengths, 1e-300)[:, None]
        self.half = 0.5 * np.linalg.norm(unit[1:] - unit[:-1], axis=1)  # sine of half the turn
        self.tolerance = np.zeros(count + 1)
        self.tolerance[1:-1] = [0.0 if isinstance(c, Blend) else c for c in corners]
        # soft: a corner of two lines that may be rounded within a tolerance
        soft: BoolArray = self.tolerance > 0.0
        soft[1:-1] &= self.straight[:-1] & self.straight[1:]
        soft[[i for i in halts if i <= count]] = False
        reversal = np.sum(unit[:-1] * unit[1:], axis=1) <= SHARPEST
        shorter = np.minimum(self.lengths[:-1], self.lengths[1:])
        soft[1:-1] &= ~(reversal & (shorter > self.tolerance[1:-1]))  # scatter is no reversal
        self.soft = soft

    def join_near(self) -> _Chain:
        """Make one corner of waypoints that nearly coincide and lie apart from the others."""
        count = len(self.segments)
        least = np.full(count, np.inf)
        for shift in (0, 1):
            own = self.tolerance[shift : count + shift]
            least = np.where(self.soft[shift : count + shift], np.minimum(least, own), least)
        near = self.straight & np.isfinite(least) & (self.lengths <= _NEAR * least)
        if not near.any():
            return self
        keep = np.arange(float(count + 1))
        corners: list[Corner] = [0.0, *self.corners, 0.0]
        for first, last in _stretches(near):
            hard = [i for i in range(first, last + 1) if not self.soft[i]]
            spread = float(self.lengths[first:last].sum())
            limit = float(least[first:last].min())
            beside = [self.lengths[i] for i in (first - 1, last) if 0 <= i < count]
            if len(hard) > 1 or spread > _NEAR * limit or min(beside, default=0.0) < limit:
                continue
            chosen = hard[0] if hard else first
            keep[first : last + 1] = chosen
            if not hard:
                corners[chosen] = limit - spread
        return self._keep(keep, corners)

    def join_straight(self) -> _Chain:
        """Make one line of lines that go straight on.

        Not of lines that nearly do: a program that is planned window by window would then see
        another line once it has passed its first waypoints.
        """
        count = len(self.segments)
        chord = np.linalg.norm(self.points[2:] - self.points[:-2], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            aside = 2.0 * self.half * self.lengths[:-1] * self.lengths[1:] / chord
        flat = self.soft[1:-1] & (aside <= self._aside()[1:-1])
        if not flat.any():
            return self
        keep = np.arange(float(count + 1))
        corners: list[Corner] = [0.0, *self.corners, 0.0]
        i = 0
        while i < count - 1:
            last = self._go_straight(i, i + 1) if flat[i] else i + 1
            if last > i + 1:
                along, off = self._measure_line(i, last)
                keep[i + 1 : last] = i + along
                for end in (i, last):
                    corner = corners[end]
                    if self.soft[end] and not isinstance(corner, Blend):
                        corners[end] = min(corner, float(self.tolerance[end] - off.max()))
            i = last
        return self._keep(keep, corners)

    def _aside(self) -> FloatArray:
        """Return how far beside a line each vertex may be and still be on it [mm]."""
        aside: FloatArray = np.minimum(_ASIDE, _ASIDE_SHARE * self.tolerance)
        return aside

    def _go_straight(self, first: int, last: int) -> int:
        """Return the last vertex of a straight line from ``first``, which reaches ``last``."""
        step = 1
        while step:
            end = last + step
            if end <= len(self.segments) and self._is_straight(first, end):
                last, step = end, 2 * step
            else:
                step //= 2
        return last

    def _is_straight(self, first: int, last: int) -> bool:
        if not self.soft[first + 1 : last].all():
            return False
        along, off = self._measure_line(first, last)
        forwards = np.diff(along, prepend=0.0, append=1.0) > 0.0
        return bool((off <= self._aside()[first + 1 : last]).all() and forwards.all())

    def _measure_line(self, first: int, last: int) -> tuple[FloatArray, FloatArray]:
        """Return where the vertices between two others are along their line, and how far off."""
        start, inner = self.points[first], self.points[first + 1 : last]
        way = self.points[last] - start
        along = (inner - start) @ way / max(float(way @ way), 1e-300)
        return along, np.linalg.norm(inner - start - along[:, None] * way, axis=1)

    def _keep(self, keep: FloatArray, corners: Sequence[Corner]) -> _Chain:
        """Return the chain of some of the vertices, lines between them.

        Args:
            keep: For each vertex the one that stands for it; with a fraction, it lies on the line
                from there to the next that is kept.
            corners: One per vertex, the ends included.
        """
        chosen = np.unique(np.floor(keep).astype(np.intp))
        place = np.searchsorted(chosen, np.floor(keep))
        segments = [
            self.segments[a] if b == a + 1 else Line(_point(self.points[a]), _point(self.points[b]))
            for a, b in pairwise(chosen.tolist())
        ]
        where = place + (keep - np.floor(keep))
        return _Chain(
            segments,
            [corners[i] for i in chosen[1:-1]],
            {int(place[i]) for i in self.halts},
            self.origin[chosen],
            where[self.where.astype(np.intp)],
        )

    def find_dense(self) -> list[tuple[int, int]]:
        """Return the first and the last waypoint of each run of lines too short for blends."""
        wanted = np.zeros(self.tolerance.size)
        bent = np.flatnonzero(self.soft[1:-1] & (self.half > _STRAIGHT)) + 1
        wanted[bent] = self.tolerance[bent] / (_SHALLOW * self.half[bent - 1])
        short = self.straight & (wanted[:-1] + wanted[1:] > self.lengths)
        for i, corner in enumerate(self.corners):
            if isinstance(corner, Blend):
                short[i : i + 2] = False
        found = []
        for first, last in _stretches(short):
            ends = [first, *(i for i in range(first + 1, last) if not self.soft[i]), last]
            found += [(a, b) for a, b in pairwise(ends) if b - a >= _FEWEST]
        return found

    def fit_dense(self, programmed: FloatArray) -> Course:
        """Fit the runs of dense points; those for which that fails stay lines."""
        count = len(self.segments)
        trimmed = np.zeros((2, count))  # at the start and at the end of each segment
        fits: dict[int, tuple[int, Fitted, int]] = {}
        for first, last in self.find_dense():
            lead, tail = self._lead(first, first - 1), self._lead(last, last)
            fitted = self._fit(first, last, lead, tail)
            if fitted is not None:
                fits[first] = last, fitted, int(lead > 0.0)
                if lead > 0.0:
                    trimmed[1, first - 1] = lead
                if tail > 0.0:
                    trimmed[0, last] = tail
        layer = _Layer(self, trimmed, programmed)
        i = 0
        while i < count:
            if i in fits:
                last, fitted, skipped = fits[i]
                layer.add_fit(i, last, fitted, skipped)
                i = last
            else:
                layer.add_segment(i)
                i += 1
        return layer.course()

    def _lead(self, waypoint: int, segment: int) -> float:
        """Return how much of the line beside a run its curve takes [mm]; 0: none."""
        if not self.soft[waypoint] or not 0 <= segment < len(self.segments):
            return 0.0
        length = float(self.lengths[segment])
        for corner, share in ((segment - 1, "after"), (segment, "before")):
            if 0 <= corner < len(self.corners) and isinstance(self.corners[corner], Blend):
                length -= getattr(self.corners[corner], share)
        lead = min(_SHARE * length, _LEAD_IN * float(self.tolerance[waypoint]))
        return lead if lead > 100.0 * COINCIDENT else 0.0

    def _fit(self, first: int, last: int, lead: float, tail: float) -> Fitted | None:
        points = list(self.points[first : last + 1])
        tolerance = self.tolerance[first : last + 1].copy()
        for end, beside in ((0, 1), (-1, -2)):
            if tolerance[end] == 0.0:
                tolerance[end] = tolerance[beside]
        hard = [w for w in (first, last) if not self.soft[w] and self.tolerance[w] > 0.0]
        if hard:  # a blend there takes the other half
            tolerance *= 0.5
        limits = tolerance.tolist()
        leave = arrive = None
        if lead > 0.0:
            leave = (self.points[first] - self.points[first - 1]) / self.lengths[first - 1]
            points.insert(0, self.points[first] - lead * leave)
            limits.insert(0, limits[0])
        if tail > 0.0:
            arrive = (self.points[last + 1] - self.points[last]) / self.lengths[last]
            points.append(self.points[last] + tail * arrive)
            limits.append(limits[-1])
        from duoglide.motion.rounding.fit import fit_points  # scipy takes a second to import

        fit = fit_points(np.array(points), np.array(limits), leave, arrive)
        return None if fit is None else Fitted(fit, _point(points[0]), _point(points[-1]))


@dataclass(slots=True, eq=False)
class _Layer:
    """Puts a course together from its start to its end."""

    chain: _Chain
    trimmed: FloatArray
    programmed: FloatArray
    segments: list[Segment | Fitted] = field(default_factory=list)
    corners: list[Corner] = field(default_factory=list)
    joints: list[int] = field(default_factory=list)  # waypoint of the chain, or -1
    places: dict[int, tuple[int, float]] = field(default_factory=dict)  # of vertices, on segments
    lines: dict[int, tuple[int, float]] = field(default_factory=dict)  # own segment, what it lacks

    def _join(self, waypoint: int) -> None:
        """Begin a segment at a waypoint of the chain; -1: where a curve leaves a line."""
        if self.segments:
            chain = self.chain
            corner = chain.corners[waypoint - 1] if waypoint >= 0 else 0.0
            if waypoint >= 0 and not isinstance(corner, Blend) and not chain.soft[waypoint]:
                beside_fit = isinstance(self.segments[-1], Fitted)
                corner = 0.5 * corner if beside_fit else corner
            self.corners.append(corner)
        self.joints.append(waypoint)

    def add_segment(self, i: int) -> None:
        """Add a segment of the chain, without what fitted curves take of it."""
        chain = self.chain
        skip, cut = self.trimmed[:, i].tolist()
        self._join(-1 if skip else i)
        segment = chain.segments[i]
        if skip or cut:
            way = (chain.points[i + 1] - chain.points[i]) / chain.lengths[i]
            start = self.segments[-1].end if skip else segment.start
            end = _point(chain.points[i + 1] - cut * way) if cut else segment.end
            segment = Line(start, end)
        self.lines[i] = len(self.segments), skip
        self.segments.append(segment)

    def add_fit(self, first: int, last: int, fitted: Fitted, skipped: int) -> None:
        """Add a fitted curve; its ends are joints where no line leads into it."""
        self._join(-1 if skipped else first)
        own = len(self.segments)
        self.segments.append(fitted)
        at = fitted.fit.at.tolist()
        for k, vertex in enumerate(range(first, last + 1)):
            self.places[vertex] = own, at[k + skipped]

    def course(self) -> Course:
        """Return the course."""
        chain = self.chain
        self.joints.append(len(chain.segments))
        joint_of = np.full(len(chain.points), -1)
        for k, vertex in enumerate(self.joints):
            if vertex >= 0:
                joint_of[vertex] = k
        vertices = np.floor(chain.where).astype(np.intp)
        share = chain.where - vertices
        joint = np.where(share == 0.0, joint_of[vertices], -1)
        inside, offset = np.full(joint.size, -1), np.zeros(joint.size)
        for i in np.flatnonzero(joint < 0).tolist():
            inside[i], offset[i] = self._place(int(vertices[i]), float(share[i]))
        return Course(
            tuple(self.segments),
            tuple(self.corners),
            frozenset(int(joint_of[i]) for i in chain.halts),
            tuple(int(chain.origin[i]) if i >= 0 else -1 for i in self.joints),
            joint,
            inside,
            offset,
            self.programmed,
        )

    def _place(self, vertex: int, share: float) -> tuple[int, float]:
        """Return the segment on which something is, and where on it."""
        if vertex in self.places and (share == 0.0 or vertex + 1 in self.places):
            own, offset = self.places[vertex]
            if share > 0.0 and self.places[vertex + 1][0] == own:
                return own, offset + share * (self.places[vertex + 1][1] - offset)
            if share == 0.0:
                return own, offset
        own, skipped = self.lines[vertex]
        return own, share * float(self.chain.lengths[vertex]) - skipped


def _stretches(mask: BoolArray) -> list[tuple[int, int]]:
    """Return where stretches of true begin, and the index after each."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    stretches: list[tuple[int, int]] = [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
    return stretches


def _point(values: FloatArray) -> Point:
    x, y, z = values.tolist()
    return x, y, z


_MANY = 8  # corners in a row that tell of a curve
_GENTLE = 0.5  # sine of half a turn, beyond which a corner is one
_WORTH = 1.0  # [mm]; a greater tolerance is not proposed


def explain_sampling(
    segments: Sequence[Segment], corners: Sequence[Corner], halts: Collection[int]
) -> str:
    """Say where many short lines stand for a curve, but have too little tolerance to become one.

    Returns:
        What would help; empty where there is nothing of the kind.
    """
    count = len(segments)
    if count <= _MANY:
        return ""
    chain = _Chain(segments, corners, halts, np.arange(count + 1), np.arange(count + 1.0))
    inner = chain.straight[:-1] & chain.straight[1:]
    inner &= (chain.half > _STRAIGHT) & (chain.half < _GENTLE)
    inner &= np.array([not isinstance(c, Blend) for c in corners])
    inner[[i - 1 for i in halts if 0 < i < count]] = False
    bulge = 0.25 * chain.half * np.maximum(chain.lengths[:-1], chain.lengths[1:])
    inner &= chain.tolerance[1:-1] < bulge  # a line leaves its curve by about that
    runs = [(a, b) for a, b in _stretches(inner) if b - a >= _MANY]
    wanted = [2.0 * float(bulge[a:b].max()) for a, b in runs]
    runs = [run for run, tolerance in zip(runs, wanted, strict=True) if tolerance <= _WORTH]
    if not runs:
        return ""
    corners_there = sum(b - a for a, b in runs)
    lengths = np.concatenate([chain.lengths[a : b + 1] for a, b in runs])
    enough = max(value for value in wanted if value <= _WORTH)
    return (
        f"{corners_there} corners between lines of {float(np.median(lengths)):.3g} mm look like a"
        f" curve; within a tolerance of {enough:.2g} mm (Path.fitted) it would be one"
    )
