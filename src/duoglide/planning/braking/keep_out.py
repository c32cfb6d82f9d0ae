"""How far keep-out boxes stay away while the carriages are somewhere in boxes of their own."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray, IndexArray
from duoglide.kinematics.headroom.nearby import Patch, room_on
from duoglide.planning.braking.blocks import Blocks
from duoglide.planning.tolerances import PICOMETRE

_CUTS = 9  # of a box into halves, at most: three of each side


def keep_out_of(blocks: Blocks) -> FloatArray:
    """Bound the distance to the nearest keep-out box in each block [mm], shape (n,); inf for none.

    What need not be known exactly is not: a box that is not even beside the platform along the
    rails is as far away as that.
    """
    machine = blocks.bounds.motion.machine
    least = np.full(len(blocks), np.inf)
    if not machine.keep_out:
        return least
    boxes = blocks.boxes()
    owner, cell = np.nonzero(np.isfinite(boxes).all(axis=(2, 3)))
    least[~np.isfinite(boxes[..., 0, 0]).any(axis=1)] = -np.inf
    boxes = boxes[owner, cell]
    for cut in range(_CUTS + 1):
        middle, half = boxes.mean(axis=2), 0.5 * (boxes[..., 1] - boxes[..., 0])
        along, off = middle[:, :2].mean(axis=1), half[:, :2].mean(axis=1)
        aside = np.min(
            [np.maximum(b.low[1] - along, along - b.high[1]) - off for b in machine.keep_out],
            axis=0,
        )
        near = aside <= PICOMETRE
        np.minimum.at(least, owner[~near], aside[~near])
        owner, boxes, middle, half = owner[near], boxes[near], middle[near], half[near]
        if not owner.size:
            break
        ways = half[:, :, None] * np.eye(3)
        _, lowest = room_on(machine, Patch(middle, ways, np.zeros((len(half), 5))), -np.inf)
        found = np.nan_to_num(lowest.keep_out, nan=-np.inf, neginf=-np.inf)
        closed = (found > PICOMETRE) | (cut == _CUTS)
        np.minimum.at(least, owner[closed], found[closed])
        owner, boxes = _halves(owner[~closed], boxes[~closed])
    return least


def _halves(owner: IndexArray, boxes: FloatArray) -> tuple[IndexArray, FloatArray]:
    """Cut boxes (n, 3, 2) in two along their longest sides; their owners (n,) with them."""
    rows = np.arange(len(boxes))
    longest = (boxes[..., 1] - boxes[..., 0]).argmax(axis=1)
    low, high = boxes.copy(), boxes.copy()
    middle = boxes[rows, longest].mean(axis=1)
    low[rows, longest, 1] = middle
    high[rows, longest, 0] = middle
    return np.concatenate([owner, owner]), np.concatenate([low, high])
