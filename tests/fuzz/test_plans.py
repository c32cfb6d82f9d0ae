"""Plans that somebody has tampered with: what still loads and may run is safe to stream.

Numbers, lists and words of the document are changed at random. Whatever the file then says, a plan
that loads and that a machine takes is judged here by means of their own: positions as the cycles
and finer ones send them, through the inverse kinematics, their finite differences against the
limits, the clearance by its formula, and stops from anywhere against the stop limits.

The default run takes a few hundred; ``pytest -m slow tests/fuzz/test_plans.py`` takes 20 000.
"""

from __future__ import annotations

import copy
import random
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from damaged_logs import spoilt_value

import duoglide as dg
from duoglide.control.host.run.fitness import require_fit
from duoglide.motion.pace import Pace
from duoglide.motion.path.transfer import TransferPath
from duoglide.motion.path_clock import ClockState, PathClock

Document = dict[str, Any]
STEP = 1e-4  # [s] of the differences
ROUNDING = 1.002  # times a limit, which the finite differences may show
FEW, MANY = 120, 20_000


@cache
def whole_plans() -> dict[str, Document]:
    """Return the documents of good plans."""
    machine = dg.Machine.default()
    line = dg.plan(machine, dg.Path.line((-41, -15, 300), (-41, 15, 305)), brake_safe=False)
    pick = dg.plan(machine, dg.pick_and_place((-41, -20, 295), (-41, 20, 295), lift=8.0))
    corner = dg.plan(machine, dg.Path.polyline([(-41, -15, 300), (-41, 0, 310), (-41, 15, 300)]))
    move = dg.transfer(machine, (-41, 0, 300), (-41, 30, 300))
    slow = dg.Trajectory.repaced(move, Pace(*_slow_clock(move)))
    named = {"line": line, "pick": pick, "corner": corner, "transfer": move, "run": slow}
    return {name: plan.to_document() for name, plan in named.items()}


def _slow_clock(plan: dg.Trajectory) -> tuple[list[float], list[float], list[float]]:
    """Run a plan at half its speed, held once on the way."""
    clock = PathClock(plan.stops, 0.001, override=0.5)
    times, path_times, rates = [0.0], [0.0], [clock.rate]
    while clock.state is not ClockState.FINISHED:
        if len(times) == 30:
            clock.hold()
        if clock.state is ClockState.HELD:
            clock.resume()
        u, rate = clock.step(0.001)
        times.append(0.001 * len(times))
        path_times.append(u)
        rates.append(rate)
    return times, path_times, rates


