"""A path that has passed its check, with its blends fixed; only ``check_path`` makes one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import DuoglideError, InputError
from duoglide.kinematics.singularity.margins import FAMILIES
from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.actions import Action, SetPayload, read_action
from duoglide.motion.path.path import Path
from duoglide.motion.path.rounded import SpeedCap
from duoglide.motion.path.segments import Point, show

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class LeastMargin:
    """Where a path comes nearest to breaking one rule.

    Attributes:
        family: What could break: a field of ``Margins``, ``"clearance"``, ``"travel_1"`` to
            ``"travel_3"``, ``"order"``, or ``"keep_out NAME"``.
        margin: What is left of it [mm].
        required: What has to be left [mm].
        sigma: Where on the curve [mm].
        arc_length: Where along the curve [mm].
        position: Where the platform's centre is then [mm].
    """

    family: str
    margin: float
    required: float
    sigma: float
    arc_length: float
    position: Point

    def __str__(self) -> str:
        return (
            f"{self.family}: {self.margin:.6g} mm (needs {self.required:g}),"
            f" {self.arc_length:.6g} mm along, at {show(self.position)} mm"
        )


@dataclass(frozen=True, slots=True)
class CheckReport:
    """What the check has found along an admissible path.

    Attributes:
        least: The least margin of every family.
    """

    least: tuple[LeastMargin, ...]

    def __getitem__(self, family: str) -> LeastMargin:
        """Return the least margin of one family."""
        for entry in self.least:
            if entry.family == family:
                return entry
        raise KeyError(family)

    def __repr__(self) -> str:
        return f"CheckReport({len(self.least)} margins, tightest {self.tightest})"

    def _repr_html_(self) -> str:
        from duoglide.drawing.notebook import notebook_html

        return notebook_html("Least margins", [self.rows()])

    def rows(self) -> list[tuple[str, ...]]:
        """Return the least margins as the rows of a table, with a head."""
        rows: list[tuple[str, ...]] = [
            ("least margin", "is", "needed", "along the path", "platform at")
        ]
        rows += [
            (
                entry.family.replace("_", " "),
                f"{entry.margin:.2f} mm",
                f"{entry.required:g} mm",
                f"{entry.arc_length:.1f} mm",
                f"({', '.join(f'{value:.1f}' for value in entry.position)}) mm",
            )
            for entry in self.least
        ]
        return rows

    @property
    def tightest(self) -> LeastMargin:
        """The rule that is nearest to being broken; the single surfaces count by the clearance."""
        rules = [entry for entry in self.least if entry.family not in FAMILIES]
        return min(rules, key=lambda entry: entry.margin - entry.required)

    def __str__(self) -> str:
        return "\n".join(map(str, self.least))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CheckedPath:
    """A curve that a machine can follow, every point of it.

    Attributes:
        machine: The machine that it was checked for.
        path: What was programmed, in the work frame.
        curve: Where the platform's centre goes, in the base frame, blends and all.
        report: The least margins.
        waypoints: Sigma of each waypoint of the path [mm]; on a blend, of its point nearest by.
        actions: What to do on the way: (sigma [mm], action), in order.
        speed_caps: Caps on the tool's speed along parts of the curve; those of single segments and
            that of the whole path in one.
    """

    machine: Machine
    path: Path
    curve: Curve
    report: CheckReport
    waypoints: tuple[float, ...]
    actions: tuple[tuple[float, Action], ...]
    speed_caps: tuple[SpeedCap, ...]

    @property
    def tool_acceleration(self) -> float | None:
        """Cap on the tool's acceleration [mm/s^2]; None: no cap."""
        return self.path.tool_acceleration

    def payload_at(self, sigma: FloatArray) -> FloatArray:
        """Return what the platform carries [kg], same shape: from each ``SetPayload`` on its mass.

        Args:
            sigma: Parameter of the curve [mm].
        """
        steps = [(at, a.mass) for at, a in self.actions if isinstance(a, SetPayload)]
        carried = np.array([self.machine.masses.payload, *(mass for _, mass in steps)])
        ends = np.array([at for at, _ in steps])
        return np.asarray(carried[np.searchsorted(ends, sigma, side="right")], dtype=np.float64)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, from which ``from_dict`` builds this very value."""
        return {
            "machine": self.machine.to_dict(),
            "path": self.path.to_dict(),
            "curve": self.curve.to_dict(),
            "report": [
                [e.family, e.margin, e.required, e.sigma, e.arc_length, list(e.position)]
                for e in self.report.least
            ],
            "waypoints": list(self.waypoints),
            "actions": [[sigma, action.to_dict()] for sigma, action in self.actions],
            "speed_caps": [[cap.start, cap.end, cap.speed] for cap in self.speed_caps],
        }

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> CheckedPath:
        """Rebuild a checked path from what ``to_dict`` gave.

        The check is not done again; whoever moves a machine with it does that (see ``replay``).

        Raises:
            InputError: A key is missing, or the values make no checked path.
            ConfigError: The machine breaks a rule.
        """
        try:
            least = [LeastMargin(f, m, r, s, a, tuple(p)) for f, m, r, s, a, p in table["report"]]
            return cls(
                machine=Machine.from_dict(table["machine"]),
                path=Path.from_dict(table["path"]),
                curve=Curve.from_dict(table["curve"]),
                report=CheckReport(tuple(least)),
                waypoints=tuple(table["waypoints"]),
                actions=tuple((float(s), read_action(a)) for s, a in table["actions"]),
                speed_caps=tuple(SpeedCap(*row) for row in table["speed_caps"]),
            )
        except DuoglideError:
            raise
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not a checked path: {error!r}") from error

    def plot(self) -> Figure:
        """Draw the path: from the side, across the rails among the clearances, and along its way.

        Returns:
            A matplotlib figure; a notebook shows it, ``savefig`` writes it.
        """
        from duoglide.motion.curve.picture import plot_in_machine

        return plot_in_machine(self.machine, self.curve)

    def _repr_html_(self) -> str:
        from duoglide.drawing.notebook import notebook_html
        from duoglide.motion.curve.picture import plot_in_machine

        head = [("from", f"{show(self.path.start)} mm"), ("to", f"{show(self.path.end)} mm")]
        head.append(("length", f"{float(self.curve.length):.1f} mm"))
        figure = plot_in_machine(self.machine, self.curve, (6.0, 4.8))
        return notebook_html("Checked path", [head, self.report.rows()], figure)

    def __repr__(self) -> str:
        return f"CheckedPath({self.path!r}, {self.curve!r}, tightest {self.report.tightest})"
