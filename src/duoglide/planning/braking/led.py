"""Where a plan lets a drive that brakes by itself lead the others, so that the platform stays.

Every cycle of the plan is tried for every drive: it leaves the plan there and brakes, the others go
on for ``REACTION`` cycles, and then catch up with it along the path as the streamer has them do
(``control/streamer/led_stop.py``). The platform is off its path by how far that drive is from where
the others put it, times what a millimetre of its carriage moves the platform across the path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.model import jacobian
from duoglide.motion.led_stops import LEAST_STEP, PROMISED, LedStops, catch_up
from duoglide.motion.motion import Motion

REACTION = 2  # cycles from a fault to the others' first setpoint, if a message tells it at once
CATCH_UP = 2.0  # times the stop limits: what a fault may ask of the others, for some cycles
_ALLOWED = 3.0  # [mm] off the path, above which braking apart is as good
_RESERVE = 0.15  # [mm] of what is promised, for servo loops that are asked for so much
_FEWEST = 2.0  # cycles that the drive takes to come to rest; others cannot follow a jolt
_PARTS = 2  # samples in a cycle
_EXTRA = 12  # cycles to catch up in, after the drive has come to rest
_FASTEST = 1.001  # path time per time that following may ask for
_ROUNDING = 1.1  # by which second differences of samples may be above a limit


def led_stops(motion: Motion) -> LedStops:
    """Try every drive at every cycle of a motion."""
    machine = motion.machine
    samples = _Samples.of(motion)
    limits = CATCH_UP * machine.stop_limits.acceleration
    decelerations = machine.drives.quick_stop_deceleration
    allowed = promised = np.zeros(len(samples.carriages[::_PARTS]), dtype=np.uint8)
    for index, deceleration in enumerate(decelerations):
        off = _Trial(samples, index, deceleration, limits).run()
        allowed = allowed | np.asarray((off <= _ALLOWED) << index, dtype=np.uint8)
        promised = promised | np.asarray((off <= PROMISED - _RESERVE) << index, dtype=np.uint8)
    first, second, third = limits.tolist()
    return LedStops(
        decelerations=decelerations,
        limits=(first, second, third),
        step=machine.drives.cycle,
        allowed=allowed.tobytes(),
        promised=promised.tobytes(),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """A motion on an even grid of path time, and two cycles after its end.

    Attributes:
        cycle: Of the drives; there are ``_PARTS`` samples in it [s].
        times: Of the samples [s], (n,).
        carriages: [mm], (n, 3).
        steps: How far each carriage goes in a cycle [mm], (n, 3).
        across: How far a millimetre of each carriage moves the platform across its path [mm],
            (n, 3).
        margin: Carriage margin [mm], (n,).
    """

    cycle: float
    times: FloatArray
    carriages: FloatArray
    steps: FloatArray
    across: FloatArray
    margin: FloatArray

    @classmethod
    def of(cls, motion: Motion) -> _Samples:
        """Sample a motion."""
        machine = motion.machine
        cycle = machine.drives.cycle
        count = (int(np.ceil(motion.duration / cycle)) + 2) * _PARTS
        times = np.linspace(0.0, count * cycle / _PARTS, count + 1)
        state = motion.at(np.minimum(times, motion.duration))
        place = motion.position_at(np.minimum(times, motion.duration))
        moves = np.linalg.inv(jacobian(machine.geometry, place)).astype(np.float64)
        return cls(
            cycle=cycle,
            times=times,
            carriages=state.carriages,
            steps=state.velocity * cycle,
            across=_across(moves, state.velocity),
            margin=carriage_margin(machine.geometry, place),
        )

    def between(self, table: FloatArray, u: FloatArray) -> FloatArray:
        """Interpolate rows of a table (n, ...) at path times [s]."""
        place = np.clip(u / self.cycle * _PARTS, 0.0, len(table) - 1.000001)
        low = place.astype(np.intp)
        share = (place - low).reshape(place.shape + (1,) * (table.ndim - 1))
        result: FloatArray = table[low] * (1.0 - share) + table[low + 1] * share
        return result


def _across(moves: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return how far each carriage moves the platform across its path, per mm, (n, 3)."""
    along = np.einsum("nij,nj->ni", moves, velocity)
    unit = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    with_path = np.einsum("ni,nij->nj", unit, moves)
    sizes: FloatArray = np.linalg.norm(moves - unit[:, :, None] * with_path[:, None], axis=1)
    return sizes


