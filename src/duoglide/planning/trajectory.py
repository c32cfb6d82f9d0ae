"""The motion of the three carriages in time: what is streamed, logged and replayed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from duoglide.arrays import FloatArray, as_floats
from duoglide.errors import DuoglideError, InputError, LimitError, LogError
from duoglide.machine import Machine
from duoglide.motion.motion import Motion
from duoglide.motion.pace import Pace
from duoglide.motion.path.actions import Action, Dwell
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.path.checked import CheckedPath
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import TIME, Profile
from duoglide.motion.stop_bounds import StopBounds
from duoglide.motion.timing_report import TimingMethod, TimingReport
from duoglide.planning.certify import certify, renew_report
from duoglide.planning.limit_use import ALLOWED, NAMES, uses_at_cycles
from duoglide.planning.stops.certificate import certify_stops, stop_bounds_until

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from duoglide.motion.audit import Audit
    from duoglide.motion.forces import Demand


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trajectory(Motion):
    """A motion that may be slowed down and stopped at any time: what is streamed.

    Attributes:
        stops: How fast the rate of the motion may be changed while it runs.
        actions: What to do on the way: (time [s], action), in order.
        whole: Where this ends in motion, because another trajectory takes over: the trajectory to
            rest that it is the first part of. Run that if no other one comes.
        plan: Where this is a run as it was recorded, at ``pace``: what was planned. Its changes of
            pace may use ``machine.stop_limits``.
        pace: How that run went along its plan.
    """

    stops: StopBounds
    actions: tuple[tuple[float, Action], ...] = ()
    whole: Trajectory | None = None
    plan: Trajectory | None = None
    pace: Pace | None = None

    @classmethod
    def of(cls, motion: Motion, stops: StopBounds) -> Trajectory:
        """Let a motion be stopped within ``stops``, and do the actions of its path on the way."""
        actions = action_times(motion)
        return cls(motion.path, motion.profile, stops, actions, report=motion.report)

    def until(self, knot: int, stops: StopBounds) -> Trajectory:
        """Return the part up to a knot of the profile, where another trajectory takes over.

        Args:
            knot: Index of the knot; not the first one.
            stops: Bounds of changes that begin in this part; they may end after it, on the whole.
        """
        profile = self.profile.until(knot)
        passed = tuple(entry for entry in self.actions if entry[0] < profile.duration)
        return replace(self, profile=profile, stops=stops, actions=passed, whole=self)

    @classmethod
    def repaced(cls, plan: Trajectory, pace: Pace) -> Trajectory:
        """Return a plan as a run went along it.

        Raises:
            LimitError: The positions of its cycles ask for more than the machine's ``stop_limits``;
                a run whose last cycles were filtered out breaks off at speed, and does.
        """
        report = replace(plan.report.without_braking(), method=TimingMethod.RECORDED)
        motion = Motion(plan.path, pace.profile_of(plan.profile), report=report)
        _require_stop_limits(motion)
        due = tuple((pace.time_of(t), action) for t, action in plan.actions)
        actions = tuple(entry for entry in due if isfinite(entry[0]))
        stops = certify_stops(motion)
        return cls(motion.path, motion.profile, stops, actions, plan=plan, pace=pace, report=report)

    def certified_for(self, machine: Machine) -> tuple[Trajectory, FloatArray]:
        """Return the same motion for a machine, certified again as if nobody had planned it.

        Returns:
            The trajectory, with stop bounds of this machine, and its use of the limits (of the stop
            limits, at the cycles, for a recorded run): velocity, acceleration and jerk of each
            carriage, shape (3, 3).

        Raises:
            PathError: The machine cannot follow the path, or the motion jumps.
            LimitError: It asks for more than a limit of the machine.
        """
        if self.plan is not None and self.pace is not None:
            plan, _ = self.plan.certified_for(machine)
            again = replace(Trajectory.repaced(plan, self.pace), actions=self.actions)
            return again, uses_at_cycles(again, machine)
        motion, uses = certify(machine, self)
        if machine.to_dict() != self.machine.to_dict():
            motion = renew_report(motion)
        again = replace(self, path=motion.path, stops=certify_stops(motion), report=motion.report)
        return again, uses.seen

    def audit(self) -> Audit:
        """Measure the worst use of each limit on finite differences of the positions, at 20 kHz.

        The step is longer where the limits are so low that rounding would look like jerk.
        """
        from duoglide.motion.audit import audit
        from duoglide.planning.braking.led import led_stops

        return audit(self, led_stops(self))

    def forces(self, t: ArrayLike) -> FloatArray:
        """Return the forces on the carriages along +y at time ``t`` [N], shape (..., 3).

        Closed form, exact, with ``machine.masses``: see ``dg.carriage_forces``.

        Args:
            t: Time from the start [s], any shape (...); clamped to both ends.

        Raises:
            InputError: Not a finite number.
        """
        from duoglide.motion.forces import motion_forces

        return motion_forces(self, as_floats(t, "t"))

    def demand(self) -> Demand:
        """Measure what the motion demands of its drives: forces, power, energy; at 20 kHz."""
        from duoglide.motion.forces import measure_demand

        return measure_demand(self)

    def lower_bound(self) -> float:
        """Return a duration that no motion along this curve can beat [s]: toppra, without jerk.

        Raises:
            LimitError: toppra finds no bound.
        """
        from duoglide.motion.lower_bound import lower_bound

        return lower_bound(self)

    def to_document(self) -> dict[str, Any]:
        """Return plain numbers, text and lists that ``from_document`` reads back exactly."""
        if self.whole is not None:
            knot = len(self.profile.knots) - 1
            return {
                "whole": self.whole.to_document(),
                "knot": knot,
                "stops": self.stops.to_dict(),
            }
        if self.plan is not None and self.pace is not None:
            return {"plan": self.plan.to_document(), "pace": self.pace.to_dict()}
        return {
            **_describe(self.path),
            "profile": self.profile.knots.tolist(),
            "stops": self.stops.to_dict(),
            "actions": [[t, action.to_dict()] for t, action in self.actions],
            "report": self.report.to_dict(),
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Trajectory:
        """Rebuild the trajectory that ``to_document`` described, to the last bit.

        The curve and the profile are read. All else that a trajectory promises is derived from
        them again, by the certificates that made it (``planning/certify.py``), for the machine of
        the document: whoever moves a machine with it asks once more for that machine.

        Raises:
            InputError: Not such a document.
            ConfigError: Its machine breaks a rule.
            PathError: Its machine cannot follow the path, or the motion jumps.
            LimitError: It asks for more than a limit of its machine.
        """
        try:
            if "whole" in document:
                whole, knot = cls.from_document(document["whole"]), document["knot"]
                if type(knot) is not int or not 0 < knot < len(whole.profile.knots) - 1:
                    raise InputError(f"knot = {knot!r:.40}: the whole has no such inner knot")
                end = float(whole.profile.knots[knot, TIME])
                return whole.until(knot, stop_bounds_until(whole, end))
            if "plan" in document:
                plan = cls.from_document(document["plan"])
                return cls.repaced(plan, Pace.from_dict(document["pace"]))
            report = TimingReport.from_dict(document["report"])
            told = Motion(_path_of(document), Profile(document["profile"]), report=report)
            motion, _ = certify(told.machine, told)
            motion = renew_report(motion)
            return cls.of(motion, certify_stops(motion))
        except DuoglideError:
            raise
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a trajectory: {error!r}") from error

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the plan to an MCAP file, with samples of the motion for pictures.

        Raises:
            LogError: The file cannot be written.
        """
        from duoglide.motion.plan_file import save

        save(path, self, self.to_document())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read the plan from an MCAP file: a plan, or a run, which holds its plan.

        Nothing that the file promises is believed: see ``from_document``.

        Raises:
            LogError: The file cannot be read, or holds no plan that its machine can follow.
        """
        from duoglide.motion.plan_file import load

        document = load(path)
        try:
            return cls.from_document(document)
        except DuoglideError as error:
            raise LogError(f"{path}: {error}") from error

    def plot(self) -> Figure:
        """Draw the carriages, velocities, accelerations and jerks against their limits.

        Returns:
            A matplotlib figure; a notebook shows it, ``savefig`` writes it.
        """
        from duoglide.motion.picture import plot_motion

        return plot_motion(self)

    def _repr_html_(self) -> str:
        from duoglide.motion.picture import show_motion

        return show_motion(self, actions=len(self.actions))

    def __repr__(self) -> str:
        note = f", {self.report.method.value}: {self.report.reason}" if self.report.reason else ""
        return f"Trajectory({self.duration:.4f} s, {self.path.length:.4g} mm{note})"


def _require_stop_limits(motion: Motion) -> None:
    """Check a recorded motion, whose changes of pace are known at its cycles only."""
    use = uses_at_cycles(motion, motion.machine)
    if use.max() > ALLOWED:
        order, carriage = np.unravel_index(int(np.argmax(use)), use.shape)
        raise LimitError(
            f"the recorded motion asks for {100.0 * use.max():.1f} % of stop_limits."
            f"{NAMES[order]} of carriage {carriage + 1} of this machine; --override 100 replays"
            " its plan instead"
        )


def action_times(motion: Motion) -> tuple[tuple[float, Action], ...]:
    """Return when the actions of a motion's path are due: (time [s], action), in order.

    An action is due when the motion first gets to its place, and after the dwells before it there.
    """
    if isinstance(motion.path, TransferPath):
        return ()
    due, place, dwelt = [], -1.0, 0.0
    for sigma, action in motion.path.checked.actions:
        place, dwelt = sigma, dwelt if sigma == place else 0.0
        due.append((motion.profile.time_at(sigma) + dwelt, action))
        dwelt += action.seconds if isinstance(action, Dwell) else 0.0
    return tuple(due)


def _describe(path: CarriagePath | TransferPath) -> dict[str, Any]:
    """Describe the curve under a key that says which kind it is."""
    if isinstance(path, TransferPath):
        return {"transfer": path.to_dict()}
    return {"checked": path.checked.to_dict()}


def _path_of(document: Mapping[str, Any]) -> CarriagePath | TransferPath:
    """Rebuild what ``_describe`` described."""
    if "transfer" in document:
        return TransferPath.from_dict(document["transfer"])
    return map_to_carriages(CheckedPath.from_dict(document["checked"]))
