"""Where a plan lets a drive that brakes by itself lead the others, so that the platform stays.

Every cycle of the plan is tried for every drive: it leaves the plan there and brakes, as hard and
as gently as ``quick_stop_tolerance`` says; the others go on for ``REACTION`` cycles, and then catch
up with it along the path as the streamer has them do (``control/streamer/led_stop.py``). The
platform is off its path by how far that drive is from where the others put it, times what a
millimetre of its carriage moves the platform across the path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import AXES, FloatArray
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.model import jacobian
from duoglide.motion.led_stops import PROMISED, LedStops
from duoglide.motion.motion import Motion
from duoglide.planning.braking.led_kernel import CATCH_UP, MOST_OFF, PARTS, follow

# The streamer does not know when in its cycle a drive began to brake. It takes it that this was so
# many cycles before the cycle's end, and predicts where the drive is from so many cycles before.
_SINCE, _AHEAD = 0.5, 2.0
_FEEDBACK = 0.05  # [mm] by which feedback is off anyway
_TRANSIENT = 0.3  # share of what its acceleration costs a carriage, by which feedback may be off


def led_stops(motion: Motion) -> LedStops:
    """Try every drive at every cycle of a motion."""
    machine = motion.machine
    samples = _Samples.of(motion)
    limits = CATCH_UP * machine.stop_limits.acceleration
    decelerations = machine.drives.quick_stop_deceleration
    off_by = machine.drives.quick_stop_tolerance
    costs = _TRANSIENT * np.asarray(machine.drives.acceleration_lag)
    allowed = promised = np.zeros(len(samples.carriages[::PARTS]), dtype=np.uint8)
    for index, deceleration in enumerate(decelerations):
        off = np.max(
            [
                samples.follow(index, deceleration * share, limits, costs[index], late)
                for share in (1.0 - off_by, 1.0 + off_by)
                for late in (0.0, 1.0)  # it begins to brake at the beginning of its cycle, or end
            ],
            axis=0,
        )
        allowed = allowed | np.asarray((off <= MOST_OFF) << index, dtype=np.uint8)
        promised = promised | np.asarray((off <= PROMISED) << index, dtype=np.uint8)
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
        cycle: Of the drives; there are ``PARTS`` samples in it [s].
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
        count = (int(np.ceil(motion.duration / cycle)) + 2) * PARTS
        times = np.linspace(0.0, count * cycle / PARTS, count + 1)
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

    def follow(
        self, index: int, deceleration: float, limits: FloatArray, cost: float, late: float
    ) -> FloatArray:
        """Let a drive brake in each cycle, and the others follow it.

        Its carriage's place is told by the way that it has gone since the start of the plan, which
        never falls; it may not go on past where the plan turns it round.

        Args:
            index: Of the drive.
            deceleration: What it brakes with [mm/s^2].
            limits: What each carriage may be asked for [mm/s^2], (3,).
            cost: What braking hides of its place from its feedback, per mm/s^2 [s^2].
            late: How long it goes straight on before it brakes [cycles].

        Returns:
            How far off its path the platform gets for each cycle [mm], (n,); inf where the others
            cannot follow, or where links might part.
        """
        places = self.carriages[:, index]
        way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(places)))])
        turns = np.flatnonzero(np.diff(np.sign(self.steps[:, index])))
        ends = np.append(way[turns], way[-1])
        end = ends[np.searchsorted(turns, np.arange(len(places)))][::PARTS]
        others = [j for j in range(AXES) if j != index]
        table = np.column_stack(
            [
                way,
                self.carriages[:, others],
                np.abs(self.steps[:, [index, *others]]),
                self.across[:, index],
                self.margin,
            ]
        )
        off = np.empty(len(end))
        first, second = (limits[others] * self.cycle**2).tolist()
        braking = deceleration * self.cycle**2
        unsure = _SINCE * (_AHEAD + 0.5 * _SINCE) * braking + cost * deceleration + _FEEDBACK
        follow(table, end, (braking, unsure, late), (first, second), off)
        return off


def _across(moves: FloatArray, velocity: FloatArray) -> FloatArray:
    """Return how far each carriage moves the platform across its path, per mm, (n, 3)."""
    along = np.einsum("nij,nj->ni", moves, velocity)
    unit = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    with_path = np.einsum("ni,nij->nj", unit, moves)
    sizes: FloatArray = np.linalg.norm(moves - unit[:, :, None] * with_path[:, None], axis=1)
    return sizes