class _Trial:
    """One drive that leaves the plan at the beginning of each of its cycles, all at once.

    Its carriage's place is told by the way that it has gone since the start of the plan, which
    never falls; it may not go on past where the plan turns it round.

    Args:
        samples: The motion.
        index: Of the drive.
        deceleration: What it brakes with [mm/s^2].
        limits: What each carriage may be asked for [mm/s^2], (3,).
    """

    def __init__(
        self, samples: _Samples, index: int, deceleration: float, limits: FloatArray
    ) -> None:
        self._samples, self._index = samples, index
        self._others = [j for j in range(AXES) if j != index]
        self._limits = limits[self._others] * samples.cycle**2  # [mm/cycle^2]
        self._d = deceleration * samples.cycle**2
        places = samples.carriages[:, index]
        self._way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(places)))])
        self._start = self._way[::_PARTS]
        turns = np.flatnonzero(np.diff(np.sign(samples.steps[:, index])))
        ends = np.append(self._way[turns], self._way[-1])
        self._end = ends[np.searchsorted(turns, np.arange(len(places)))][::_PARTS]
        self._v = np.minimum(np.append(self._start[1:], self._start[-1]), self._end) - self._start

    def run(self) -> FloatArray:
        """Return how far off its path the platform gets for each cycle [mm], (n,).

        It is inf where the others cannot follow, or where links might part.
        """
        s, d = self._samples, self._d
        begin = s.times[::_PARTS]
        before, newest = begin + (REACTION - 1) * s.cycle, begin + REACTION * s.cycle
        old, now = s.between(s.carriages, before), s.between(s.carriages, newest)
        good = self._v > max(_FEWEST * d, LEAST_STEP)
        off = self._off(REACTION, newest)
        for cycles in range(REACTION + 1, int(np.ceil(self._v.max() / d)) + REACTION + _EXTRA):
            goal = np.interp(self._gone(cycles), self._way, s.times)
            here = np.abs(s.between(s.steps, goal))
            speed = np.maximum(here[:, self._index], LEAST_STEP)
            pace = np.maximum(self._v - d * cycles, 0.0) / speed * s.cycle
            good &= (self._gone(cycles) < self._end) & (here[:, self._index] > LEAST_STEP)
            good &= pace <= _FASTEST * s.cycle
            most = (self._limits / np.maximum(here[:, self._others], 1e-9)).min(axis=1) * s.cycle
            step = catch_up(goal - newest, newest - before, pace, most)
            before, newest = newest, newest + np.minimum(step, s.cycle)
            old, now, new = now, s.between(s.carriages, newest), old
            asked = now - 2.0 * old + new
            good &= (np.abs(asked[:, self._others]) <= _ROUNDING * self._limits).all(axis=1)
            off = np.maximum(off, self._off(cycles, newest))
        return np.where(good, off, np.inf)

    def _gone(self, cycles: int) -> FloatArray:
        """Return the way that the drive has gone so many cycles after it began to brake [mm]."""
        t = np.minimum(cycles, self._v / self._d)
        gone: FloatArray = self._start + self._v * t - 0.5 * self._d * t * t
        return gone

    def _off(self, cycles: int, u: FloatArray) -> FloatArray:
        """Return how far off its path the platform is [mm], (n,); inf where links might part.

        Args:
            cycles: How long ago the drive began to brake.
            u: Where the others have been put, in path time [s].
        """
        s = self._samples
        behind = np.abs(self._gone(cycles) - np.interp(u, s.times, self._way))
        off = behind * s.between(s.across[:, self._index], u)
        return np.where(behind < s.between(s.margin, u), off, np.inf)
