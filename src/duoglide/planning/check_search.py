"""Certifies a curve interval by interval: nothing between two samples is left to chance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.planning.check_rules import Intervals, Rules, judge

FIRST_LENGTH = 16.0  # [mm] of the intervals to begin with
PARTS = 4  # into which an undecided interval is cut
BLOCK = 32768  # intervals at a time, to bound the memory
TINIEST = 1e-9  # [mm] of sigma; nothing shorter is cut


@dataclass(slots=True)
class Search:
    """What has been found so far.

    Attributes:
        rules: The rules.
        failed_at: Sigma of the first sample that breaks a rule [mm]; infinity: none does.
        least: Least margin of each family over all samples [mm].
        where: The intervals around those samples: sigma and half the length, shape (families, 2).
    """

    rules: Rules
    failed_at: float = np.inf
    least: FloatArray = field(init=False)
    where: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.rules.families)
        self.least = np.full(count, np.inf)
        self.where = np.zeros((count, 2))

    def visit(self, intervals: Intervals) -> Intervals:
        """Judge intervals, and return the parts of those that are not decided."""
        verdict = judge(self.rules, intervals)
        failed = verdict.failed
        if failed.any():
            self.failed_at = min(self.failed_at, float(intervals.middle[failed].min()))
        ranked = np.where(np.isfinite(verdict.lowest), verdict.lowest, verdict.margins)
        rows = np.argmin(ranked, axis=0)
        values = ranked[rows, np.arange(rows.size)]
        better = values < self.least
        self.least[better] = values[better]
        found = np.stack([intervals.middle[rows], intervals.half[rows]], axis=1)
        self.where[better] = found[better]
        undecided = ~verdict.certified & (intervals.half > TINIEST)
        undecided &= intervals.middle - intervals.half < self.failed_at
        return intervals[np.flatnonzero(undecided)].split(PARTS)


def search(rules: Rules, start: float = 0.0, end: float = np.inf) -> Search:
    """Certify the curve from one sigma to another, or find the first point that breaks a rule."""
    found = Search(rules)
    stack = [first_intervals(rules, start, end)]
    while stack:
        block = stack.pop()
        if block.middle.size > BLOCK:
            stack.append(block[slice(BLOCK, None)])
            block = block[slice(BLOCK)]
        rest = found.visit(block)
        if rest.middle.size:
            stack.append(rest)
    return found


def first_intervals(rules: Rules, start: float = 0.0, end: float = np.inf) -> Intervals:
    """Cover every piece with intervals that are not too long to begin with."""
    low = np.maximum(rules.curve.breaks[:-1], start)
    spans = np.minimum(rules.curve.breaks[1:], end) - low
    counts = np.ceil(np.maximum(spans, 0.0) / FIRST_LENGTH).astype(np.intp)
    piece = np.repeat(np.arange(spans.size), counts)
    within = np.arange(piece.size) - np.repeat(np.cumsum(counts) - counts, counts)
    half = 0.5 * spans[piece] / counts[piece]
    return Intervals(piece, low[piece] + (2 * within + 1) * half, half)
