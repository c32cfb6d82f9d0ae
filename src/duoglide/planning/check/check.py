"""Checks a path, every point of it, and fixes its blends."""

from __future__ import annotations

import numpy as np

from duoglide.errors import InputError, PathError
from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.checked import CheckedPath, CheckReport
from duoglide.motion.path.path import Path
from duoglide.motion.path.rounded import RoundedPath, round_corners
from duoglide.motion.path.segments import show
from duoglide.planning.check.least import least_margins
from duoglide.planning.check.refusal import assembly_error, refusal
from duoglide.planning.check.rules import Rules
from duoglide.planning.check.search import first_failure
from duoglide.planning.tolerances import NANOMETRE


def check_path(machine: Machine, path: Path) -> CheckedPath:
    """Certify that a machine can follow a path, at every point of its rounded curve.

    Reach, the clearance from singular surfaces, the carriage margin, the travel of the carriages,
    the distance between carriages 1 and 2, and the keep-out boxes are checked between samples too.
    A margin within 1e-7 mm of what is required counts as touching, and is refused; one that is 1e-6
    mm better passes.

    Args:
        machine: The machine.
        path: What the tool's tip is to do, in the work frame.

    Returns:
        The curve of the platform's centre with its blends fixed, and the least margins along it.

    Raises:
        InputError: No machine, or no path.
        PathError: Blends overlap, or the machine cannot follow: names where along the path, at
            which position, what and by how much, and what would pass.
    """
    require_noun(machine, Machine)
    require_noun(path, Path)
    return check_rounded(machine, round_corners(path))


def check_rounded(machine: Machine, rounded: RoundedPath) -> CheckedPath:
    """Certify that a machine can follow a path whose blends are fixed: see ``check_path``.

    Raises:
        PathError: The machine cannot follow.
    """
    curve = rounded.platform_curve(machine)
    waypoints = rounded.waypoints.tolist()
    return CheckedPath(
        machine=machine,
        path=rounded.path,
        curve=curve,
        report=check_curve(machine, curve),
        waypoints=tuple(waypoints),
        actions=tuple((waypoints[i], action) for i, action in rounded.path.actions),
        speed_caps=rounded.speed_caps,
    )


def require_noun(value: object, kind: type[Machine | Path]) -> None:
    """Refuse what is not of the kind that a stage takes.

    Raises:
        InputError: Says what it is instead.
    """
    if not isinstance(value, kind):
        name = kind.__name__.lower()
        raise InputError(f"{name} must be a duoglide.{kind.__name__}, got {value!r:.80}")


def check_curve(machine: Machine, curve: Curve) -> CheckReport:
    """Certify a curve of the platform's centre as it is: ``check_path`` with its blends fixed.

    Replay does this, whose curve is in the log and must not move.

    Raises:
        PathError: The machine cannot follow it, or it is torn.
    """
    _require_whole(curve)
    rules = Rules.of(machine, curve)
    failure = first_failure(rules)
    if failure < np.inf:
        raise refusal(rules, failure)
    if error := assembly_error(machine, curve):
        raise error
    return least_margins(rules)


def _require_whole(curve: Curve) -> None:
    """Refuse a curve whose pieces do not meet, or bend abruptly where no rest is declared."""
    inner = curve.breaks[1:-1]
    before, after = curve.both_sides(0.0, 0.0, np.arange(inner.size))
    jumps = np.abs(after - before).max(axis=-1)
    short = np.minimum(curve.spans[:-1], curve.spans[1:])[:, None]
    # Of p, p', p'' [mm, 1, 1/mm]; the second part is what rounding leaves where pieces are short.
    torn = jumps[:, :3] > NANOMETRE + 1e-11 / short ** np.arange(3)
    if curve.rests:
        torn[np.isin(inner, curve.rests), 1:] = False
    torn = torn.any(axis=1)
    if torn.any():
        sigma = float(inner[np.argmax(torn)])
        position = curve.position(sigma)
        raise PathError(
            f"the curve is torn at {show(position)} mm: its pieces do not meet there with one"
            " tangent and one curvature",
            arc_length=float(curve.arc_length(sigma)),
            position=position.tolist(),
            quantity="continuity",
            amount=float(jumps[np.argmax(torn), 0]),
        )
