"""Certifies a curve interval by interval: nothing between two samples is left to chance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from duoglide.planning.check.judge import judge
from duoglide.planning.check.rules import Intervals, Rules
from duoglide.planning.tolerances import PICOMETRE, ROUNDING


class _Intervals(NamedTuple):
    """How sigma is cut into intervals.

    Attributes:
        first: Length of the intervals to begin with [mm].
        parts: Into which an undecided interval is cut.
        block: Intervals at a time, to bound the memory.
    """

    first: float = 16.0
    parts: int = 4
    block: int = 32768


_CUT = _Intervals()


def first_failure(rules: Rules, start: float = 0.0, end: float = np.inf) -> float:
    """Certify the curve from one sigma to another, stretch by stretch up to the first failure.

    Returns:
        Sigma of the first point that breaks a rule [mm], to 1e-8 mm; infinity where none does.
    """
    end = min(end, rules.curve.end)
    while start < end:  # a curve of any length leaves reach within its first stretch, if it does
        stop = min(start + _CUT.block * _CUT.first, end)
        failure = _first_within(rules, start, stop)
        if failure < np.inf:
            return failure
        start = stop
    return np.inf


def _first_within(rules: Rules, start: float, end: float) -> float:
    """Do what ``first_failure`` does, in one piece."""
    failure = np.inf
    stack = [first_intervals(rules, start, end)]
    while stack:
        block = stack.pop()
        if block.middle.size > _CUT.block:
            stack.append(block[slice(_CUT.block, None)])
            block = block[slice(_CUT.block)]
        verdict = judge(rules, block)
        failed = verdict.failed
        if failed.any():
            failure = min(failure, float(block.middle[failed].min()))
        undecided = ~verdict.certified & (block.half > PICOMETRE)
        undecided &= block.middle - block.half < failure
        if undecided.any():
            stack.append(block[np.flatnonzero(undecided)].split(_CUT.parts))
    return failure


def first_intervals(rules: Rules, start: float = 0.0, end: float = np.inf) -> Intervals:
    """Cover every piece with intervals that are not too long to begin with."""
    low = np.maximum(rules.curve.breaks[:-1], start)
    spans = np.minimum(rules.curve.breaks[1:], end) - low
    counts = np.ceil(np.maximum(spans, 0.0) / _CUT.first - ROUNDING).astype(np.intp)
    counts[spans > 0.0] = np.maximum(counts[spans > 0.0], 1)
    piece = np.repeat(np.arange(spans.size), counts)
    within = np.arange(piece.size) - np.repeat(np.cumsum(counts) - counts, counts)
    half = 0.5 * spans[piece] / counts[piece]
    return Intervals(piece, low[piece] + (2 * within + 1) * half, half)
