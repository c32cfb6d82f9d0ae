"""The same plan whatever rounding does: with noise, backwards, on other kernels, in any order.

Run as a program, this file plans the moves whose numbers it is given, in that order, and prints
what came out: that is how another process plans them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path as File

import numpy as np
import pytest

import duoglide as dg
from duoglide.arrays import FloatArray
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.rounding.blend import Blend
from duoglide.planning.rounding import choice as blends
from duoglide.planning.timing.span import Rough

DURATION = 1e-6  # relative, to which plans agree
CUT_BACK = 1e-3  # mm
SIZES = (1e-15, 1e-14, 1e-13, 1e-12)  # of the noise, relative
USUAL = (4000.0, 60_000.0, 3e6)  # limits
COUNT = 100  # moves
EVERY = 6  # of them, that the default run takes

Noise = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Move:
    """A move in numbers, before any noise.

    Attributes:
        points: Waypoints; of a pick-and-place move its two ends.
        tolerance: Of all corners [mm].
        lift: Of a pick-and-place move [mm]; 0: the waypoints are a polyline.
        limits: Of the carriages.
        speed: Cap on the tool's speed [mm/s].
        acceleration: Cap on its acceleration [mm/s^2].
        brake_safe: See ``plan``.
    """

    points: tuple[tuple[float, ...], ...]
    tolerance: float
    lift: float = 0.0
    limits: tuple[float, float, float] = USUAL
    speed: float | None = None
    acceleration: float | None = None
    brake_safe: bool = False

    def built(self, noise: Noise = np.asarray) -> tuple[dg.Machine, dg.Path]:
        """Return the machine and the path, with noise on every number."""
        velocity, acceleration, jerk = noise(np.array(self.limits)).tolist()
        limits = dg.CarriageLimits(velocity=velocity, acceleration=acceleration, jerk=jerk)
        points = noise(np.array(self.points))
        lift, tolerance = noise(np.array([self.lift, self.tolerance])).tolist()
        if self.lift > 0.0:
            path = dg.pick_and_place(*points, lift, tolerance)
        else:
            path = dg.Path.polyline(points, tolerance)
        path = replace(path, tool_speed=self.speed, tool_acceleration=self.acceleration)
        return dg.Machine(limits=limits), path


def candidates() -> Iterator[Move]:
    """Yield moves: symmetric and not, with and without room, with ties of every kind."""
    for x, z in ((-41.0, 295.0), (-20.0, 285.0), (-60.0, 290.0)):
        for y in (60.0, 100.0, 140.0):
            for lift, tolerance in ((25.0, 2.0), (10.0, 4.0), (25.0, 8.0), (10.0, 15.0)):
                yield Move(((x, -y, z), (x, y, z)), tolerance, lift)
    for tolerance in (1.0, 3.0, 10.0, 40.0):  # equal lines: an L, a U, a zigzag, a ring
        yield Move(((-41, -50, 270), (-41, 0, 270), (-41, 0, 320)), tolerance)
        yield Move(((-41, -50, 300), (-41, 0, 300), (9, 0, 300)), tolerance)
        yield Move(((-41, -50, 260), (-41, -50, 310), (-41, 0, 310), (-41, 0, 260)), tolerance)
        yield Move(((-71, -60, 290), (-41, -60, 290), (-41, 60, 290), (-71, 60, 290)), tolerance)
        zigzag = [(-41 + 30 * (k % 2), 40 * k - 80, 290) for k in range(5)]
        yield Move(tuple(zigzag), tolerance)
        ring = (-71, -30, 290), (-11, -30, 290), (-11, 30, 290), (-71, 30, 290), (-71, -30, 300)
        yield Move(ring, tolerance)
    for count in (10, 30, 60):
        yield Move(tuple((-41 + 6 * (k % 2), 3 * k - 50, 300) for k in range(count)), 1.0)
    for y in (20.0, 100.0, 150.0):  # where simple motions are the quickest, or nearly
        yield Move(((-41, -y, 300), (-41, y, 300)), 0.0)
        yield Move(((-80, -0.8 * y, 300), (20, 0.8 * y, 290)), 0.0)
    yield Move(((-41, -100, 290), (-41, 0, 310), (-41, 100, 290)), 2.0, speed=800.0)
    lifted = (-41, -100, 290), (-41, -100, 310), (-41, 100, 310), (-41, 100, 290)
    yield Move(lifted, 2.0, acceleration=20_000.0)
    yield Move(lifted, 2.0, brake_safe=True)
    yield Move(((-80, -100, 300), (40, 100, 290)), 0.0, brake_safe=True)
    rng = np.random.default_rng(7)
    while True:
        limits = rng.uniform(1500, 6000), 10 ** rng.uniform(4, 5.18), 10 ** rng.uniform(5.5, 7.3)
        ends = rng.uniform([-90.0, -150.0, 245.0], [60.0, 150.0, 300.0], (2, 3))
        yield Move(_rows(ends), rng.uniform(1, 8), rng.uniform(10, 80), limits)
        points = rng.uniform([-80.0, -120.0, 260.0], [40.0, 120.0, 300.0], (rng.integers(4, 9), 3))
        yield Move(_rows(points), float(10 ** rng.uniform(-0.5, 1.2)))


def _rows(points: FloatArray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in points.tolist())


@cache
def moves() -> list[Move]:
    """Return the first ``COUNT`` of them that the machine can follow."""
    found: list[Move] = []
    for move in candidates():
        try:
            dg.check_path(*move.built())
        except dg.PathError:
            continue
        found.append(move)
        if len(found) == COUNT:
            break
    return found


SOME = range(0, COUNT, EVERY)


@dataclass(frozen=True)
class Outcome:
    """What a plan comes to: how long it takes [s], and the cut-backs of its blends [mm]."""

    duration: float
    cut_backs: tuple[float, ...]

    @classmethod
    def of(cls, move: Move, noise: Noise = np.asarray, backwards: bool = False) -> Outcome:
        """Plan a move."""
        machine, path = move.built(noise)
        path = path.reversed() if backwards else path
        return cls.planned(machine, path, move.brake_safe)

    @classmethod
    def planned(cls, machine: dg.Machine, path: dg.Path, brake_safe: bool) -> Outcome:
        """Plan a path."""
        plan = dg.plan(machine, path, brake_safe=brake_safe)
        assert isinstance(plan.path, CarriagePath)
        rounded = [c for c in plan.path.checked.path.corners if isinstance(c, Blend)]
        cuts = tuple(cut for c in rounded for cut in (c.before, c.after))
        return cls(plan.duration, cuts)

    def assert_same(self, other: Outcome) -> None:
        """Compare with what rounding may have changed."""
        assert other.duration == pytest.approx(self.duration, rel=DURATION)
        assert other.cut_backs == pytest.approx(self.cut_backs, rel=0.0, abs=CUT_BACK)


def noisy(rng: np.random.Generator, size: float) -> Noise:
    return lambda values: values * (1.0 + size * rng.uniform(-1.0, 1.0, values.shape))


def disturb_estimates(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator, size: float
) -> None:
    """Put noise on every estimate that a choice of blends makes."""
    honest = blends.estimate

    def disturbed(*given: object) -> Rough:
        found = honest(*given)  # type: ignore[arg-type]
        return replace(found, duration=found.duration * (1.0 + size * rng.uniform(-1.0, 1.0)))

    monkeypatch.setattr(blends, "estimate", disturbed)


def assert_noise_changes_nothing(monkeypatch: pytest.MonkeyPatch, number: int, size: float) -> None:
    rng = np.random.default_rng(number)
    quiet = Outcome.of(moves()[number])
    with monkeypatch.context() as patch:
        disturb_estimates(patch, rng, size)
        quiet.assert_same(Outcome.of(moves()[number], noisy(rng, size)))


@pytest.mark.parametrize("number", SOME)
def test_noise_on_inputs_and_estimates_changes_no_plan(
    monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    size = SIZES[number // EVERY % len(SIZES)]
    assert_noise_changes_nothing(monkeypatch, number, size)


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("number", range(COUNT))
def test_noise_changes_none_of_all_the_plans(
    monkeypatch: pytest.MonkeyPatch, number: int, size: float
) -> None:
    assert_noise_changes_nothing(monkeypatch, number, size)


def assert_the_way_back_takes_as_long(number: int) -> None:
    there, back = (
        Outcome.of(replace(moves()[number], brake_safe=False), backwards=b) for b in (0, 1)
    )
    there.assert_same(Outcome(back.duration, back.cut_backs[::-1]))


@pytest.mark.parametrize("number", SOME)
def test_a_move_and_its_reverse_take_the_same_time(number: int) -> None:
    assert_the_way_back_takes_as_long(number)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(COUNT))
def test_every_move_and_its_reverse_take_the_same_time(number: int) -> None:
    assert_the_way_back_takes_as_long(number)


SYMMETRIC = [  # 126: z is lower where more is lifted, so that all are within reach
    (x, y, lift, tolerance)
    for x in (-60.0, -41.0, -20.0)
    for y in (40.0, 80.0, 120.0)
    for lift in (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0)
    for tolerance in (2.0, 8.0)
]


def assert_symmetric_twice(x: float, y: float, lift: float, tolerance: float) -> None:
    """Plan a move whose mirror image is its way back; both ways, and with an ulp more."""
    machine = dg.Machine.default()
    a, b = (x, -y, 310.0 - lift), (x, y, 310.0 - lift)
    there = Outcome.planned(machine, dg.pick_and_place(a, b, lift, tolerance), brake_safe=False)
    back = Outcome.planned(machine, dg.pick_and_place(b, a, lift, tolerance), brake_safe=False)
    there.assert_same(Outcome(back.duration, back.cut_backs[::-1]))
    nudged = (float(np.nextafter(x, 0.0)), y, 310.0 - lift)
    there.assert_same(
        Outcome.planned(machine, dg.pick_and_place(a, nudged, lift, tolerance), brake_safe=False)
    )


@pytest.mark.parametrize("move", SYMMETRIC[::18])
def test_a_mirror_image_that_is_the_reverse_takes_the_same_time(
    move: tuple[float, float, float, float],
) -> None:
    assert_symmetric_twice(*move)


@pytest.mark.slow
@pytest.mark.parametrize("move", SYMMETRIC)
def test_each_of_126_symmetric_moves_is_one_plan(move: tuple[float, float, float, float]) -> None:
    assert_symmetric_twice(*move)


def _winding(noise: Noise) -> list[dg.Path]:
    """Return paths of two lines each, which meet at an angle."""
    k = np.arange(7)
    rows = -41.0 + 25.0 * np.cos(0.9 * k), 95.0 * np.sin(0.7 * k), 285.0 + 15.0 * np.sin(1.3 * k)
    points = noise(np.column_stack(rows))
    return [dg.Path.polyline(points[2 * i : 2 * i + 3], 3.0) for i in range(3)]


def _straight(noise: Noise) -> list[dg.Path]:
    """Return lines of round lengths, where windows and seams are decided by ties."""
    points = noise(np.array([(-41.0, 40.0 * k - 80.0, 290.0 + 10.0 * (k % 2)) for k in range(5)]))
    return [dg.Path.line(a, b) for a, b in pairwise(points)]


@pytest.mark.parametrize("paths", [_winding, _straight])
def test_noise_changes_no_part_of_a_program(paths: Callable[[Noise], list[dg.Path]]) -> None:
    limits = dg.CarriageLimits(velocity=1500.0, acceleration=60e3, jerk=3e6)
    machine = dg.Machine(limits=limits)
    rng = np.random.default_rng(3)
    expected, *others = (
        [t.duration for t in dg.plan_program(machine, paths(noise), False, tolerance=3.0)]
        for noise in (np.asarray, noisy(rng, 1e-15), noisy(rng, 1e-12))
    )
    assert len(expected) > 1
    for found in others:
        assert found == pytest.approx(expected, rel=DURATION)


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        ((-41.0, -100.0, 290.0), (-41.0, 100.0, 290.0)),
        ((-41.0, -100.0, 300.0), (-80.0, 60.0, 260.0)),
        ((-41.0, 0.0, 300.0), (0.0, 0.0, 300.0)),
    ],
)
def test_noise_changes_no_transfer(
    start: tuple[float, float, float], goal: tuple[float, float, float]
) -> None:
    machine = dg.Machine.default()
    rng = np.random.default_rng(4)
    expected = dg.transfer(machine, start, goal).duration
    for size in SIZES:
        ends = noisy(rng, size)(np.array([start, goal]))
        assert dg.transfer(machine, *ends).duration == pytest.approx(expected, rel=DURATION)


@pytest.mark.parametrize("over", [(3.0, 3.0, 3.0), (0.0, 0.0, 25.0)])
def test_noise_changes_no_way_out(over: tuple[float, float, float]) -> None:
    machine = dg.Machine.default()
    home = dg.inverse(machine.geometry, (-41.0, 0.0, 300.0))
    least = machine.geometry.rail_half_length - np.abs(home).max()
    start = home + least + np.array(over) if over[0] else home + np.array(over)
    rng = np.random.default_rng(5)
    expected = dg.recover(machine, start)
    for size in SIZES:
        found = dg.recover(machine, noisy(rng, size)(start))
        assert found.duration == pytest.approx(expected.duration, rel=DURATION)
        assert found.end == pytest.approx(expected.end, abs=CUT_BACK)


def elsewhere(numbers: list[int], **environment: str) -> dict[int, Outcome]:
    """Plan moves in another process, in the order given."""
    run = subprocess.run(
        [sys.executable, __file__, json.dumps(numbers)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    rows = json.loads(run.stdout)
    return {number: Outcome(duration, tuple(cuts)) for number, duration, cuts in rows}


BLAS = {"OPENBLAS_CORETYPE": "Nehalem", "OPENBLAS_NUM_THREADS": "1"}
PLAIN_NUMPY = {"NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX"}


def assert_planned_alike(numbers: list[int], **environment: str) -> None:
    shuffled = np.random.default_rng(len(numbers)).permutation(numbers).tolist()
    other = elsewhere(shuffled, **environment)
    for number in numbers:
        Outcome.of(moves()[number]).assert_same(other[number])


def test_another_process_with_other_kernels_and_another_order_plans_the_same() -> None:
    assert_planned_alike(list(SOME), **BLAS, **PLAIN_NUMPY)


@pytest.mark.slow
@pytest.mark.parametrize("environment", [BLAS, PLAIN_NUMPY, {"NUMBA_CPU_NAME": "generic"}])
def test_every_kernel_plans_the_same(
    pytestconfig: pytest.Config, environment: dict[str, str]
) -> None:
    if "NUMBA_CPU_NAME" in environment:  # what is compiled for that has a place of its own
        folder: File = pytestconfig.cache.mkdir("numba_generic")
        environment = {**environment, "NUMBA_CACHE_DIR": str(folder)}
    assert_planned_alike(list(range(COUNT)), **environment)


if __name__ == "__main__":
    planned = [(number, Outcome.of(moves()[number])) for number in json.loads(sys.argv[1])]
    print(json.dumps([(number, out.duration, out.cut_backs) for number, out in planned]))
