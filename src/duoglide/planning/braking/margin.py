"""How much of the carriage margin is left while D and S are somewhere in a footprint.

In each column a footprint is a rectangle, and b = D - l3 and g = -S/2 are its sides. Each obstacle
of the region in which the links close goes on without end in one direction of b and in one of g
(``kinematics._joint_region``), so the nearest to it is always a corner of the rectangle. Obstacles
change their directions where the arm's foot is level with B3; a rectangle that reaches over that is
cut there. Nothing rests on samples.
"""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.carriage_margin import fold_of
from duoglide.kinematics.headroom.room import carriage_room, locate
from duoglide.planning.braking.blocks import Footprint
from duoglide.planning.braking.outline import carriages_of


def margin_of(prints: Footprint) -> tuple[FloatArray, FloatArray]:
    """Bound the carriage margin beyond ``machine.carriage_margin`` in footprints.

    Returns:
        Its least value in each [mm], at most ``PLENTY``, -inf where the links may come apart and
        +inf where the machine asks for none, shape (n,); and D and S of the worst corner of each,
        shape (n, 2).
    """
    machine, count = prints.machine, len(prints)
    if machine.carriage_margin == 0.0:
        return np.full(count, np.inf), np.full((count, 2), np.nan)
    row, column = np.nonzero(prints.smin <= prints.smax)
    sides = [prints.left[row, column], prints.right[row, column]]
    fold = fold_of(machine.geometry)
    if fold < np.inf:
        sides.append(np.clip(machine.geometry.coupler_length + fold, *sides))
    plane = [(D, side[row, column]) for D in sides for side in (prints.smin, prints.smax)]
    corners = np.concatenate([np.stack(place, axis=-1) for place in plane])
    row = np.tile(row, len(plane))
    position, closed = locate(machine, carriages_of(corners))
    found = carriage_room(machine, position, closed)
    order = np.lexsort((found, row))
    owner, first = np.unique(row[order], return_index=True)
    least, where = np.full(count, -np.inf), np.full((count, 2), np.nan)
    least[owner], where[owner] = found[order[first]], corners[order[first]]
    least[np.isinf(prints.nearest)] = -np.inf
    return least, where
