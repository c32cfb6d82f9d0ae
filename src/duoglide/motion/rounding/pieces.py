"""The pieces of a path before its corners are rounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.segments import Arc, Helix, Line, Segment, Spline
from duoglide.motion.rounding.course import Fitted

_ROWS = 4  # lines, arcs, helices and cubics need no more coefficients
Rows = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class RawPath:
    """A path with sharp corners.

    Attributes:
        curve: Its pieces; tangents may jump at ``joints``.
        joints: Index of the last piece of every segment but the last, shape (n - 1,).
    """

    curve: Curve
    joints: np.ndarray[Any, np.dtype[np.intp]]


def chain_pieces(segments: Sequence[Segment | Fitted]) -> RawPath:
    """Chain the pieces of all segments."""
    counts = np.array([_count_pieces(segment) for segment in segments])
    first = np.concatenate([[0], np.cumsum(counts)])
    spans, rates = np.zeros(first[-1]), np.zeros(first[-1])
    coefficients = np.zeros((first[-1], _ROWS, 3))
    lines = [i for i, segment in enumerate(segments) if isinstance(segment, Line)]
    ends = np.array([(segments[i].start, segments[i].end) for i in lines]).reshape(-1, 2, 3)
    rows = first[lines] if lines else np.array([], dtype=np.intp)
    way = ends[:, 1] - ends[:, 0]
    spans[rows] = np.linalg.norm(way, axis=1)
    coefficients[rows, 0] = ends[:, 0]
    coefficients[rows, 1] = way
    for i, segment in enumerate(segments):
        if not isinstance(segment, Line):
            part = slice(first[i], first[i + 1])
            spans[part], rates[part], coefficients[part] = _make_rows(segment)
    return RawPath(Curve(spans, rates, coefficients), first[1:-1] - 1)


def _count_pieces(segment: Segment | Fitted) -> int:
    if isinstance(segment, Spline):
        return len(segment.through) - 1
    return segment.fit.spans.size if isinstance(segment, Fitted) else 1


def _make_rows(segment: Segment | Fitted) -> Rows:
    if isinstance(segment, Fitted):
        fit = segment.fit
        return fit.spans, np.zeros_like(fit.spans), fit.coefficients
    if isinstance(segment, Arc):
        return _make_arc_rows(segment)
    if isinstance(segment, Helix):
        return _make_helix_rows(segment)
    assert isinstance(segment, Spline)
    return _make_spline_rows(segment.through)


def _make_arc_rows(arc: Arc) -> Rows:
    first, second, radius, angle = arc.circle()
    rows = np.zeros((1, _ROWS, 3))
    rows[0, :3] = arc.start, first, second
    return np.array([radius * angle]), np.array([1.0 / radius]), rows


def _make_helix_rows(helix: Helix) -> Rows:
    rows = np.zeros((1, _ROWS, 3))
    first, second, advance = helix.vectors()
    rows[0] = helix.start, first, second, advance
    length = helix.length()
    return np.array([length]), np.array([helix.sweep / length]), rows


def _make_spline_rows(points: FloatArray) -> Rows:
    """Natural cubic spline over chord length: tridiagonal in the second derivatives."""
    spans = np.linalg.norm(np.diff(points, axis=0), axis=1)
    slopes = np.diff(points, axis=0) / spans[:, None]
    bends = np.zeros_like(points)
    if len(points) > 2:
        from scipy.linalg import solve_banded

        bands = np.zeros((3, len(points) - 2))
        bands[0, 1:] = bands[2, :-1] = spans[1:-1]
        bands[1] = 2.0 * (spans[:-1] + spans[1:])
        bends[1:-1] = solve_banded((1, 1), bands, 6.0 * np.diff(slopes, axis=0))
    h = spans[:, None]
    rows = np.zeros((spans.size, _ROWS, 3))
    rows[:, 0] = points[:-1]
    rows[:, 1] = (slopes - h * (2.0 * bends[:-1] + bends[1:]) / 6.0) * h
    rows[:, 2] = 0.5 * bends[:-1] * h**2
    rows[:, 3] = (bends[1:] - bends[:-1]) * h**2 / 6.0
    return spans, np.zeros_like(spans), rows
