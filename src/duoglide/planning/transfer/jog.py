"""Jog: move by hand, cycle by cycle, with nothing sent that was not validated.

Every setpoint comes with a way to stop behind it that has been looked at before: it keeps reach,
clearance, carriage margin, travel, carriage order, keep-out boxes and the carriages' limits. A step
that has no such way is not taken; the last one's is followed instead, until the wish changes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import ruckig
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from duoglide.arrays import FloatArray, as_triples, read_only
from duoglide.errors import InputError, PathError, SingularityError, UnreachableError
from duoglide.kinematics.headroom.room import TOUCHING, locate, room
from duoglide.kinematics.model import inverse, inverse_derivatives, jacobian
from duoglide.machine import Machine
from duoglide.motion.motion import Motion
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import Profile
from duoglide.motion.timing_report import TimingMethod, TimingReport
from duoglide.planning.stops.certificate import certify_stops, stop_bounds_until
from duoglide.planning.tolerances import ALIKE
from duoglide.planning.trajectory import Trajectory

_SAMPLES = 16  # A way to stop is looked at in so many places.
_SLACK = 0.05  # mm that is left of every bound where there is so much to begin with
# A motion counts as straight if no more than this share of its acceleration points aside.
_ROUNDING = 5e-6  # mm, within which a clearance is known


@dataclass(frozen=True, slots=True, kw_only=True)
class JogLimits:
    """What the platform may do while it is moved by hand.

    Attributes:
        speed: [mm/s].
        acceleration: [mm/s^2].
        jerk: [mm/s^3].

    Raises:
        InputError: One of them is not finite and above zero.
    """

    speed: float = 100.0
    acceleration: float = 1000.0
    jerk: float = 20_000.0

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration", "jerk"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"{name} = {value!r}: must be finite and above zero")


@dataclass(frozen=True, slots=True)
class _Ball:
    """Positions around one whose room is known: as much room as they are away is gone."""

    centre: FloatArray
    radius: float

    def holds(self, positions: FloatArray, reserve: float) -> bool:
        farthest = float(np.linalg.norm(positions - self.centre, axis=-1).max())
        return farthest + reserve < self.radius


class _Step(NamedTuple):
    """A step that may be taken.

    Attributes:
        passed: States in it, at every cycle, shape (n, 3, 3).
        ahead: The last of them, shape (3, 3).
        stop: The way to rest from there.
    """

    passed: FloatArray
    ahead: FloatArray
    stop: ruckig.Trajectory


class Jog:
    """The platform under a velocity that somebody asks for.

    Args:
        machine: The machine.
        carriages: Where its carriages stand, at rest [mm], shape (3,).
        limits: What the platform may do.
        period: How long a step takes [s]; None: a cycle of the drives. Longer steps are looked at
            as closely, and keep a little more of every bound.

    Raises:
        InputError: Not three finite numbers.
        PathError: The machine does not stand where it may; see ``recover``.
    """

    def __init__(
        self,
        machine: Machine,
        carriages: ArrayLike,
        limits: JogLimits | None = None,
        period: float | None = None,
    ) -> None:
        self._machine = machine
        self._period = machine.drives.cycle if period is None else period
        cycles = round(self._period / machine.drives.cycle)
        self._shares = np.arange(1, cycles + 1) / cycles * self._period  # looked at in a step
        self._limits = limits or JogLimits()
        start = as_triples(carriages, "carriages", "(carriage 1, 2, 3)")
        if start.shape != (3,):
            raise InputError(f"carriages must have shape (3,), got {start.shape}")
        _, quantity, amount = room(machine, start[None]).worst()
        if amount <= TOUCHING:
            raise PathError(
                f"cannot jog from here: {quantity} is {-amount:.6g} mm too small; recover first",
                quantity=quantity,
                amount=-amount,
            )
        self._state = np.stack([locate(machine, start[None])[0][0], np.zeros(3), np.zeros(3)])
        self._carriages = read_only(start)
        self._wish = np.zeros(3)
        self._blocked = ""
        self._clear = self._free = self._loose = _Ball(np.zeros(3), -1.0)
        self._solver = ruckig.Ruckig(3)
        self._question = ruckig.InputParameter(3)
        self._question.control_interface = ruckig.ControlInterface.Velocity
        self._question.synchronization = ruckig.Synchronization.No
        self._stop = self._go_over_to(self._state, np.zeros(3))
        self._since = 0.0

    @property
    def position(self) -> FloatArray:
        """Platform centre O' now [mm], shape (3,)."""
        return read_only(self._state[0])

    @property
    def velocity(self) -> FloatArray:
        """Velocity of the platform now [mm/s], shape (3,)."""
        return read_only(self._state[1])

    @property
    def moving(self) -> bool:
        """Whether the platform moves."""
        return bool(np.any(self._state[1:] != 0.0))

    @property
    def blocked(self) -> str:
        """What keeps the wish from being followed; empty while nothing does."""
        return self._blocked

    def aim(self, velocity: ArrayLike) -> None:
        """Ask for a velocity of the platform [mm/s], shape (3,); shortened to the limit of speed.

        Raises:
            InputError: Not three finite numbers.
        """
        wish = as_triples(velocity, "velocity")
        if wish.shape != (3,):
            raise InputError(f"velocity must have shape (3,), got {wish.shape}")
        speed = float(np.linalg.norm(wish))
        self._wish = wish * min(1.0, self._limits.speed / max(speed, 1e-300))
        self._blocked = ""

    def step(self) -> FloatArray:
        """Let one step pass; return the carriages' setpoint for it [mm], shape (3,)."""
        if not self.moving and (self._blocked or not self._wish.any()):
            return self._carriages
        found = self._find_step()
        if found is None:
            self._since += self._period
            self._state = _sample(self._stop, np.array([self._since]))[0]
            if self._since >= self._stop.duration:
                self._state[1:] = 0.0
        else:
            self._state, self._stop, self._since = found.ahead, found.stop, 0.0
        self._carriages = read_only(inverse(self._machine.geometry, self._state[0]))
        return self._carriages

    def move(self) -> Trajectory | None:
        """Let one step pass as ``step`` does; return it as a trajectory that hands over in motion.

        Returns:
            The step, whose ``whole`` goes on to rest. None where there is no step: at rest where
            nothing is wished or the wish is blocked, and in motion where the way to rest of the
            step before has to be followed.
        """
        if not self.moving and (self._blocked or not self._wish.any()):
            return None
        start, found = self._state, self._find_step()
        if found is None:
            return None
        self._state, self._stop, self._since = found.ahead, found.stop, 0.0
        self._carriages = read_only(inverse(self._machine.geometry, self._state[0]))
        return self._describe(start, found)

    def rest(self) -> None:
        """Take it that the way to rest of the last step has been followed to its end."""
        self._state = _sample(self._stop, np.array([self._stop.duration]))[0]
        self._state[1:] = 0.0
        self._carriages = read_only(inverse(self._machine.geometry, self._state[0]))

    def keep(self) -> Callable[[], None]:
        """Return what takes the steps back that are made from now on."""
        kept = self._state.copy(), self._carriages, self._stop, self._since

        def take_back() -> None:
            self._state, self._carriages, self._stop, self._since = kept

        return take_back

    def _describe(self, start: FloatArray, step: _Step) -> Trajectory:
        """Return a step and its way to rest as one motion of the carriages, through every cycle."""
        machine, cycle = self._machine, self._machine.drives.cycle
        count = max(int(step.stop.duration / cycle - 0.5), 0)
        after = np.append(np.arange(1, count + 1) * cycle, step.stop.duration)
        times = np.concatenate([[0.0], self._shares, self._period + after])
        states = np.concatenate([start[None], step.passed, _sample(step.stop, after)])
        third = np.zeros((len(states), 1, 3))
        rows = inverse_derivatives(machine.geometry, np.concatenate([states, third], axis=1))
        ends = (1, rows[0, 1]), (1, np.zeros(3))
        spline = CubicSpline(times, rows[:, 0], bc_type=ends)
        least = float(room(machine, rows[:, 0]).clearance.min()) + machine.clearance
        table = np.moveaxis(spline.c[::-1], 0, 1)
        path = TransferPath(machine, times, table, least)
        report = TimingReport(method=TimingMethod.TRANSFER, reason="moved by hand")
        end = float(times[-1])
        knots = np.array([[t, t, 1.0, 0.0] for t in (0.0, self._period, end)])
        motion = Motion(path, Profile(knots), report=report)
        whole = Trajectory.of(motion, certify_stops(motion))
        return whole.until(1, stop_bounds_until(whole, self._period))

    def _find_step(self) -> _Step | None:
        """Return the next step with a way to rest behind it; None if there is none."""
        try:
            way = self._go_over_to(self._state, self._wish)
            passed = _sample(way, self._shares)
            ahead = passed[-1]
            stop = self._go_over_to(ahead, np.zeros(3))
            times = np.linspace(0.0, stop.duration, _SAMPLES + 1)
            states = np.concatenate([self._state[None], passed[:-1], _sample(stop, times)])
            gap = max(float(self._shares[0]), float(times[1]))
            self._blocked = self._find_objection(states, gap)
        except ruckig.RuckigError:
            self._blocked = "acceleration"  # no such way: as good as a way beyond the limits
        return None if self._blocked else _Step(passed, ahead, stop)

    def _go_over_to(self, state: FloatArray, velocity: FloatArray) -> ruckig.Trajectory:
        """Go over to a velocity, straight if the platform does not turn; every axis by itself.

        Ruckig's own synchronisation of velocities fails now and then ("error in step 2").
        """
        change, acceleration = velocity - state[1], state[2]
        share = np.full(3, 1.0 / np.sqrt(3.0))
        size = float(np.linalg.norm(change))
        aside = float(np.linalg.norm(np.cross(acceleration, change)))
        if size > 0.0 and aside <= ALIKE * size * self._limits.acceleration:
            share = np.maximum(np.abs(change) / size, ALIKE)
        question = self._question
        question.max_acceleration = (share * self._limits.acceleration).tolist()
        question.max_jerk = (share * self._limits.jerk).tolist()
        question.current_position, question.current_velocity, question.current_acceleration = (
            state.tolist()
        )
        question.target_velocity = velocity.tolist()
        question.target_acceleration = [0.0, 0.0, 0.0]
        answer = ruckig.Trajectory(3)
        self._solver.calculate(question, answer)
        return answer

    def _find_objection(self, states: FloatArray, gap: float) -> str:
        """Say what speaks against going through ``states`` (n, 3, 3), at most ``gap`` s apart."""
        machine, limits = self._machine, self._machine.limits
        try:
            third = np.zeros((len(states), 1, 3))
            rows = inverse_derivatives(machine.geometry, np.concatenate([states, third], axis=1))
            lever = np.linalg.norm(jacobian(machine.geometry, states[:, 0]), axis=-1)
        except (UnreachableError, SingularityError):
            return "reach"
        v, a, j = np.moveaxis(np.abs(rows[:, 1:]), 1, 0)
        uses = {"velocity": v, "acceleration": a, "jerk": j + lever * self._limits.jerk}
        for name, values in uses.items():
            if np.any(values > getattr(limits, name)):
                return name
        places = rows[:, 0]
        half = machine.geometry.rail_half_length
        for k in range(3):
            bend = _take_larger(gap * gap * a[:, k])
            if not _keeps(half - np.abs(places[:, k]), places[:, k, None], bend):
                return "travel"
        apart = places[:, 1] - places[:, 0]
        bend = _take_larger(2.0 * gap * gap * a.max(axis=-1))
        if not _keeps(apart - machine.carriage_width, apart[:, None], bend):
            return "order"
        spread = np.linalg.norm(a, axis=-1) + np.linalg.norm(states[:, 2], axis=-1)
        return self._describe_lack(states, places, gap, spread)

    def _describe_lack(
        self, states: FloatArray, carriages: FloatArray, gap: float, reach: FloatArray
    ) -> str:
        """Say what is missing of clearances, which y does not change, or of distance to boxes."""
        position, bend = states[:, 0], _bound_bends(states, gap, self._limits.jerk)
        flat = position * np.array([1.0, 0.0, 1.0])
        reserve = _SLACK + float(bend.max())
        beside = carriages - position[:, 1:2]
        swing = _take_larger(gap * gap * reach)
        near = self._loose.holds(beside, _SLACK + float(swing.max()))
        if near and self._clear.holds(flat, reserve) and self._free.holds(position, reserve):
            return ""
        here = room(self._machine, carriages)
        self._clear = _Ball(flat[0], float(here.clearance[0]))
        self._free = _Ball(position[0], float(here.keep_out[0]))
        self._loose = _Ball(beside[0], float(here.carriage_margin[0]))
        if not _keeps(here.carriage_margin, beside, swing):
            return "carriage_margin"
        if not _keeps(here.clearance, flat, bend):
            return "clearance"
        return "" if _keeps(here.keep_out, position, bend) else "keep_out"