def numbers_of(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where the numbers of a document are."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        if isinstance(item, dict | list):
            yield from numbers_of(item, (*place, key))
        elif isinstance(item, float | int) and not isinstance(item, bool):
            yield (*place, key)


def tampered(document: Document, noise: random.Random) -> Document:
    """Return a document with something in it changed: a little, a lot, or beyond sense."""
    if "profile" in document and noise.random() < 0.3:
        return with_another_profile(document, noise)
    if noise.random() < 0.3:
        return spoilt_value(document, noise)
    result = copy.deepcopy(document)
    places = list(numbers_of(result))
    if noise.random() < 0.7:  # half of all changes are in what moves the machine
        wanted = ("profile", "curve", "polynomials", "breaks", "stops", "limits", "pace")
        chosen = noise.choice(wanted)
        places = [place for place in places if chosen in place] or places
    for _ in range(noise.choice((1, 1, 1, 2, 4))):
        *way, last = noise.choice(places)
        target: Any = result
        for key in way:
            target = target[key]
        by = noise.gauss(0.0, 1.0) * 10.0 ** noise.uniform(-9, 2)
        target[last] = noise.choice((target[last] * (1.0 + by), target[last] + by, by))
    return result


def with_another_profile(document: Document, noise: random.Random) -> Document:
    """Return a document that goes along its curve otherwise, as an attacker would have it."""
    result = copy.deepcopy(document)
    knots = result["profile"]
    at = noise.randrange(len(knots) - 1)
    to = min(len(knots) - 1, at + noise.randrange(1, 30))
    quicker = 1.0 + 10.0 ** noise.uniform(-6.0, 0.3)
    match noise.randrange(6):
        case 0:  # knots are left out
            del knots[at:to]
        case 1:  # a part of the way takes next to no time
            later = _after(knots[at][0], noise.choice((0.0, 1e-12, 1e-10, 1e-9, 1e-6, 1e-3)))
            by = later - knots[to][0]
            rest = [[later, *knots[to][1:]], *([t + by, *row] for t, *row in knots[to + 1 :])]
            result["profile"] = knots[: at + 1] + rest
        case 2:  # all of it is quicker
            result["profile"] = [
                [t / quicker, s, v * quicker, a * quicker**2] for t, s, v, a in knots
            ]
        case 3:  # a part of it is quicker
            saved = (knots[to][0] - knots[at][0]) * (1.0 - 1.0 / quicker)
            for row in knots[to:]:
                row[0] -= saved
        case 4:  # it leaps
            leap = noise.choice((-1.0, 1.0)) * 10.0 ** noise.uniform(-9.0, 1.0)
            for row in knots[at:]:
                row[1] += leap
        case _:  # it shakes
            for row in knots[at:to]:
                row[3] += noise.gauss(0.0, 10.0 ** noise.uniform(-3.0, 6.0))
    return result


def _after(t: float, seconds: float) -> float:
    """Return a later time; 0 seconds later is the next that there is."""
    return max(t + seconds, float(np.nextafter(t, np.inf)))


def read(document: Document) -> dg.Trajectory | str:
    """Load a document and have the default machine take it; return what refuses it otherwise."""
    try:
        trajectory = dg.Trajectory.from_document(document)
        fit, _ = require_fit(trajectory, dg.Machine.default())
    except dg.DuoglideError as error:
        assert 5 < len(str(error)) < 1500
        return type(error).__name__
    return fit


def positions(trajectory: dg.Trajectory, times: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the carriages at path times, by their own way, shape (n, 3)."""
    path, sigma = trajectory.path, trajectory.profile.at(times)[:, 0]
    if isinstance(path, TransferPath):
        return path.derivatives(sigma)[:, 0]
    return dg.inverse(dg.Machine.default().geometry, path.curve.position(sigma))


def require_differences(rows: Any, step: float, limits: dg.CarriageLimits, what: str) -> None:
    """Require velocity, acceleration and jerk by differences to be within limits."""
    for name in ("velocity", "acceleration", "jerk"):
        rows = np.diff(rows, axis=0) / step
        use = (np.abs(rows) / getattr(limits, name)).max()
        assert use <= ROUNDING, f"{what}: {use:.4f} of limits.{name}"


def require_safe(trajectory: dg.Trajectory, noise: random.Random) -> None:
    """Judge a trajectory that was loaded, taken, and would be streamed."""
    machine = dg.Machine.default()
    recorded = trajectory.pace is not None
    cycle = machine.drives.cycle
    step = cycle if recorded else STEP
    limits = machine.stop_limits if recorded else machine.limits
    count = min(int(trajectory.duration / step), 40_000) + 4
    rows = positions(trajectory, step * np.arange(-3, count))
    require_differences(rows, step, limits, "at full rate")
    room = dg.clearance(machine.geometry, dg.forward(machine.geometry, rows))
    assert room.min() >= machine.clearance - 1e-3
    assert (np.abs(rows) <= machine.geometry.rail_half_length + 1e-6).all()
    if recorded:
        return  # its own changes of pace may have used the stop limits up
    for share in (noise.uniform(0.0, 0.9), noise.uniform(0.0, 0.9)):
        clock = PathClock(trajectory.stops, STEP, start=0.0)
        u = [0.0] * 4
        while clock.state not in (ClockState.STOPPED, ClockState.FINISHED) and len(u) < 40_000:
            if u[-1] >= share * trajectory.duration and clock.state is ClockState.RUNNING:
                clock.stop()
            u.append(clock.step(STEP)[0])
        u += [u[-1]] * 3
        stopping = positions(trajectory, np.array(u))
        require_differences(stopping, STEP, machine.stop_limits, f"stopped at {share:.3f}")


@pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that no motion has
def test_a_tampered_plan_that_still_loads_is_the_same_or_safe(count: int) -> None:
    noise, became = random.Random(7), Counter[str]()
    names = sorted(whole_plans())
    same = {name: read(whole_plans()[name]) for name in names}
    for number in range(count):
        name = names[number % len(names)]
        document = tampered(whole_plans()[name], noise)
        try:
            found = read(document)
            if isinstance(found, str):
                became[found] += 1
                continue
            good = same[name]
            assert isinstance(good, dg.Trajectory)
            if found.to_document() == good.to_document():
                became["the same"] += 1
                continue
            require_safe(found, noise)
            became["another, safe"] += 1
        except BaseException as error:
            error.add_note(f"input {number}, of {name}")
            raise
    print(dict(became))
    assert became["the same"] > count // 50
    assert became["another, safe"] > count // 100
    assert sum(became[name] for name in ("InputError", "PathError", "LimitError")) > count // 4


def _of(name: str) -> Document:
    return copy.deepcopy(whole_plans()[name])


def _jump(document: Document, k: int = 0, seconds: float = 1e-6) -> None:
    """Go 7.9 mm or a little more within 1 us, between two samples of any clock."""
    knots = document["profile"]
    k = k or len(knots) // 2
    j = next(i for i, row in enumerate(knots) if row[1] >= knots[k][1] + 7.9)
    begin = _after(knots[k][0], seconds)
    later = ([t - knots[j][0] + begin, *rest] for t, *rest in knots[j:])
    document["profile"] = [*knots[: k + 1], *later]


def _loose(document: Document) -> None:
    """Say that the machine may do anything, and make use of it."""
    document["checked"]["machine"]["limits"]["jerk"] = [1e12] * 3
    document["checked"]["machine"]["limits"]["acceleration"] = [1e9] * 3
    document["profile"] = [[t / 3, s, v * 3, a * 9] for t, s, v, a in document["profile"]]


def _recorded(document: Document) -> None:
    """Ask for the stop limits by a word."""
    document["report"]["method"] = "recorded"
    document["profile"] = [[t / 1.1, s, v * 1.1, a * 1.21] for t, s, v, a in document["profile"]]


@pytest.mark.parametrize(
    ("tamper", "words"),
    [(_jump, r"carriage \d would need .* mm/s\^3"), (_recorded, r"carriage \d would need")],
)
def test_what_no_machine_could_follow_is_not_loaded(
    tamper: Callable[[Document], None], words: str
) -> None:
    document = _of("line")
    tamper(document)
    with pytest.raises(dg.LimitError, match=words):
        dg.Trajectory.from_document(document)


@pytest.mark.parametrize("knot", range(10, 20))
def test_a_jump_from_one_number_to_the_next_is_not_loaded(knot: int) -> None:
    document = _of("line")
    _jump(document, knot, seconds=0.0)
    with pytest.raises((dg.LimitError, dg.PathError), match=r"would need|goes backwards"):
        dg.Trajectory.from_document(document)


def test_limits_inside_a_plan_are_not_those_of_the_machine_that_streams() -> None:
    document = _of("line")
    _loose(document)
    trajectory = dg.Trajectory.from_document(document)
    with pytest.raises(dg.LimitError, match=r"limits\.jerk of this machine"):
        require_fit(trajectory, dg.Machine.default())


def test_stop_bounds_and_the_claim_to_be_brake_safe_are_derived_again() -> None:
    document, whole = _of("line"), dg.Trajectory.from_document(_of("line"))
    for way in ("falling", "rising"):
        table = document["stops"][way]
        table["slope"] = [1e6] * len(table["slope"])
        table["bend"] = [1e12] * len(table["bend"])
    document["checked"]["report"] = [
        [f, 1e3, *rest] for f, _, *rest in document["checked"]["report"]
    ]
    document["report"] |= {"brake_safe": True, "braking_clearance": 1e3}
    again = dg.Trajectory.from_document(document)
    assert again.stops == whole.stops
    assert again.path.least_clearance == whole.path.least_clearance < 1e3
    assert not again.report.braking_clearance > again.path.least_clearance


def test_a_pace_faster_than_planned_is_none() -> None:
    document = _of("run")
    document["pace"]["times"] = [0.45 * t for t in document["pace"]["times"]]
    with pytest.raises(dg.InputError, match="nor faster than planned"):
        dg.Trajectory.from_document(document)


def test_a_corner_is_not_taken_at_speed() -> None:
    corner = dg.Trajectory.from_document(_of("corner"))
    knots, end = corner.profile.knots, corner.profile.end
    ((rest,),) = (corner.path.curve.rests,)
    line = dg.plan(corner.machine, dg.Path.line((-41, -18, 300), (-41, 18, 300)))
    through = line.profile.knots * np.array([1.0, end / line.profile.end, 1.0, 1.0])
    through[:, 2:] *= end / line.profile.end
    document = _of("corner")
    document["profile"] = through.tolist()
    assert 0.0 < rest < end and len(knots) > 2
    with pytest.raises(dg.PathError, match="a motion must rest at a corner"):
        dg.Trajectory.from_document(document)


def test_the_independent_judge_sees_what_is_not_safe() -> None:
    good = dg.Trajectory.from_document(_of("line"))
    fast = replace(good, profile=good.profile.stretch(0.98))
    with pytest.raises(AssertionError, match="at full rate"):
        require_safe(fast, random.Random(1))
    stops = replace(
        good.stops,
        falling=replace(
            good.stops.falling,
            slope=good.stops.falling.slope * 3.0,
            bend=good.stops.falling.bend * 9.0,
        ),
    )
    with pytest.raises(AssertionError, match="stopped at"):
        require_safe(replace(good, stops=stops), random.Random(1))
