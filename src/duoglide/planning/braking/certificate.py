"""Brake safety: whichever drives begin to brake by themselves, and whenever the others follow.

A drive that faults, or loses its host, leaves the plan and brakes at its own deceleration (0x6085,
within ``drives.quick_stop_tolerance``), at once or after it has gone on for a cycle at its last
velocity, as it does where a setpoint is missing. The others go on along the plan until they react,
each at a time of its own within ``machine.reaction_cycles``. The platform leaves its path, and
wherever it goes the machine's clearance, carriage margin, travel, order and keep-out boxes must be
kept.

The report is a certificate: every subset of the drives, all times and all decelerations between
their bounds are covered, and nothing rests on samples. In each cell of (instant at which the first
drive leaves the plan, time since) every carriage is in an interval of its own, whatever the others
do (``kernel``); where all of these may take the platform is bounded together (``outline``).

Not covered is a carriage that stops harder than its drive brakes: one that jams, or that a holding
brake catches, stands at once. Nor is a drive that coasts without torque.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.kinematics.headroom.room import locate
from duoglide.motion.motion import Motion
from duoglide.planning.braking.blocks import Blocks, Footprint
from duoglide.planning.braking.carriage_bounds import CarriageBounds
from duoglide.planning.braking.keep_out import keep_out_of
from duoglide.planning.braking.margin import margin_of
from duoglide.planning.braking.outline import clearance_of

ALLOWED = 1e-3  # mm that rounding and bounding may take from what the machine asks for
_CHUNK = 256  # blocks that are looked at together


@dataclass(frozen=True, slots=True, kw_only=True)
class BrakeReport:
    """What happens at the worst when drives brake by themselves.

    Attributes:
        clearance: Least distance to a singular surface or edge of reach while braking [mm]: a lower
            bound, certain between samples too; -inf where the links may come apart.
        carriage_margin: Likewise, the least carriage margin [mm].
        room: Least of what is left of clearance, carriage margin, travel, order and keep-out
            distance [mm], a lower bound as well.
        quantity: Of which of them that is.
        time: Path time at which the worst stop begins, about [s].
        position: Where the platform is at the worst, about [mm]; NaN where that is not known.
        unsafe: Parts of path time in which a stop may begin that does not keep everything [s],
            shape (n, 2).
    """

    clearance: float
    carriage_margin: float
    room: float
    quantity: str
    time: float
    position: tuple[float, float, float]
    unsafe: FloatArray

    @property
    def safe(self) -> bool:
        """Whether everything that the machine asks for is kept for certain, to 0.001 mm."""
        return self.room > -ALLOWED


def brake_report(motion: Motion) -> BrakeReport:
    """Bound the room at every instant of every drive stop out of every instant of ``motion``."""
    blocks = Blocks.cover(CarriageBounds.of(motion))
    worst = _Worst(motion)
    for begin in range(0, len(blocks), _CHUNK):
        worst.look(blocks[begin : begin + _CHUNK])
    return worst.report()


QUANTITIES = ("clearance", "travel", "order", "keep_out", "carriage_margin")


@dataclass(frozen=True, slots=True, eq=False)
class Left:
    """What is left in blocks of a plan.

    Attributes:
        amounts: Lower bounds in the order of ``QUANTITIES`` [mm], shape (5, n).
        plane: D and S where it is least: the clearance, or the carriage margin if less is left of
            that [mm], shape (n, 2).
    """

    amounts: FloatArray
    plane: FloatArray

    @property
    def least(self) -> FloatArray:
        """The least of them, shape (n,)."""
        least: FloatArray = self.amounts.min(axis=0)
        return least

    def __getitem__(self, rows: BoolArray) -> Left:
        return Left(self.amounts[:, rows], self.plane[rows])


def left_in(prints: Footprint, keep_out: FloatArray) -> Left:
    """Bound what is left in each of some footprints (n,), given what is of keep-out boxes."""
    (clear, near), (free, tight) = clearance_of(prints, 0.0), margin_of(prints)
    amounts = np.stack([clear, *prints.rails(), keep_out, free])
    return Left(amounts, np.where((free < clear)[:, None], tight, near))


def is_safe(blocks: Blocks) -> BoolArray:
    """Tell which blocks keep everything for certain, without cutting them, shape (n,)."""
    return np.asarray(left_in(blocks.footprint(), keep_out_of(blocks)).least > -ALLOWED)


class _Worst:
    """Looks for the least room.

    Args:
        motion: Whose drives stop.
    """

    def __init__(self, motion: Motion) -> None:
        self._motion = motion
        self._least = dict.fromkeys(QUANTITIES, np.inf)
        self._room, self._quantity, self._time = np.inf, QUANTITIES[0], 0.0
        self._position = (np.nan, np.nan, np.nan)
        self._unsafe: list[FloatArray] = []

    def look(self, blocks: Blocks) -> None:
        """Look at all blocks at once; where that is not enough at each, and cut those that fail."""
        prints, keep_out = blocks.footprint(), keep_out_of(blocks)
        together = left_in(prints.merged(), keep_out.min(keepdims=True))
        if together.least[0] > -ALLOWED:
            self._note(together, np.array([blocks.start[prints.nearest_to(together.plane[0])]]))
            return
        left = left_in(prints, keep_out)
        open_ = left.least <= -ALLOWED
        again = open_ & blocks.may_be_cut()
        if not again.all():
            self._note(left[~again], blocks.start[~again])
        over = open_ & ~again
        self._unsafe.append(np.stack([blocks.start[over], blocks.end[over]], axis=-1))
        if again.any():
            self.look(blocks[again].cut())

    def _note(self, left: Left, times: FloatArray) -> None:
        """Remember the worst; ``times`` are those at which the stops begin [s], shape (n,)."""
        for quantity, amounts in zip(QUANTITIES, left.amounts, strict=True):
            self._least[quantity] = min(self._least[quantity], float(amounts.min()))
        index = int(np.argmin(left.least))
        if left.least[index] < self._room:
            self._room = float(left.least[index])
            self._quantity = QUANTITIES[int(np.argmin(left.amounts[:, index]))]
            self._time = float(times[index])
            self._position = self._place(left.plane[index])

    def _place(self, plane: FloatArray) -> tuple[float, float, float]:
        """Return where the platform is at D and S, as far along the rails as at the time noted."""
        y = float(self._motion.position_at(self._time)[1])
        D, S = plane.tolist()
        position, _ = locate(self._motion.machine, np.array([y - D / 2, y + D / 2, y - S / 2]))
        here, along, up = position.tolist()
        return here, along, up

    def report(self) -> BrakeReport:
        """Say what was found."""
        unsafe = np.concatenate(self._unsafe) if self._unsafe else np.zeros((0, 2))
        return BrakeReport(
            clearance=self._least["clearance"] + self._motion.machine.clearance,
            carriage_margin=self._least["carriage_margin"] + self._motion.machine.carriage_margin,
            room=self._room,
            quantity=self._quantity,
            time=self._time,
            position=self._position,
            unsafe=unsafe[np.argsort(unsafe[:, 0])],
        )
