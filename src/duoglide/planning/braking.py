"""Brake safety: whenever every drive brakes by itself, reach and clearance must be kept.

If the host dies, each drive goes on for at most one cycle at the velocity of its last setpoint (it
bridges one lost setpoint) and then brakes at its own quick-stop deceleration (0x6085). The
carriages stop at different times, so the platform leaves its path. Where it then goes depends on
where the brake begins and how fast the carriages are, not on how the plan would have gone on: so
each point of the path has its largest safe speed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.machine import Machine
from duoglide.motion.trajectory import Trajectory
from duoglide.planning._admissible import locate, room

ALLOWED = 1e-3  # mm that rounding and sampling may take from a bound
_CELL = 0.004  # s of the plan, at the least
_STEP = 10.0  # mm of a carriage, which a cell may be as well
_FEWEST = 8
_PHASES = 6  # cells of the time from brake to standstill
_ZOOMS = 3
_NEAR = np.array([-2.0, -1.0, 0.0, 1.0, 2.0]) / 2.0  # of half a cell
_FINE = 0.05  # mm: below this, a cell is as good as its middle
_BEND = 1.5  # how much farther than its corners a cell may reach from its middle
_CHUNK = 4_000  # cells of the plan at a time
_CORNERS = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class BrakeReport:
    """What happens at the worst when every drive brakes by itself.

    Attributes:
        clearance: Least distance to a singular surface or edge of reach while braking [mm]; -inf
            where the links come apart.
        room: Least of what is left of clearance, travel, order and keep-out distance [mm].
        quantity: Of which of them that is.
        time: When that brake begins [s].
        after: How long after that the least room is reached [s].
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
        """Whether everything that the machine asks for is kept."""
        return self.room > -ALLOWED


@dataclass(frozen=True, slots=True, eq=False)
class Brakes:
    """Brakes of all three drives at once, each by itself.

    Attributes:
        machine: Whose drives brake.
        q: Carriages when the brake begins [mm], shape (n, 3).
        v: Their velocities then [mm/s], shape (n, 3).
        coast: How long they go on at these velocities first [s], shape (n,).
    """

    machine: Machine
    q: FloatArray
    v: FloatArray
    coast: FloatArray

    @property
    def slowing(self) -> FloatArray:
        """How long each carriage takes to stop, (n, 3)."""
        deceleration = np.array(self.machine.drives.quick_stop_deceleration, dtype=np.float64)
        times: FloatArray = np.abs(self.v) / deceleration
        return times

    @property
    def lasting(self) -> FloatArray:
        """How long it takes until all stand, (n,)."""
        times: FloatArray = self.coast + self.slowing.max(axis=-1)
        return times

    def at(self, fraction: FloatArray) -> FloatArray:
        """Return carriages after fractions (n,) of the time until all stand, shape (n, 3)."""
        tau, coast = (fraction * self.lasting)[:, None], self.coast[:, None]
        slowing = self.slowing
        braked = np.clip(tau - coast, 0.0, slowing)
        share = np.divide(braked, slowing, out=np.zeros_like(slowing), where=slowing > 0.0)
        return self.q + self.v * (np.minimum(tau, coast) + braked * (1.0 - 0.5 * share))


def brake_report(trajectory: Trajectory) -> BrakeReport:
    """Look at every instant of every brake out of every instant of ``trajectory``.

    Cells of (instant of the plan, share of the brake) are halved until the room in the middle
    exceeds 1.5 times the way from there to the farthest corner, or the cell is below 0.05 mm. In a
    plan that is not safe, only cells that may be worse than the worst so far are looked into.
    """
    worst: BrakeReport | None = None
    duration = trajectory.duration
    speeds = np.abs(trajectory.at(np.linspace(0.0, duration, 101)).velocity)
    longest = max(_CELL, _STEP / max(float(speeds.max()), 1e-300))
    count = max(_FEWEST, int(np.ceil(duration / longest)))
    edges = np.linspace(0.0, duration, count + 1)
    for begin in range(0, count, _CHUNK):
        found = _look(trajectory, edges[begin : begin + _CHUNK + 1])
        clearance = min(found.clearance, worst.clearance if worst else np.inf)
        if worst is None or found.room < worst.room:
            worst = found
        worst = replace(worst, clearance=clearance)
    assert worst is not None
    return worst


