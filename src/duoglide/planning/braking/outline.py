"""How clear the platform stays while D and S are somewhere in a footprint.

In the plane of D and S, a footprint is one interval of S for each column of D. The links close for
one interval of S at each D, so where they close all along the outline they close everywhere inside.
The clearance is a distance to surfaces; it has no least value but on these: going straight to the
nearest point of a surface makes it smaller. So the least clearance is on the outline too, and only
that is looked at: cut into short ways, each bounded to the second order (``headroom.nearby``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import BoolArray, FloatArray, IndexArray
from duoglide.kinematics.headroom.nearby import Patch, room_on
from duoglide.planning.braking.blocks import (
    Footprint,
    column_width,
    lowest_column,
)

Points: TypeAlias = tuple[NDArray[np.floating[Any]], NDArray[np.floating[Any]]]  # D and S [mm]


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Short straight ways along the outlines of footprints.

    Attributes:
        row: Which footprint each belongs to, shape (n,).
        ends: D and S at both ends [mm], shape (n, 2, 2).
    """

    row: IndexArray
    ends: FloatArray

    @classmethod
    def of(cls, prints: Footprint) -> Outline:
        """Go round every footprint once."""
        width, low = column_width(prints.machine), lowest_column(prints.machine)
        here = np.pad(prints.smin <= prints.smax, ((0, 0), (1, 1)))
        edge = np.broadcast_to(low + width * np.arange(here.shape[1] - 1), here[:, 1:].shape)
        edge = np.where(here[:, :-1], edge, np.pad(prints.left, ((0, 0), (0, 1))))
        edge = np.where(here[:, 1:], edge, np.pad(prints.right, ((0, 0), (1, 0))))
        row, column = np.nonzero(here[:, 1:-1])
        left, right = edge[row, column], edge[row, column + 1]
        along = [
            _ways((left, side[row, column]), (right, side[row, column]))
            for side in (prints.smin, prints.smax)
        ]
        across = [_steps(here, prints.smin, prints.smax), _steps(here, prints.smax, prints.smin)]
        rows, ends = [row, row], list(along)
        for edge_row, edge_column, start, end in across:
            pieces = np.maximum(np.ceil(np.abs(end - start) / width), 1.0).astype(np.intp)
            which = np.repeat(np.arange(pieces.size), pieces)
            part = np.arange(which.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
            step = ((end - start) / pieces)[which]
            at = edge[edge_row, edge_column][which], start[which] + part * step
            rows.append(edge_row[which])
            ends.append(_ways(at, (at[0], at[1] + step)))
        return cls(np.concatenate(rows), np.concatenate(ends))

    def patch(self) -> Patch:
        """Return the carriages along each way, with the platform at y = 0."""
        middle, half = self.ends.mean(axis=1), 0.5 * (self.ends[:, 1] - self.ends[:, 0])
        return Patch(carriages_of(middle), carriages_of(half)[:, None], np.zeros((len(half), 5)))


def _ways(start: Points, end: Points) -> FloatArray:
    """Return straight ways between points, given as D and S of (n,) each, shape (n, 2, 2)."""
    return np.stack([np.stack(start, axis=-1), np.stack(end, axis=-1)], axis=1)


def carriages_of(plane: FloatArray) -> FloatArray:
    """Return the carriages that have D and S (n, 2), with carriages 1 and 2 about 0, (n, 3)."""
    D, S = plane.T
    return np.stack([-0.5 * D, 0.5 * D, -0.5 * S], axis=-1)


def _steps(
    inside: BoolArray, side: FloatArray, other: FloatArray
) -> tuple[IndexArray, IndexArray, FloatArray, FloatArray]:
    """Return where one side of footprints steps between columns; at their ends, to the other side.

    Args:
        inside: Which columns have something in them, with one more column at each end.
        side: S of this side in each column.
        other: S of the other.

    Returns:
        Row and column at whose left edge the step is, and its S before and after.
    """
    pad = ((0, 0), (1, 1))
    one, two = np.pad(side, pad), np.pad(other, pad)
    row, edge = np.nonzero(inside[:, 1:] | inside[:, :-1])
    left, right = inside[row, edge], inside[row, edge + 1]
    start = np.where(left, one[row, edge], two[row, edge + 1])
    end = np.where(right, one[row, edge + 1], two[row, edge])
    return row, edge, start, end


def clearance_of(prints: Footprint, enough: float) -> tuple[FloatArray, FloatArray]:
    """Bound the clearance beyond ``machine.clearance`` in footprints.

    Args:
        prints: The footprints.
        enough: What need not be bounded sharply [mm].

    Returns:
        Its least value in each [mm], -inf where the links may come apart, shape (n,); and D and S
        of the worst place of each, shape (n, 2).
    """
    outline = Outline.of(prints)
    _, lowest = room_on(prints.machine, outline.patch(), enough)
    found = np.nan_to_num(lowest.clearance, nan=-np.inf, neginf=-np.inf)
    order = np.lexsort((found, outline.row))
    first = order[np.unique(outline.row[order], return_index=True)[1]]
    least, where = np.full(len(prints), -np.inf), np.full((len(prints), 2), np.nan)
    least[outline.row[first]] = found[first]
    where[outline.row[first]] = outline.ends[first].mean(axis=1)
    least[np.isinf(prints.nearest)] = -np.inf
    return least, where
