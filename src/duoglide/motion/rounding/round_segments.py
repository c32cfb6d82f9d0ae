"""From a course of segments to one curve: every corner rounded, or a rest."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import PathError
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.segments import show
from duoglide.motion.rounding.blend import SHAPE, Blend, Corner, find_nearest, join_quintics
from duoglide.motion.rounding.course import SHARPEST, Course, Fitted
from duoglide.motion.rounding.cut_backs import Corners, cut_backs
from duoglide.motion.rounding.pieces import RawPath, chain_pieces

SMOOTH = 1e-9  # of tangents [1] and curvatures [1/mm]: a joint with less of a jump needs no blend
ROUNDING = 1e-12  # [mm], of coordinates: what turns the tangents of very short segments
SHORTEST = 1e-4  # [mm]; to slow down for a shorter blend takes as long as to rest in the corner
ROUNDED_OFF = 1e-6  # [mm] by which explicit blends may overlap: they are shortened
_APPROACHES = 12  # steps towards the place nearest to a waypoint that is no joint
VANISHED = 1e-10  # [mm]; what two blends leave of a segment below this is nothing


@dataclass(frozen=True, slots=True, eq=False)
class RoundedCurve:
    """The curve of segments, and what became of their corners.

    Attributes:
        course: What was rounded.
        curve: The curve, in the coordinates of the segments.
        waypoints: Sigma of each waypoint; on a blend, where it passes nearest [mm], shape (n + 1,).
        before: Cut-back before each waypoint [mm], 0 where there is no blend, shape (n + 1,).
        after: Cut-back after it [mm].
        shape: Shape of its blend, 0 where there is none.
        deviation: Distance from the waypoint to the curve [mm].
    """

    course: Course
    curve: Curve
    waypoints: FloatArray
    before: FloatArray
    after: FloatArray
    shape: FloatArray
    deviation: FloatArray

    def blend(self, corner: int) -> Blend | None:
        """Return the blend of corner 0, 1, ... (waypoint 1, 2, ...); None: an exact corner."""
        i = corner + 1
        if self.shape[i] == 0.0:
            return None
        return Blend(float(self.before[i]), float(self.after[i]), float(self.shape[i]))


@dataclass(frozen=True, slots=True, eq=False)
class Sorted:
    """The pieces of a course, and which of its corners are rounded: the same for any blends there.

    Attributes:
        raw: The pieces.
        rest: Which corners are rests, shape (n,).
        rounded: Which are to be rounded; the others join smoothly.
    """

    raw: RawPath
    rest: BoolArray
    rounded: BoolArray


def sort_course(course: Course) -> Sorted:
    """Chain the pieces of a course and sort its corners.

    Raises:
        PathError: An explicit blend stands at a reversal.
    """
    raw = chain_pieces(course.segments)
    return Sorted(raw, *_sort_corners(course.corners, course.halts, raw))


def round_course(course: Course, known: Sorted | None = None) -> RoundedCurve:
    """Fix every blend between the segments of a course, and join their pieces to one curve.

    Args:
        course: The course.
        known: What ``sort_course`` finds of it, or of a course with other blends.

    Raises:
        PathError: Explicit blends that overlap, are longer than their segment, or stand at a
            reversal.
    """
    known = known or sort_course(course)
    raw, rest = known.raw, known.rest.copy()
    corners = _find_corners_to_round(course.corners, raw, known.rounded)
    before, after = cut_backs(raw.curve, corners)
    long = 5.0 * corners.shape * np.minimum(before, after) >= SHORTEST
    rest[corners.waypoint[~long] - 1] = True
    return _assemble(course, raw, rest, corners.those(long), (before[long], after[long]))


def _sort_corners(
    tolerances: Sequence[Corner], halts: Collection[int], raw: RawPath
) -> tuple[BoolArray, BoolArray]:
    """Tell which corners are rests, and which are to be rounded; the others join smoothly."""
    curve, left = raw.curve, raw.joints
    sigma = curve.breaks[left + 1]
    one, other = curve.both_sides(0.0, 0.0, left)
    jump = np.abs(one[:, 1:3] - other[:, 1:3]).max(axis=(1, 2), initial=0.0)
    short = np.minimum(curve.spans[left], curve.spans[left + 1])
    t0, t1 = one[:, 1], other[:, 1]
    cosine = np.sum(t0 * t1, axis=1) / np.sqrt(np.sum(t0**2, axis=1) * np.sum(t1**2, axis=1))
    wanted = np.array([isinstance(c, Blend) or c > 0.0 for c in tolerances], dtype=bool)
    halted = np.array([i + 1 in halts for i in range(left.size)], dtype=bool)
    smooth = (jump < SMOOTH + ROUNDING / short) & ~halted
    wanted &= ~smooth & ~halted
    rounded = wanted & (cosine > SHARPEST)
    for i in np.flatnonzero(wanted & ~rounded).tolist():
        if isinstance(tolerances[i], Blend):
            raise _refuse_reversal(curve, i, float(sigma[i]), float(cosine[i]))
    return ~smooth & ~rounded, rounded


def _refuse_reversal(curve: Curve, corner: int, sigma: float, cosine: float) -> PathError:
    turn = float(np.degrees(np.arccos(max(cosine, -1.0))))
    position = curve.position(sigma)
    return PathError(
        f"the path turns back by {turn:.4g} degrees at waypoint {corner + 1}, {show(position)} mm:"
        " no blend fits there; give a tolerance instead, and the motion will rest there",
        arc_length=float(curve.arc_length(sigma)),
        position=position.tolist(),
        quantity="blend",
        amount=turn,
    )


def _find_corners_to_round(
    tolerances: Sequence[Corner], raw: RawPath, rounded: BoolArray
) -> Corners:
    """Collect what the search for cut-backs needs, and refuse explicit blends that overlap."""
    which = np.flatnonzero(rounded)
    chosen = [tolerances[i] for i in which.tolist()]
    explicit = np.array([isinstance(c, Blend) for c in chosen], dtype=bool)
    fields = [
        (c.before, c.after, c.shape, 0.0) if isinstance(c, Blend) else (0.0, 0.0, SHAPE, c)
        for c in chosen
    ]
    before, after, shape, tolerance = np.array(fields, dtype=np.float64).reshape(-1, 4).T
    left = raw.joints[which]
    corners = Corners(which + 1, left, tolerance, shape, explicit, before, after)
    return _fit_explicit_blends(raw.curve, corners) if explicit.any() else corners


def _fit_explicit_blends(curve: Curve, corners: Corners) -> Corners:
    """Refuse explicit blends that are longer than their segments.

    Where that is by no more than what rounding of points in a file makes of blends that just fit,
    they are shortened until they do.

    Raises:
        PathError: They overlap, or one reaches past its segment.
    """
    need = np.zeros(curve.count)
    np.add.at(need, corners.left, corners.before)
    np.add.at(need, corners.left + 1, corners.after)
    excess = need - curve.spans
    fits = excess <= ROUNDED_OFF
    if fits.all():
        share = curve.spans / np.maximum(need, curve.spans)
        before = corners.before * share[corners.left]
        return replace(corners, before=before, after=corners.after * share[corners.left + 1])
    piece = int(np.argmax(~fits))
    ends = [
        int(w)
        for w, i, a, b in zip(
            corners.waypoint, corners.left, corners.before, corners.after, strict=True
        )
        if (i == piece and a > 0.0) or (i + 1 == piece and b > 0.0)
    ]
    names = " and ".join(str(waypoint) for waypoint in ends)
    start = curve.position(float(curve.breaks[piece]))
    plural = len(ends) > 1
    raise PathError(
        f"the blend{'s' * plural} at waypoint{'s' * plural} {names}"
        f" {'overlap' if plural else 'reaches past its segment'} by {excess[piece]:.6g} mm: the"
        f" segment from {show(start)} mm is {curve.spans[piece]:.6g} mm long, the cut-backs on it"
        f" take {need[piece]:.6g} mm",
        arc_length=float(curve.arc_length(float(curve.breaks[piece]))),
        position=start.tolist(),
        quantity="blend",
        amount=float(excess[piece]),
    )


def _assemble(
    course: Course,
    raw: RawPath,
    rest: BoolArray,
    corners: Corners,
    cuts: tuple[FloatArray, FloatArray],
) -> RoundedCurve:
    """Trim the pieces, and put the blends between them."""
    before, after = cuts
    curve, left = raw.curve, corners.left
    skip, stop = np.zeros(curve.count), curve.spans.copy()
    skip[left + 1] = after
    stop[left] -= before
    spans = np.where(stop - skip > VANISHED, stop - skip, 0.0)
    kept = _trim(curve, skip, spans)
    states = curve.both_sides(before, after, left)
    bend_spans = 5.0 * corners.shape * np.minimum(before, after)
    bends = join_quintics(*states, bend_spans)
    order = np.argsort(np.concatenate([np.arange(curve.count) * 2, left * 2 + 1]))
    all_spans = np.concatenate([spans, bend_spans])[order]
    ends = np.cumsum(all_spans)
    place = np.empty_like(order)
    place[order] = np.arange(order.size)
    keep = all_spans > 0.0
    rows = max(kept.shape[1], bends.shape[1] if left.size else 0)
    chain = np.concatenate([_pad(kept, rows), _pad(bends[:, :rows], rows)])[order][keep]
    rates = np.concatenate([curve.rates, np.zeros(left.size)])[order][keep]
    joints = ends[place[raw.joints]]
    rests = np.unique(joints[rest])
    whole = Curve(all_spans[keep], rates, chain, tuple(rests[rests < ends[-1]].tolist()))
    waypoints = np.concatenate([[0.0], joints, [whole.end]])
    corner_points = curve.position(curve.breaks[left + 1])
    u, deviations = find_nearest(bends, corner_points)
    waypoints[corners.waypoint] += u * bend_spans
    table = np.zeros((4, waypoints.size))
    table[:, corners.waypoint] = before, after, corners.shape, deviations
    first = np.concatenate([[0], raw.joints + 1])  # piece of each segment
    begins = ends[place[first]] - spans[first] - skip[first]
    return _restore(course, whole, waypoints, table, begins)


def _restore(
    course: Course, curve: Curve, joints: FloatArray, table: FloatArray, begins: FloatArray
) -> RoundedCurve:
    """Tell of the programmed waypoints what is known of the joints of a course.

    Args:
        course: The course.
        curve: Its curve.
        joints: Sigma of each joint [mm].
        table: Cut-backs before and after it, shape and deviation, shape (4, joints).
        begins: Sigma where each segment would begin if nothing were cut back [mm].
    """
    if course.is_plain:
        return RoundedCurve(course, curve, joints, *table)
    smooth = course.joint < 0
    waypoints = np.where(smooth, begins[course.inside] + course.offset, joints[course.joint])
    fitted = np.array([isinstance(segment, Fitted) for segment in course.segments])
    beside = smooth & ~fitted[course.inside]  # on a line, whose end may have become a blend
    waypoints[beside] = _approach(curve, waypoints[beside], course.points[beside])
    waypoints = np.maximum.accumulate(waypoints)
    origin = np.array(course.origin)
    named = np.flatnonzero(origin >= 0)
    full = np.zeros((4, waypoints.size))
    full[:, origin[named]] = table[:, named]
    others = np.ones(waypoints.size, dtype=bool)
    others[origin[named]] = False
    places = curve.position(waypoints[others])
    full[3, others] = np.linalg.norm(places - course.points[others], axis=-1)
    return RoundedCurve(course, curve, waypoints, *full)


def _approach(curve: Curve, sigma: FloatArray, points: FloatArray) -> FloatArray:
    """Go from places on a curve towards those that are nearest to points, never farther away."""
    sigma = np.clip(sigma, 0.0, curve.end)
    state = curve.derivatives(sigma)
    for _ in range(_APPROACHES):
        slope, off = state[:, 1], points - state[:, 0]
        step = np.sum(off * slope, axis=1) / np.sum(slope * slope, axis=1)
        ahead = np.clip(sigma + step, 0.0, curve.end)
        there = curve.derivatives(ahead)
        nearer = np.linalg.norm(points - there[:, 0], axis=1) < np.linalg.norm(off, axis=1)
        sigma, state = np.where(nearer, ahead, sigma), np.where(nearer[:, None, None], there, state)
    return sigma


def _pad(coefficients: FloatArray, rows: int) -> FloatArray:
    """Append rows of zeros up to ``rows`` powers."""
    result = np.zeros((len(coefficients), rows, 3))
    result[:, : coefficients.shape[1]] = coefficients
    return result


def _trim(curve: Curve, skip: FloatArray, spans: FloatArray) -> FloatArray:
    """Coefficients of the pieces without their first ``skip`` mm, ``spans`` mm long."""
    untouched = (skip == 0.0) & (spans == curve.spans)
    every = np.arange(curve.count)
    states = curve.derivatives(curve.breaks[:-1] + skip, every)
    result: FloatArray = np.zeros((curve.count, max(4, curve.coefficients.shape[1]), 3))
    scale = (spans[:, None] ** np.arange(4)) / np.array([1.0, 1.0, 2.0, 6.0])
    result[:, :4] = states * scale[..., None]
    arcs = curve.rates > 0.0
    if arcs.any():
        rate, whole = curve.rates[arcs][:, None], curve.spans[arcs][:, None]
        advance = curve.coefficients[arcs, 3] / whole
        result[arcs, 0] = states[arcs, 0]
        result[arcs, 1] = -states[arcs, 2] / rate**2
        result[arcs, 2] = (states[arcs, 1] - advance) / rate
        result[arcs, 3] = advance * spans[arcs][:, None]
    width = curve.coefficients.shape[1]
    result[untouched, :width] = curve.coefficients[untouched]
    result[untouched, width:] = 0.0
    return result
