"""Brake safety: whenever every drive brakes by itself, reach and clearance must be kept.

If the host dies, each drive goes on for at most one cycle at the velocity of its last setpoint (it
bridges one lost setpoint) and then brakes at its own quick-stop deceleration (0x6085). The
carriages stop at different times, so the platform leaves its path. Where it then goes depends on
where the drives begin to brake and how fast the carriages are, not on how the plan would have gone
on: so each point of the path has its largest safe speed.

The report is a certificate: stops between two samples are bounded, not guessed. Cells of (instant
of the last setpoint, time until all brake, time since) are cut until the room that each is certain
to keep is enough, and near the least room of all samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.kinematics.headroom.nearby import room_on
from duoglide.kinematics.headroom.room import Room, locate, room
from duoglide.machine import Machine
from duoglide.motion.motion import Motion
from duoglide.planning.braking.carriage_bounds import CarriageBounds
from duoglide.planning.braking.cells import PARTS, BrakeCells, DriveStops
from duoglide.planning.compare import first_least, whole
from duoglide.planning.tolerances import CHUNK, NANOMETRE

__all__ = ["ALLOWED", "BrakeReport", "DriveStops", "brake_report"]

ALLOWED = 1e-3  # mm that rounding and bounding may take from what the machine asks for
_CELL = 0.004  # s of the plan, at the least
_STEP = 1.0 / 16.0  # A cell may be as long as a carriage takes for this share of a leg's length.
_FEWEST = 8
_PHASES = 3  # The time from the start of a stop to standstill is cut into so many cells.
_SHARP = 0.02  # The least clearance is found to this share of it.
_SMALL = 1.0 / 160.0  # Below this share of a leg's length, a clearance is found no more sharply.
_DESCENTS = 3
_AROUND = np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, 5)], indexing="ij"), axis=-1).reshape(
    -1, 3
)
_BLUNT = 1.0 / 320.0  # Where the plan is not safe anyway, this share of a leg's length is enough.
_MOST = 200_000  # cells that are looked at in one chunk
_PATIENT = 60_000  # After so many cells, only whether all is kept still counts.


@dataclass(frozen=True, slots=True, kw_only=True)
class BrakeReport:
    """What happens at the worst when every drive brakes by itself.

    Attributes:
        clearance: Least distance to a singular surface or edge of reach while braking [mm]: a lower
            bound, certain between samples too; -inf where the links come apart.
        room: Least of what is left of clearance, travel, order and keep-out distance [mm], a lower
            bound as well.
        quantity: Of which of them that is.
        time: When the worst stop that was seen begins [s].
        after: How long after that its least room is reached [s].
        position: Where the platform is then [mm]; NaN where the links come apart.
    """

    clearance: float
    room: float
    quantity: str
    time: float
    after: float
    position: tuple[float, float, float]

    @property
    def safe(self) -> bool:
        """Whether everything that the machine asks for is kept for certain, to 0.001 mm."""
        return self.room > -ALLOWED


def brake_report(motion: Motion) -> BrakeReport:
    """Bound the room at every instant of every drive stop out of every instant of ``motion``.

    In a safe plan, the bounds are within 2 % of the clearance of the truth, or 1/8000 of the leg's
    length if that is more; right beside a singularity, where that would take very many cells, they
    say only that all is kept. A plan for which not even that is found out counts as unsafe.
    """
    duration = motion.duration
    speeds = np.abs(motion.at(np.linspace(0.0, duration, 101)).velocity)
    step = _STEP * motion.machine.geometry.leg_length
    longest = max(_CELL, step / max(float(speeds.max()), 1e-300))
    count = max(_FEWEST, whole(duration / longest))
    edges = np.linspace(0.0, duration, count + 1)
    bounds = CarriageBounds.of(motion)
    search = _Search(motion.machine)
    for begin in range(0, count, CHUNK):
        search.look(BrakeCells.cover(bounds, edges[begin : begin + CHUNK + 1], _PHASES))
    return search.report()


class _Search:
    """Looks for the least room: what samples have, and what is certain.

    Args:
        machine: Whose drives stop.
    """

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._size = machine.geometry.leg_length  # of the machine: what all resolution is part of
        self._seen = self._seen_clear = np.inf  # least room, and room of clearance, of all samples
        self._sure = self._sure_clear = np.inf  # the same, certain for all cells that were closed
        self._quantity, self._time, self._after = "clearance", 0.0, 0.0
        self._position = (np.nan, np.nan, np.nan)
        self._patient = True  # whether there is time for more than whether it is safe

    def look(self, cells: BrakeCells) -> None:
        """Cut cells until each is certain to have about the least room that was seen, or more."""
        left = _MOST
        self._patient = True
        while len(cells) and self._seen > -np.inf:
            left -= len(cells)
            patch = cells.patch()
            here, lowest = room_on(self._machine, patch, self._clear_enough())
            self._note(here, cells.times, patch.middle)
            if left + len(cells) == _MOST:
                self._descend(cells, int(first_least(here.clearance)))
            least, clear = (
                np.where(np.isnan(v), -np.inf, v) for v in (lowest.least(), lowest.clearance)
            )
            open_ = (least < self._enough()) | (clear < self._clear_enough())
            spent = _MOST - left + PARTS * int(open_.sum())
            self._patient = spent < _PATIENT
            if spent < (_MOST if self._seen > -ALLOWED else _PATIENT):
                open_ &= ~(patch.reach()[:, :3].max(axis=-1) <= NANOMETRE)
            else:
                open_[:] = False
            self._sure = min(self._sure, float(least[~open_].min(initial=np.inf)))
            self._sure_clear = min(self._sure_clear, float(clear[~open_].min(initial=np.inf)))
            cells = cells.cut(np.flatnonzero(open_), patch)

    def report(self) -> BrakeReport:
        """Say what was found."""
        apart = self._seen == -np.inf
        clear = -np.inf if apart else self._sure_clear + self._machine.clearance
        return BrakeReport(
            clearance=clear,
            room=min(self._seen, self._sure),
            quantity=self._quantity,
            time=self._time,
            after=self._after,
            position=self._position,
        )

    def _note(self, here: Room, times: FloatArray, carriages: FloatArray) -> None:
        """Remember the worst sample.

        Args:
            here: Room of samples.
            times: When their stops begin, and since when, in two parts, shape (n, 3).
            carriages: Where they are, shape (n, 3).
        """
        index, quantity, amount = here.worst()
        self._seen_clear = min(self._seen_clear, float(here.clearance.min()))
        if amount < self._seen:
            self._seen, self._quantity = amount, quantity
            self._time, self._after = float(times[index, 0]), float(times[index, 1:].sum())
            x, y, z = locate(self._machine, carriages[index])[0].tolist()
            self._position = (x, y, z)

    def _descend(self, cells: BrakeCells, index: int) -> None:
        """Sample about the middle of a cell, nearer and nearer to where the clearance is least.

        The sooner samples come near the least, the fewer cells have to be cut.
        """
        place, step = cells.times[index], cells.sides[index]
        for _ in range(_DESCENTS):
            times = cells.within(place + _AROUND * step)
            carriages = cells.carriages_at(times)
            here = room(self._machine, carriages)
            self._note(here, times, carriages)
            place, step = times[first_least(here.clearance)], 0.4 * step

    def _enough(self) -> float:
        """Return the room above which a cell is closed."""
        if self._seen <= -ALLOWED:
            return self._seen - _BLUNT * self._size
        return self._just_below(self._seen, self._seen if self._patient else np.inf)

    def _clear_enough(self) -> float:
        """Return the clearance, beyond what is asked for, above which a cell is closed."""
        if self._seen <= -ALLOWED:
            return self._seen - _BLUNT * self._size
        size = self._seen_clear + self._machine.clearance
        return self._just_below(self._seen_clear, size if self._patient else np.inf)

    def _just_below(self, seen: float, size: float) -> float:
        """Return a little less than was seen; still enough, or still allowed, if that was."""
        if np.isinf(seen):
            return -np.inf
        floor = 0.0 if seen >= ALLOWED else min(seen - 0.05 * ALLOWED, -0.9 * ALLOWED)
        return max(seen - _SHARP * max(size, _SMALL * self._size), floor)