def _look(trajectory: Trajectory, edges: FloatArray) -> BrakeReport:
    """Look at the brakes that begin within ``edges``, at once or one cycle late."""
    machine = trajectory.machine
    middles = 0.5 * (edges[1:] + edges[:-1])
    phases = (np.arange(_PHASES) + 0.5) / _PHASES
    grid = np.meshgrid(middles, phases, [0.0, machine.drives.cycle], indexing="ij")
    t, f, coast = (axis.ravel() for axis in grid)
    half = np.array([0.5 * (edges[1] - edges[0]), 0.5 / _PHASES])
    worst: BrakeReport | None = None
    clearance, place = np.inf, np.zeros(5)
    while t.size:
        middle = _brakes(trajectory, t, coast).at(f)
        centre, _ = locate(machine, middle)
        here = room(machine, middle)
        nearest = int(np.argmin(here.clearance))
        if here.clearance[nearest] < clearance:
            clearance = float(here.clearance[nearest])
            place = np.array([t[nearest], f[nearest], coast[nearest], *half])
        index, quantity, amount = here.worst()
        if worst is None or amount < worst.room:
            x, y, z = centre[index].tolist()
            brake = _brakes(trajectory, t[[index]], coast[[index]])
            worst = BrakeReport(
                clearance=amount,
                room=amount,
                quantity=quantity,
                time=float(t[index]),
                after=float(f[index] * brake.lasting[0]),
                position=(x, y, z),
            )
        if worst.room == -np.inf:
            break  # the links come apart: nothing can be worse
        across, moved, slid = _spread(trajectory, (t, f, coast), half, middle)
        lowest = np.min(
            [
                here.clearance - _BEND * across,
                here.keep_out - _BEND * moved,
                here.travel - _BEND * slid,
                here.order - 2.0 * _BEND * slid,
            ],
            axis=0,
        )
        open_ = (lowest < min(worst.room, 0.0)) & (np.maximum(moved, slid) > _FINE)
        half = 0.5 * half
        t = np.concatenate([t[open_] + sx * half[0] for sx, _ in _CORNERS])
        f = np.concatenate([f[open_] + sy * half[1] for _, sy in _CORNERS])
        coast = np.tile(coast[open_], len(_CORNERS))
    assert worst is not None
    clearance = min(clearance, _zoomed(trajectory, place)) if np.isfinite(clearance) else -np.inf
    return replace(worst, clearance=clearance + machine.clearance)


def _zoomed(trajectory: Trajectory, place: FloatArray) -> float:
    """Look more closely around the least clearance: instant, phase, coast, half a cell of each."""
    least = np.inf
    t, f, coast, *half = place.tolist()
    for _ in range(_ZOOMS):
        grid = np.meshgrid(t + half[0] * _NEAR, f + half[1] * _NEAR, indexing="ij")
        ts = np.clip(grid[0].ravel(), 0.0, trajectory.duration)
        fs = np.clip(grid[1].ravel(), 0.0, 1.0)
        brakes = _brakes(trajectory, ts, np.full(ts.size, coast))
        found = room(trajectory.machine, brakes.at(fs)).clearance
        index = int(np.argmin(found))
        least = min(least, float(found[index]))
        t, f = float(ts[index]), float(fs[index])
        half = [0.5 * half[0], 0.5 * half[1]]
    return least


def _spread(
    trajectory: Trajectory,
    cells: tuple[FloatArray, FloatArray, FloatArray],
    half: FloatArray,
    middle: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how far platform and carriages are at each cell's farthest corner, (n,) each.

    The platform's way counts across the rails first, which is all that clearance depends on; then
    in full.
    """
    t, f, coast = cells
    centre, _ = locate(trajectory.machine, middle)
    across, moved, slid = np.zeros((3, t.size))
    for side in (-1.0, 1.0):
        brakes = _brakes(trajectory, t + side * half[0], coast)
        for end in (-1.0, 1.0):
            corner = brakes.at(f + end * half[1])
            position, closed = locate(trajectory.machine, corner)
            way = np.where(closed[:, None], position - centre, np.inf)
            across = np.maximum(across, np.linalg.norm(way[:, ::2], axis=-1))
            moved = np.maximum(moved, np.linalg.norm(way, axis=-1))
            slid = np.maximum(slid, np.abs(corner - middle).max(axis=-1))
    return across, moved, slid


def _brakes(trajectory: Trajectory, t: FloatArray, coast: FloatArray) -> Brakes:
    state = trajectory.at(t)
    return Brakes(trajectory.machine, state.carriages, state.velocity, coast)
