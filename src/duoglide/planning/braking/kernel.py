"""Where drives that stop by themselves may take the carriages: one loop over cells, compiled.

Carriage i leaves the plan at T, goes on for c at the velocity v(T) that it then has, and brakes at
the deceleration d. At t it is at X = q(T) + v c + G(v, d, t - T - c), where G is how far a carriage
goes that brakes; before T it is where the plan is. With s the sign of v, a the acceleration of the
plan and b how long the drive has braked,

    dX/dT = b (d s + a) + a c,    dX/dc = v - v_left,    dX/dt = v_left.

So X runs one way in c, d and t, and in T as long as the plan does not slow down harder than the
drive: its least and largest values are at the ends of intervals. What it may do besides between two
nodes of T is bounded by ``slack``.
"""

from __future__ import annotations

from math import ceil, inf

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.kinematics.compiled import compiled, inlined

PARTS = 8  # nodes of a block, without those after it
ROUNDING = 1e-9  # mm; carriages at rest would fill nothing at all without it


@inlined
def way(v: float, d: float, t: float) -> float:
    """Return how far a drive goes within ``t`` that brakes from ``v`` at the deceleration ``d``."""
    t = min(max(t, 0.0), abs(v) / d)
    return v * t - (0.5 * d * t * t if v > 0.0 else -0.5 * d * t * t)


@inlined
def slack(v: float, most_a: float, step: float, d: FloatArray, coast: float) -> float:
    """Bound how far X leaves the interval between its values at nodes, in T and in t.

    Args:
        v: At the node.
        most_a: Bound on the acceleration from this node to the next.
        step: Between the two.
        d: Least and largest deceleration.
        coast: How long a drive may go on at its last velocity.
    """
    change = most_a * step
    braked = (abs(v) + change) / d[0]
    against = max(most_a - d[0], 0.0) * braked
    if abs(v) <= change:  # it may turn round: then it brakes from next to nothing
        against = max(against, (d[1] + most_a) * 2.0 * change / d[0])
    off: float = step * (against + most_a * coast) + 0.125 * change * step + ROUNDING
    return off


@compiled
def spread(  # noqa: PLR0912, PLR0915 - one loop: numba compiles every function that is called
    blocks: tuple[IndexArray, FloatArray, IndexArray],
    plan: tuple[FloatArray, FloatArray, FloatArray],
    drives: tuple[float, float, FloatArray],
    columns: tuple[float, float],
    out: tuple[FloatArray, ...],
) -> None:
    """Find which part of the plane of D and S the carriages may reach, and the rails' room.

    Every block has ``PARTS`` cells of the instant u at which the first drive leaves the plan. The
    others follow within the reaction time, each at its own T. Every cell of u has cells of the time
    t. In each, every carriage has an interval of its own; all of these boxes together are covered
    by one interval of S = yA1 + yA2 - 2 yA3 for each column of D = yA2 - yA1.

    Args:
        blocks: First node of each, the time between two nodes [s], and after how many of these
            everything stands, (n,) each.
        plan: q, v and the bound on the acceleration up to the next node, (m, 3) each.
        drives: Reaction time, longest time at the last velocity [s]; least and largest deceleration
            of each drive, (3, 2).
        columns: Lowest D, width of a column [mm].
        out: Least and largest S, least and largest D, (n, k) each; largest |carriage| and least D,
            (n,) each. Where the legs cannot reach, the least D is -inf. Then the intervals of the
            carriages in every cell, (n, cells, 3, 2), or no cells, if nobody wants them.
    """
    first, steps, rows = blocks
    q, v, most_a = plan
    reaction, coast, brakes = drives
    lowest, width = columns
    smin, smax, left, right, farthest, nearest, boxes = out
    for b in range(first.size):
        step, base = steps[b], first[b]
        late = ceil(reaction / step - 1e-9)
        late_coast = ceil(max(reaction - coast, 0.0) / step - 1e-9)
        nodes = PARTS + late + 1
        loose = np.zeros((nodes, 3))
        for k in range(nodes):
            for i in range(3):
                d = brakes[i, 0], brakes[i, 1]
                loose[k, i] = slack(v[base + k, i], most_a[base + k, i], step, d, coast)
        before, after = np.empty((2, nodes, 3, 2)), np.empty((2, nodes, 3, 2))
        ends, edges, cell = np.empty((2, nodes, 3, 2)), np.empty((3, 2)), 0
        for n in range(rows[b]):
            before, after = after, before
            for k in range(nodes):
                for i in range(3):
                    for c in range(2):
                        if n <= k:
                            one = other = q[base + n, i]
                        else:
                            t, speed = (n - k) * step, v[base + k, i]
                            gone = min(c * coast, t)
                            one = other = q[base + k, i] + speed * gone
                            one += way(speed, brakes[i, 0], t - gone)
                            other += way(speed, brakes[i, 1], t - gone)
                        after[c, k, i, 0], after[c, k, i, 1] = min(one, other), max(one, other)
                        off = loose[k, i]
                        ends[c, k, i, 0] = min(before[c, k, i, 0], after[c, k, i, 0]) - off
                        ends[c, k, i, 1] = max(before[c, k, i, 1], after[c, k, i, 1]) + off
                    ends[1, k, i, 0] = min(ends[0, k, i, 0], ends[1, k, i, 0])
                    ends[1, k, i, 1] = max(ends[0, k, i, 1], ends[1, k, i, 1])
            for m in range(min(n, PARTS)):
                for i in range(3):
                    least, most = inf, -inf
                    for k in range(m, m + late + 2):
                        c = 1 if k <= m + late_coast + 1 else 0
                        least, most = min(least, ends[c, k, i, 0]), max(most, ends[c, k, i, 1])
                    edges[i, 0], edges[i, 1] = least, most
                    farthest[b] = max(farthest[b], -least, most)
                if cell < boxes.shape[1]:
                    boxes[b, cell] = edges
                    cell += 1
                lo, hi = edges[:, 0], edges[:, 1]
                dmin, dmax = lo[1] - hi[0], hi[1] - lo[0]
                nearest[b] = min(nearest[b], dmin)
                begin, end = np.floor((dmin - lowest) / width), np.floor((dmax - lowest) / width)
                if not (begin >= 0.0 and end < smin.shape[1]):
                    nearest[b] = -inf
                    continue
                rise, fall = 2.0 * (hi[0] - lo[2]), 2.0 * (hi[1] - lo[2])
                down, up = 2.0 * (lo[0] - hi[2]), 2.0 * (lo[1] - hi[2])
                turn, dip = hi[1] - hi[0], lo[1] - lo[0]
                for j in range(int(begin), int(end) + 1):
                    edge = lowest + j * width
                    one, other = max(edge, dmin), min(edge + width, dmax)
                    peak, pit = min(max(turn, one), other), min(max(dip, one), other)
                    top, bottom = min(rise + peak, fall - peak), max(down + pit, up - pit)
                    smin[b, j], smax[b, j] = min(smin[b, j], bottom), max(smax[b, j], top)
                    left[b, j], right[b, j] = min(left[b, j], one), max(right[b, j], other)