def _keeps(margin: FloatArray, places: FloatArray, bend: FloatArray) -> bool:
    """Tell whether a margin (n,) that changes by at most the way moved is kept between samples.

    Between two samples it is at least half of what their sum exceeds their distance by, less what
    the way bows off the chord: an eighth of acceleration times time squared (``bend``, (n - 1,)).
    Where less than the slack is left at the start, it must not get less.
    """
    if np.isinf(margin).any():
        return bool((margin > 0.0).all())
    way = np.linalg.norm(np.diff(places, axis=0), axis=-1)
    between = 0.5 * (margin[1:] + margin[:-1] - way) - 0.125 * bend
    floor = min(_SLACK, float(margin[0]) - _ROUNDING)
    return bool(margin.min() >= floor and between.min() > TOUCHING)


def _bound_bends(states: FloatArray, gap: float, jerk: float) -> FloatArray:
    """Bound acceleration times time squared between samples at most ``gap`` s apart, (n - 1,).

    The acceleration is at most half a gap's jerk larger than at the ends. A straight motion leaves
    its chords only where it turns back: ruckig's goes back once at most, and then its velocity
    changes sign from sample to sample, or is slowed down at the first and driven at the second.
    """
    v, a = states[:, 1], states[:, 2]
    bends: FloatArray = gap * gap * (_take_larger(np.linalg.norm(a, axis=-1)) + 0.5 * jerk * gap)
    both = np.concatenate([v, gap * a])
    longest = both[np.argmax((both * both).sum(axis=-1))]
    way = longest / max(float(np.linalg.norm(longest)), 1e-300)
    speed, drive = v @ way, a @ way
    aside = np.linalg.norm(both - (both @ way)[:, None] * way, axis=-1)
    if aside.max() > ALIKE * np.linalg.norm(longest):
        return bends
    back = speed[1:] * speed[:-1] < 0.0
    back |= ((speed * drive)[:-1] < 0.0) & ((speed * drive)[1:] > 0.0)
    return np.where(back, bends, 0.0)


def _take_larger(samples: FloatArray) -> FloatArray:
    """Return the larger of each two neighbours, (n - 1,)."""
    larger: FloatArray = np.maximum(samples[1:], samples[:-1])
    return larger


def _sample(motion: ruckig.Trajectory, times: FloatArray) -> FloatArray:
    """Return position, velocity and acceleration at times (n,), shape (n, 3, 3)."""
    return np.array([motion.at_time(time) for time in times.tolist()])
