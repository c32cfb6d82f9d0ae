"""Certify a motion made in carriage space: room at every instant, not only at samples."""

from __future__ import annotations

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import PathError
from duoglide.kinematics.headroom.nearby import Patch, room_on, with_pairs
from duoglide.kinematics.headroom.room import SURE, TOUCHING, locate, room
from duoglide.machine import Machine
from duoglide.motion.path.transfer import TransferPath

FIRST_CELLS = 64
_SHARP = 1e-3  # mm, to which the least clearance is found
_FINEST = 2.0**-40  # No cell is shorter than this share of the duration.


def certify(machine: Machine, path: TransferPath) -> float:
    """Require reach, clearances, travel, carriage order and keep-out along the whole of ``path``.

    Travel and order are extremes of cubic polynomials: exact. Clearance, the carriage margin and
    the distance to keep-out boxes are bounded in cells of time from the carriages' velocity in the
    middle and their largest acceleration (``headroom.nearby``); a cell that is not certain to have
    enough is halved.
    Nothing between two samples is left out.

    Returns:
        The least distance to a singular surface or edge of reach, to 0.001 mm: a lower bound [mm].

    Raises:
        PathError: Where, what and by how much.
    """
    _require_rails(machine, path)
    edges = np.unique(
        np.concatenate([path.breaks, np.linspace(0.0, path.duration, FIRST_CELLS + 1)])
    )
    low, high = edges[:-1], edges[1:]
    seen = sure = np.inf
    while low.size:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        enough = max(seen - _SHARP, SURE) if seen < np.inf else -np.inf
        here, lowest = room_on(machine, _cover_cells(path, middle, half), enough)
        seen = min(seen, float(here.clearance.min()))
        left = np.minimum(np.minimum(here.clearance, here.keep_out), here.carriage_margin)
        if left.min() <= TOUCHING:
            raise _describe_refusal(machine, path, float(middle[np.argmin(left)]))
        open_ = (lowest.clearance < max(seen - _SHARP, SURE)) | (lowest.keep_out < SURE)
        open_ |= lowest.carriage_margin < SURE
        sure = min(sure, float(lowest.clearance[~open_].min(initial=np.inf)))
        low, high = (
            np.concatenate([low[open_], middle[open_]]),
            np.concatenate([middle[open_], high[open_]]),
        )
        if low.size and np.min(high - low) < _FINEST * path.duration:
            raise _describe_refusal(machine, path, float(low[0]))
    return sure + machine.clearance


def keeps(
    machine: Machine, start: FloatArray, end: FloatArray, floor: tuple[float, float, float]
) -> bool:
    """Tell whether a straight way of the carriages keeps some room for certain, at every point.

    Args:
        machine: The machine.
        start: Carriages at the beginning [mm], shape (3,).
        end: The same at the end.
        floor: What is to be left of the clearance, of the distance to keep-out boxes and of the
            carriage margin, beyond what the machine asks for [mm].
    """
    low, high = np.zeros(1), np.ones(1)
    while low.size:
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        ways = (half[:, None] * (end - start))[:, None]
        patch = Patch(start + middle[:, None] * (end - start), ways, np.zeros((low.size, 5)))
        here, lowest = room_on(machine, patch, floor[0])
        kept, sure = (
            np.stack([r.clearance, r.keep_out, r.carriage_margin], axis=-1) >= floor
            for r in (here, lowest)
        )
        if not kept.all():
            return False
        open_ = ~sure.all(axis=-1)
        low, high = (
            np.concatenate([low[open_], middle[open_]]),
            np.concatenate([middle[open_], high[open_]]),
        )
        if low.size and np.min(high - low) < _FINEST:
            return False
    return True


def _cover_cells(path: TransferPath, middle: FloatArray, half: FloatArray) -> Patch:
    """Return where the carriages are in cells of time, each within one piece."""
    states = path.derivatives(middle)
    half = half[:, None]
    most = np.abs(with_pairs(states[:, 2])) + np.abs(with_pairs(states[:, 3])) * half
    return Patch(states[:, 0], (states[:, 1] * half)[:, None], 0.5 * most * half * half)


def _require_rails(machine: Machine, path: TransferPath) -> None:
    """Require travel and carriage order at the extremes of the polynomials."""
    table, spans = path.polynomials, np.diff(path.breaks)
    columns = np.concatenate([table, (table[..., 1] - table[..., 0])[..., None]], axis=-1)
    turns = _find_turning_times(columns, spans[:, None])
    times = np.concatenate([path.breaks, (path.breaks[:-1, None] + turns).ravel()])
    here = room(machine, path.derivatives(times)[:, 0])
    rails = np.minimum(here.travel, here.order)
    if rails.min() <= TOUCHING:
        raise _describe_refusal(machine, path, float(times[np.argmin(rails)]))


def _find_turning_times(columns: FloatArray, spans: FloatArray) -> FloatArray:
    """Return where cubics (n, 4, c) have zero derivative, clipped into their spans, (2, n, c)."""
    _, b, c, d = np.moveaxis(columns, 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(c * c - 3.0 * b * d)
        far = -(c + np.copysign(root, c))
        turns = np.stack([far / (3.0 * d), b / far])
    clipped: FloatArray = np.clip(np.nan_to_num(turns, nan=0.0, posinf=0.0, neginf=0.0), 0.0, spans)
    return clipped


def _describe_refusal(machine: Machine, path: TransferPath, time: float) -> PathError:
    """Say what fails at ``time``, and how far along the platform's path that is."""
    before = np.linspace(0.0, time, 257)
    carriages = path.derivatives(before)[:, 0]
    position, closed = locate(machine, carriages)
    steps = np.linalg.norm(np.diff(position, axis=0), axis=-1)
    along = float(np.nansum(steps))
    _, quantity, amount = room(machine, carriages[-1:]).worst()
    if not closed[-1]:
        last = position[:-1][closed[:-1]][-1:]
        near = ", ".join(f"{v:.6g}" for v in (last[0] if last.size else position[0]))
        return PathError(
            f"the carriages' way crosses a singularity {along:.6g} mm along, near ({near}) mm",
            arc_length=along,
            position=(last[0] if last.size else position[0]).tolist(),
            quantity="reach",
        )
    where = ", ".join(f"{v:.6g}" for v in position[-1])
    return PathError(
        f"{quantity} is {-amount:.6g} mm too small {along:.6g} mm along, at ({where}) mm",
        arc_length=along,
        position=position[-1].tolist(),
        quantity=quantity,
        amount=-amount,
    )
