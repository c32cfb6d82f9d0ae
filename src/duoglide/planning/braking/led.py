"""Where a plan lets a drive that brakes by itself lead the others, so that the platform stays.

Every cycle of the plan is tried for every drive: it leaves the plan there and brakes, as hard and
as gently as ``quick_stop_tolerance`` says; the others go on for ``REACTION`` cycles, and then catch
up with it along the path as the streamer has them do (``control/streamer/led_stop.py``). The
platform is off its path by how far that drive is from where the others put it, times what a
millimetre of its carriage moves the platform across the path.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np

from duoglide.arrays import AXES, BoolArray, FloatArray
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.model import jacobian
from duoglide.motion.led_stops import LEAST_STEP, PROMISED, LedStops, catch_up
from duoglide.motion.motion import Motion

REACTION = 2  # cycles from a fault to the others' first setpoint, if a message tells it at once
CATCH_UP = 2.0  # times the stop limits: what a fault may ask of the others, for some cycles
_ALLOWED = 3.0  # [mm] off the path, above which braking apart is as good
_RESERVE = 0.2  # [mm] of what is promised, for servo loops that are asked for so much
_TURN = 0.5  # [mm] that the drive stays away from where its plan turns it round: no path beyond
_FEWEST = 2.0  # cycles that the drive takes to come to rest; others cannot follow a jolt
_PARTS = 2  # samples in a cycle
_CHUNK = 2000  # cycles that are tried together
_EXTRA = 12  # cycles to catch up in, after the drive has come to rest
_FASTEST = 0.95  # path time per time that following may ask for; behind a drive that brakes no
# harder than the plan nothing can be made up for, as path time is never faster than planned
_ROUNDING = 1.1  # by which second differences of samples may be above a limit


def led_stops(motion: Motion) -> LedStops:
    """Try every drive at every cycle of a motion."""
    machine = motion.machine
    samples = _Samples.of(motion)
    limits = CATCH_UP * machine.stop_limits.acceleration
    decelerations = machine.drives.quick_stop_deceleration
    off_by = machine.drives.quick_stop_tolerance
    allowed = promised = np.zeros(len(samples.carriages[::_PARTS]), dtype=np.uint8)
    for index, deceleration in enumerate(decelerations):
        off = np.maximum(
            *(
                _Trial(samples, index, deceleration * share, limits).run()
                for share in (1.0 - off_by, 1.0 + off_by)
            )
        )
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
        self._begin, self._start = samples.times[::_PARTS], self._way[::_PARTS]
        turns = np.flatnonzero(np.diff(np.sign(samples.steps[:, index])))
        ends = np.append(self._way[turns], self._way[-1])
        self._end = ends[np.searchsorted(turns, np.arange(len(places)))][::_PARTS]
        self._v = np.minimum(np.append(self._start[1:], self._start[-1]), self._end) - self._start
        self._turns = self._start + self._v**2 / (2.0 * self._d) + _TURN > self._end

    def run(self) -> FloatArray:
        """Return how far off its path the platform gets for each cycle [mm], (n,).

        It is inf where the others cannot follow, or where links might part.
        """
        parts = [self._part(k) for k in range(0, len(self._v), _CHUNK)]
        return np.concatenate([part._follow() for part in parts])

    def _part(self, first: int) -> _Trial:
        """Return the trial of some cycles in a row."""
        part, rows = copy(self), slice(first, first + _CHUNK)
        part._begin, part._start, part._end = self._begin[rows], self._start[rows], self._end[rows]
        part._v, part._turns = self._v[rows], self._turns[rows]
        return part

    def _follow(self) -> FloatArray:
        """Return what ``run`` does, of all cycles at once."""
        s, d, begin = self._samples, self._d, self._begin
        before, newest = begin + (REACTION - 1) * s.cycle, begin + REACTION * s.cycle
        old, now = s.between(s.carriages, before), s.between(s.carriages, newest)
        good = (self._v > max(_FEWEST * d, LEAST_STEP)) & ~self._turns
        off = self._off(REACTION, newest)
        led = [s.between(s.carriages, self._goal(cycles)) for cycles in (REACTION - 1, REACTION)]
        for cycles in range(REACTION + 1, int(np.ceil(self._v.max() / d)) + REACTION + _EXTRA):
            goal = self._goal(cycles)
            here = np.abs(s.between(s.steps, goal))
            speed = np.maximum(here[:, self._index], LEAST_STEP)
            pace = np.maximum(self._v - d * cycles, 0.0) / speed * s.cycle
            good &= (here[:, self._index] > LEAST_STEP) & (pace <= _FASTEST * s.cycle)
            most = (self._limits / np.maximum(here[:, self._others], 1e-9)).min(axis=1) * s.cycle
            step = catch_up(goal - newest, newest - before, pace, most)
            before, newest = newest, newest + np.minimum(step, s.cycle)
            led = [*led[-2:], s.between(s.carriages, goal)]
            old, now, new = now, s.between(s.carriages, newest), old
            good &= self._bear(led, 1.0 / CATCH_UP) & self._bear([new, old, now], 1.0)
            off = np.maximum(off, self._off(cycles, newest))
        return np.where(good, off, np.inf)

    def _goal(self, cycles: int) -> FloatArray:
        """Return the path time at which the plan puts the drive's carriage where it then is [s]."""
        goal: FloatArray = np.interp(self._gone(cycles), self._way, self._samples.times)
        return goal

    def _bear(self, places: list[FloatArray], share: float) -> BoolArray:
        """Tell whether the others bear three places in a row, with a share of the limits, (n,)."""
        first, second, third = places
        asked = np.abs(third - 2.0 * second + first)[:, self._others]
        return np.asarray((asked <= share * _ROUNDING * self._limits).all(axis=1))

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
