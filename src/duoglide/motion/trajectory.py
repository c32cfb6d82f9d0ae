"""The motion of the three carriages in time: what is streamed, logged and replayed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from duoglide.errors import ConfigError, DuoglideError, InputError, LogError
from duoglide.motion.motion import Motion
from duoglide.motion.path.actions import Action, Dwell, action_from_dict
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.path.checked import CheckedPath
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.profile import Profile
from duoglide.motion.stop_bounds import StopBounds
from duoglide.motion.timing_report import TimingReport

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from duoglide.motion.audit import Audit


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trajectory(Motion):
    """A motion that may be slowed down and stopped at any time: what is streamed.

    Attributes:
        stops: How fast the rate of the motion may be changed while it runs.
        actions: What to do on the way: (time [s], action), in order.
        whole: Where this ends in motion, because another trajectory takes over: the trajectory to
            rest that it is the first part of. Run that if no other one comes.
    """

    stops: StopBounds
    actions: tuple[tuple[float, Action], ...] = ()
    whole: Trajectory | None = None

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

    def audit(self) -> Audit:
        """Measure the worst use of each limit on finite differences of the positions, at 20 kHz.

        The step is longer where the limits are so low that rounding would look like jerk.
        """
        from duoglide.motion.audit import audit

        return audit(self)

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

        Raises:
            InputError: Not such a document.
            ConfigError: Its machine breaks a rule.
        """
        try:
            if "whole" in document:
                whole = cls.from_document(document["whole"])
                return whole.until(int(document["knot"]), StopBounds.from_dict(document["stops"]))
            return cls(
                path=_path_of(document),
                profile=Profile(document["profile"]),
                stops=StopBounds.from_dict(document["stops"]),
                actions=tuple((float(t), action_from_dict(a)) for t, a in document["actions"]),
                report=TimingReport.from_dict(document["report"]),
            )
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

        Raises:
            LogError: The file cannot be read, or holds no plan.
        """
        from duoglide.motion.plan_file import load

        document = load(path)
        try:
            return cls.from_document(document)
        except (InputError, ConfigError) as error:
            raise LogError(f"{path}: {error}") from error

    def plot(self) -> Figure:
        """Draw the carriages, velocities, accelerations and jerks against their limits.

        Returns:
            A matplotlib figure; a notebook shows it, ``savefig`` writes it.
        """
        from duoglide.motion.picture import plot_motion

        return plot_motion(self)

    def _repr_html_(self) -> str:
        from duoglide.motion.picture import motion_html

        return motion_html(self, actions=len(self.actions))

    def __repr__(self) -> str:
        note = f", {self.report.method.value}: {self.report.reason}" if self.report.reason else ""
        return f"Trajectory({self.duration:.4f} s, {self.path.length:.4g} mm{note})"


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
