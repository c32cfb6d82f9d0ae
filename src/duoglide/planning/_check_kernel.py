"""The check's loops, compiled: what ``check_judge`` does in numpy, pose by pose.

numpy would spend most of its time on being called: a path has a hundred parts, not a million.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from duoglide.arrays import FloatArray
from duoglide.kinematics._batch import register_kernels
from duoglide.kinematics._nearest_pose import nearest_of_pose
from duoglide.kinematics.compiled import compiled, inlined, kept
from duoglide.kinematics.kernels import legs_pose, margins_pose
from duoglide.kinematics.reach import links_pose
from duoglide.kinematics.singularity import FAMILIES
from duoglide.planning._motion_kernel import point
from duoglide.planning.check_formulas import (
    anchor_part,
    chord_part,
    clear_part,
    root_part,
    strokes_part,
    travel_part,
    travel_pose,
)
from duoglide.planning.check_rules import SURE, Intervals, Rules, Verdict

register_kernels()
for _formula in (
    root_part,
    strokes_part,
    travel_part,
    travel_pose,
    clear_part,
    anchor_part,
    chord_part,
):
    register_jitable(_formula)


def judge(rules: Rules, intervals: Intervals) -> Verdict:
    """Evaluate every rule on intervals, as ``check_judge.judge``."""
    c, bounds = rules.curve, rules.bounds
    numbers = rules.numbers
    shape = intervals.middle.size, numbers.required.size
    verdict = Verdict(np.empty(shape), np.empty(shape))
    judge_loop(
        (intervals.piece, intervals.middle, intervals.half),
        (c.breaks, c.spans, c.rates, c.coefficients),
        (bounds.first, bounds.second, bounds.third),
        numbers,
        (verdict.margins, verdict.lowest),
    )
    return verdict


def measure(rules: Rules, positions: FloatArray) -> FloatArray:
    """Measure every rule and every singularity family at positions of shape (n, 3).

    Returns:
        Margins of the rules less what is required [mm]; minus infinity out of reach. Then, family
        by family, the absolute margins of ``FAMILIES``; NaN out of reach. Shape (n, rules + 6).
    """
    numbers = rules.numbers
    out = np.empty((len(positions), numbers.required.size + len(FAMILIES)))
    measure_loop(np.ascontiguousarray(positions), numbers, out)
    return out


def _margins(position: FloatArray, rules: Any, links: Any, out: FloatArray) -> Any:
    """Write the margins of a pose within reach; return the direction away from the surface."""
    clear, ahead, up, _ = nearest_of_pose(position[0], position[2], rules.k, rules.curve, np.inf)
    _, _, _, one, two, three, gap = travel_pose(
        position[1], links[2], links[3], rules.limit, rules.k
    )
    out[0] = clear
    out[1] = one
    out[2] = two
    out[3] = three
    out[4] = gap
    for i in range(rules.boxes.shape[0]):
        farthest = -np.inf
        for j in range(3):
            low, high = rules.boxes[i, 0, j], rules.boxes[i, 1, j]
            farthest = max(farthest, low - position[j], position[j] - high)
        out[5 + i] = farthest
    for i in range(len(rules.required)):
        out[i] -= rules.required[i]
    return ahead, up


margins_of = inlined(_margins)


def _clear_lowest(r: FloatArray, clear: float, away: Any, part: Any, rules: Any) -> float:
    """Bound the clearance, less what is required, on a part of a curve."""
    second, half = part
    slope, bend = (r[1, 0], r[1, 2]), (second[0], second[2])
    far, near, bow = clear_part(away, slope, bend, half)
    lowest = clear - far - bow
    spare = clear - near - bow - SURE
    if lowest < SURE and spare > 0.0:
        chord = (slope[0] * half, slope[1] * half)
        offset = anchor_part(away, chord, spare, rules.k[3])
        x, z = r[0, 0] + offset[0], r[0, 2] + offset[1]
        _, _, _, _, arm, legs, strut = links_pose(x, z, rules.k)
        if arm < 0.0 and legs < 0.0 and strut < 0.0:
            found = nearest_of_pose(x, z, rules.k, rules.curve, np.inf)
            bound = found[0] - rules.required[0] - chord_part(offset, chord) - bow
            lowest = max(lowest, bound)
    return lowest


clear_lowest = inlined(_clear_lowest)


def _lowest(r: FloatArray, part: Any, links: Any, rules: Any, out: FloatArray) -> None:
    """Take from the margins of travel, order and boxes what they may lose on a part of a curve."""
    first, second, half = part
    strokes = strokes_part(
        (r[0, 0], r[0, 2]),
        (r[1, 0], r[1, 2]),
        (first[0], first[2]),
        (second[0], second[2]),
        half,
        links[:4],
        rules.k,
    )
    less = travel_part(r[1, 1], second[1], half, strokes, rules.k)
    for j in range(4):
        bound = out[1 + j] - less[j]
        out[1 + j] = bound if bound - bound == 0.0 else -np.inf
    for i in range(rules.boxes.shape[0]):
        farthest = -np.inf
        for j in range(3):
            change = abs(r[1, j]) * half + 0.5 * second[j] * half * half
            low, high = rules.boxes[i, 0, j], rules.boxes[i, 1, j]
            farthest = max(farthest, max(low - r[0, j], r[0, j] - high) - change)
        out[5 + i] = farthest - rules.required[5 + i]


lowest_of = inlined(_lowest)


def _judge_loop(intervals: Any, curve: Any, bounds: Any, rules: Any, out: Any) -> int:
    """Judge every interval.

    Args:
        intervals: The arrays of ``Intervals``.
        curve: Breaks, spans, rates and coefficients of the curve.
        bounds: The arrays of its ``CurveBounds``.
        rules: The machine's ``RuleNumbers``.
        out: The arrays of ``Verdict``.
    """
    pieces, middles, halves = intervals
    breaks, spans, rates, coefficients = curve
    margins, lowest = out
    count = rules.required.size
    r, first, second = np.empty((4, 3)), np.empty(3), np.empty(3)
    for i in range(middles.size):
        piece, half = pieces[i], halves[i]
        point(middles[i] - breaks[piece], spans[piece], rates[piece], coefficients[piece], r)
        links = links_pose(r[0, 0], r[0, 2], rules.k)
        if not (links[4] < 0.0 and links[5] < 0.0 and links[6] < 0.0):
            for j in range(count):
                margins[i, j] = -np.inf
                lowest[i, j] = -np.inf
            continue
        for j in range(3):
            bend = abs(r[2, j]) + bounds[2][piece, j] * half
            second[j] = min(bounds[1][piece, j], bend)
            first[j] = min(bounds[0][piece, j], abs(r[1, j]) + second[j] * half)
        away = margins_of(r[0], rules, links, margins[i])
        for j in range(count):
            lowest[i, j] = margins[i, j]
        lowest[i, 0] = clear_lowest(r, margins[i, 0], away, (second, half), rules)
        lowest_of(r, (first, second, half), links, rules, lowest[i])
    return 0


judge_loop = compiled(_judge_loop)


def _measure_loop(positions: FloatArray, rules: Any, out: FloatArray) -> int:
    """Measure every position."""
    count = rules.required.size
    for i in range(positions.shape[0]):
        x, z = positions[i, 0], positions[i, 2]
        links = links_pose(x, z, rules.k)
        if links[4] < 0.0 and links[5] < 0.0 and links[6] < 0.0:
            margins_of(positions[i], rules, links, out[i])
        else:
            for j in range(count):
                out[i, j] = -np.inf
        strut, h, in_line, arm = margins_pose(x, z, rules.k)
        left, spread = legs_pose(h, rules.k)
        sides = (left, strut, spread, h, in_line, arm)
        for j in range(6):
            out[i, count + j] = abs(sides[j])
    return 0


measure_loop = compiled(_measure_loop)


def ready() -> bool:
    """Whether neither loop has to be compiled any more on this machine."""
    return kept(judge_loop) and kept(measure_loop)
