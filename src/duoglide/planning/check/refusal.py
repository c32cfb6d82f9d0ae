"""Says why a path is refused: where, what, by how much, and what would pass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from duoglide.arrays import BoolArray, FloatArray
from duoglide.errors import PathError, UnreachableError
from duoglide.kinematics.headroom.room import TOUCHING
from duoglide.kinematics.model import inverse
from duoglide.kinematics.modes import ASSEMBLY, WORKING
from duoglide.kinematics.reach import reach_of
from duoglide.kinematics.singularity.margins import margins
from duoglide.kinematics.singularity.nearest import nearest_surface
from duoglide.machine import Machine
from duoglide.motion.curve.curve import Curve
from duoglide.motion.path.segments import show
from duoglide.planning.check.judge import judge_points
from duoglide.planning.check.rules import CARRIAGE_MARGIN, CLEARANCE, Rules
from duoglide.planning.check.search import first_failure
from duoglide.planning.tolerances import NANOMETRE


class _Looks(NamedTuple):
    """How closely a refusal looks for what would work.

    Attributes:
        samples: Along the curve, to find how far a rule is broken.
        shifted: Along the curve, at each height.
        highest: Farthest that the path is moved up or down [mm], in steps of 1 mm.
        finest: Step to which an admissible height or length is told [mm].
        tries: Heights of the coarse steps that are looked at closely.
        zooms: Times that the place where a rule is broken the most is looked at more
            closely.
    """

    samples: int = 1000
    shifted: int = 60
    highest: float = 60.0
    finest: float = 0.01
    tries: int = 4
    zooms: int = 4


_LOOKS = _Looks()


@dataclass(frozen=True, slots=True)
class Breach:
    """What is broken.

    Attributes:
        quantity: The name of it, for programs.
        text: What is wrong, for people.
        amount: By how much at worst [mm].
    """

    quantity: str
    text: str
    amount: float


def refusal(rules: Rules, failed_at: float) -> PathError:
    """Explain why a curve is refused whose first bad point is at sigma = ``failed_at``."""
    curve = rules.curve
    if failed_at < NANOMETRE and margins_at(rules, np.zeros(1)).min() < TOUCHING:
        failed_at = 0.0
    position = curve.position(failed_at)
    along = float(curve.arc_length(failed_at))
    breach = _find_breach(rules, failed_at)
    hints = [hint for hint in (_find_height(rules), _find_part(rules, failed_at)) if hint]
    where = f"first {along:.6g} mm along the path, at {show(position)} mm"
    return PathError(
        "; ".join([breach.text, where, *hints]),
        arc_length=along,
        position=position.tolist(),
        quantity=breach.quantity,
        amount=breach.amount,
    )


def assembly_error(machine: Machine, curve: Curve) -> PathError | None:
    """Tell whether a curve lies beyond a surface that the machine cannot cross to get there.

    The start decides: a curve that is clear of every surface stays on one side of each.
    """
    start = curve.position(0.0)
    found = margins(machine.geometry, start)
    for family, sign in (("legs_flat", ASSEMBLY.m), ("arm_strut", ASSEMBLY.n)):
        beyond = -sign * float(getattr(found, family))
        if beyond > 0.0:
            return PathError(
                f"the path starts at {show(start)} mm beyond {family}, where the margin is"
                f" {-beyond:.6g} mm: another assembly mode, into which the machine cannot cross",
                arc_length=0.0,
                position=start.tolist(),
                quantity="assembly",
                amount=beyond,
            )
    return None


def margins_at(rules: Rules, sigma: FloatArray) -> FloatArray:
    """Margins less what is required at single points [mm]; minus infinity out of reach."""
    return judge_points(rules, rules.curve.position(sigma))


def _find_breach(rules: Rules, failed_at: float) -> Breach:
    """Name the rule that is broken first, and how far it is broken before it is kept again.

    Where the carriage margin ends in a surface, the surface is named.
    """
    first = margins_at(rules, np.array([failed_at]))[0]
    family = int(np.argmax(first < TOUCHING))
    sigma = np.linspace(failed_at, rules.curve.end, _LOOKS.samples)
    table = margins_at(rules, sigma)
    kept = np.flatnonzero(table[:, family] >= TOUCHING)
    stretch = slice(0, max(int(kept[0]), 1) if kept.size else None)
    if family == CARRIAGE_MARGIN and table[stretch, CLEARANCE].min() < TOUCHING:
        family = CLEARANCE  # it knows which surface is in the way
    values = table[:, family]
    points = rules.curve.position(sigma[stretch])
    lacking = reach_of(points, rules.constants).lacking.max(axis=1)
    if lacking.max() > -TOUCHING:
        return _out_of_reach(rules, points[int(lacking.argmax())], float(lacking.max()))
    worst, where = _zoom_in(rules, family, sigma[stretch], values[stretch])
    return _put_in_words(rules, family, worst, rules.curve.position(where))


def _zoom_in(
    rules: Rules, family: int, sigma: FloatArray, values: FloatArray
) -> tuple[float, float]:
    """Find the least value, and where it is, between evenly spaced samples too."""
    step = float(sigma[1] - sigma[0]) if sigma.size > 1 else 0.0
    for _ in range(_LOOKS.zooms):
        where = float(sigma[values.argmin()])
        sigma = (where + step * np.linspace(-1.0, 1.0, 41)).clip(sigma[0], sigma[-1])
        values = margins_at(rules, sigma)[:, family]
        step /= 20.0
    return float(values.min()), float(sigma[values.argmin()])


def _out_of_reach(rules: Rules, position: FloatArray, lacking: float) -> Breach:
    """Describe the farthest point beyond reach."""
    try:
        inverse(rules.machine.geometry, position)
    except UnreachableError as error:
        verb = "are" if error.link == "legs" else "is"
        text = f"the path leaves reach: the {error.link} {verb} {error.shortfall:.6g} mm too short"
        return Breach("reach", text, error.shortfall)
    text = f"the path touches the edge of reach at {show(position)} mm"
    return Breach("reach", text, max(lacking, 0.0))


def _put_in_words(rules: Rules, family: int, worst: float, position: FloatArray) -> Breach:
    """Put the worst margin into words."""
    machine, name, short = rules.machine, rules.families[family], max(-worst, 0.0)
    if name == "clearance":
        surface = str(nearest_surface(machine.geometry, WORKING.v, position).family)
        text = (
            f"the clearance to {surface} falls to {machine.clearance + worst:.3g} mm,"
            f" {short:.3g} mm below the clearance of {machine.clearance:g} mm"
        )
        return Breach(surface, text, short)
    if name == "carriage_margin":
        needed = machine.carriage_margin
        text = (
            f"the carriage margin falls to {needed + worst:.3g} mm, {short:.3g} mm below the"
            f" carriage_margin of {needed:g} mm: with the carriages off by that, links may part"
        )
        return Breach(name, text, short)
    carriages = inverse(machine.geometry, position)
    if name == "order":
        text = (
            f"carriages 1 and 2 come within {carriages[1] - carriages[0]:.6g} mm,"
            f" {short:.3g} mm less than carriage_width"
        )
        return Breach("order", text, short)
    if name.startswith("travel"):
        number = int(name[-1])
        text = (
            f"carriage {number} would stand at {carriages[number - 1]:.6g} mm,"
            f" {short:.3g} mm past the end of its travel"
        )
        return Breach("travel", text, short)
    return Breach("keep_out", f"the path is {short:.3g} mm inside {name}", short)


def _find_height(rules: Rules) -> str:
    """Find the nearest height at which the same curve passes."""
    points = rules.curve.position(np.linspace(0.0, rules.curve.end, _LOOKS.shifted))

    def passing(shifts: FloatArray) -> BoolArray:
        up = np.zeros((shifts.size, 1, 3))
        up[:, 0, 2] = shifts
        found = judge_points(rules, (points + up).reshape(-1, 3)).min(axis=1)
        passes: BoolArray = found.reshape(shifts.size, -1).min(axis=1) >= TOUCHING
        return passes

    steps = np.arange(1.0, _LOOKS.highest + 0.5)
    coarse = np.ravel(np.column_stack([steps, -steps]))
    between = _LOOKS.finest * np.arange(1 - round(1.0 / _LOOKS.finest), 2)
    for shift in coarse[passing(coarse)][: _LOOKS.tries]:
        fine = np.copysign(abs(shift) + between, shift)
        for exact in fine[passing(fine)][:2]:
            lifted = replace(rules, curve=rules.curve.moved(np.array([0.0, 0.0, exact])))
            assembled = assembly_error(rules.machine, lifted.curve) is None
            if assembled and first_failure(lifted) == np.inf:
                return f"{abs(exact):.2f} mm {'higher' if exact > 0.0 else 'lower'} it would pass"
    return ""


def _find_part(rules: Rules, failed_at: float) -> str:
    """Name a part of the curve that passes: what comes first, or the longest one after it."""
    along = float(rules.curve.arc_length(failed_at))
    if along > _LOOKS.finest:
        whole = np.floor(along / _LOOKS.finest) * _LOOKS.finest
        return f"its part from 0 to {whole:.2f} mm passes as it is"
    sigma = np.linspace(0.0, rules.curve.end, _LOOKS.samples)
    good = np.concatenate([[False], (margins_at(rules, sigma) >= TOUCHING).all(axis=1), [False]])
    edges = np.flatnonzero(np.diff(good.astype(np.int8)))
    starts, ends = edges[::2], edges[1::2] - 1
    order = np.argsort(starts - ends)
    for i in order[:3]:
        part = sigma[starts[i]], sigma[ends[i]]
        if part[1] > part[0] and first_failure(rules, *part) == np.inf:
            low, high = rules.curve.arc_length(np.array(part))
            return f"its part from {low:.2f} to {high:.2f} mm passes as it is"
    return ""
