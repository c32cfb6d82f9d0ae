"""Plan chained programs path by path: how long they take, how long planning takes, what it holds.

    python tests/benchmarks/programs.py [--picks 1000] [--visits 20] [--seed 1] [--long 1000 ...]

First ``--visits`` chained moves that need not rest at their stations (a drop in passing, a look):
rest to rest, handed over in motion, and planned as one path. The worst audit is that of the
setpoints of the whole program every 50 us, across all seams. Then ``--picks`` chained picks, whose
stations are rests because the way turns back there: planning time, and memory after a tenth of them
and at the end.

With ``--long`` only paths of so many segments of 0.5 mm on a winding curve, each planned in a
process of its own: CPU time a segment, and the largest resident memory.
"""

from __future__ import annotations

import argparse
import multiprocessing
import pathlib
import platform
import resource
import tempfile
import time
import tracemalloc
from collections.abc import Iterator
from functools import reduce
from itertools import pairwise

import numpy as np

import duoglide as dg

STEP = 1.0 / 20_000.0


def visits(seed: int, count: int) -> Iterator[dg.Path]:
    """Yield moves around the machine, each with a station 15 mm below its middle."""
    rng = np.random.default_rng(seed)
    angles = 0.9 * np.arange(count + 1) + rng.uniform(-0.1, 0.1, count + 1)
    x, y = -41.0 + 22.0 * np.cos(angles), 95.0 * np.sin(angles)
    places = np.column_stack([x, y, np.full(count + 1, 300.0)])
    for here, there in pairwise(places):
        station = 0.5 * (here + there) - np.array([0.0, 0.0, 15.0])
        yield dg.Path.polyline([here, station, there], 3.0)


def stations(seed: int, count: int) -> Iterator[tuple[float, float, float]]:
    """Yield stations on both sides of the machine in turn."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        y = rng.uniform(60.0, 120.0) * (-1.0) ** k
        yield float(rng.uniform(-65.0, -20.0)), float(y), float(rng.uniform(270.0, 290.0))


def audit(parts: list[dg.Trajectory]) -> float:
    """Return the worst use of a limit by the setpoints of all parts, one after the other."""
    starts = np.cumsum([0.0, *(part.duration for part in parts)])
    times = np.arange(int(starts[-1] / STEP) + 1) * STEP
    rows = [
        part.at(times[(times >= start) & (times < end)] - start).carriages
        for part, start, end in zip(parts, starts[:-1], starts[1:], strict=True)
    ]
    steps = np.concatenate(rows)
    limits, worst = parts[0].machine.limits, 0.0
    for limit in (limits.velocity, limits.acceleration, limits.jerk):
        steps = np.diff(steps, axis=0) / STEP
        worst = max(worst, float((np.abs(steps) / limit).max()))
    return worst


def compare(seed: int, count: int) -> None:
    """Print rest to rest beside handed over in motion."""
    machine = dg.Machine.default()
    print(f"{count} chained moves, seed {seed}")
    totals = []
    for name, tolerance in (("rest to rest", 0.0), ("handed over in motion", 3.0)):
        begin = time.perf_counter()
        parts = list(dg.plan_program(machine, visits(seed, count), tolerance=tolerance))
        took = time.perf_counter() - begin
        totals.append(sum(part.duration for part in parts))
        moving = sum(part.whole is not None for part in parts)
        print(
            f"  {name:22} {totals[-1]:8.4f} s in {len(parts)} trajectories, {moving} seams in"
            f" motion, worst audit {audit(parts):.5f}, planned in {took / count:.3f} s a move"
        )
    print(f"  saved {100.0 * (1.0 - totals[1] / totals[0]):.1f} %")
    first, *others = visits(seed, count)
    whole = reduce(lambda path, other: path.then(other, 3.0), others, first)
    print(f"  {'as one path':22} {dg.plan(machine, whole).duration:8.4f} s in one trajectory")


def hold(seed: int, count: int) -> None:
    """Print planning time and memory over a long program."""
    machine = dg.Machine.default()
    tracemalloc.start()
    moved, taken, base = 0.0, [], 0
    begin = time.perf_counter()
    for k, trajectory in enumerate(dg.plan_program(machine, dg.picks(stations(seed, count + 1)))):
        taken.append(time.perf_counter() - begin)
        moved += trajectory.duration
        if k == count // 10:
            base = tracemalloc.get_traced_memory()[0]
        begin = time.perf_counter()
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    print(f"{count} chained picks, seed {seed}: {moved:.3f} s of motion")
    print(
        f"  planning (traced): median {np.median(taken):.3f} s a pick, worst {max(taken[1:]):.3f} s"
    )
    print(
        f"  memory: {base / 1e6:.2f} MB after a tenth, {now / 1e6:.2f} MB at the end,"
        f" at most {peak / 1e6:.2f} MB"
    )


def wind(count: int) -> np.ndarray:
    """Return the ends of so many segments of 0.5 mm on a winding curve, shape (count + 1, 3)."""
    t = 0.005 * np.arange(150 * count + 1) / 40.0
    rows = -41.0 + 22.0 * np.sin(0.97 * t), 90.0 * np.sin(0.43 * t), 295.0 + 8.0 * np.sin(0.31 * t)
    points = np.column_stack(rows)
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    at = 0.5 * np.arange(count + 1)
    return np.column_stack([np.interp(at, way, points[:, k]) for k in range(3)])


def read_feeds(points: np.ndarray) -> dg.Path:
    """Return points as a G-code file with F tells them."""
    lines = [f"X{x:.3f} Y{y:.3f} Z{z:.3f}" for x, y, z in points.tolist()]
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "long.nc"
        head = ["G21 G90 G64 P0.05", f"G0 {lines[0]}", f"G1 F3000 {lines[1]}"]
        file.write_text("\n".join(head + lines[2:]), encoding="utf-8")
        return dg.read_program(file)


LONG = {
    "polyline, 0.05": lambda points: dg.Path.polyline(points, 0.05),
    "G-code with F": read_feeds,
    "through": dg.Path.through,
}


def plan_long(name: str, count: int, brake_safe: bool) -> None:
    """Plan one long path, and print what that took."""
    machine = dg.Machine.default()
    dg.plan(machine, LONG[name](wind(50)), brake_safe)  # compiles
    points = wind(count)
    begin = time.process_time()
    path = LONG[name](points)
    read = time.process_time()
    trajectory = dg.plan(machine, path, brake_safe)
    took = time.process_time() - read
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(
        f"  {name:14} {count:6} {'brake-safe' if brake_safe else '':10} read"
        f" {1e3 * (read - begin) / count:.3f} ms, plan {1e3 * took / count:.3f} ms a segment,"
        f" motion {trajectory.duration:.4f} s, {len(trajectory.profile.knots)} knots, {size:.0f} MB"
    )


def compare_long(counts: list[int]) -> None:
    """Print a row for each kind and length, each from a process of its own."""
    for count in counts:
        for name in LONG:
            for safe in (False, True):
                process = multiprocessing.get_context("spawn").Process(
                    target=plan_long, args=(name, count, safe)
                )
                process.start()
                process.join()


def main() -> None:
    """Print both, or long paths."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--picks", type=int, default=1000)
    parser.add_argument("--visits", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--long", type=int, nargs="+", default=[])
    options = parser.parse_args()
    print(f"{platform.processor() or platform.machine()}, Python {platform.python_version()}")
    if options.long:
        compare_long(options.long)
        return
    dg.plan(dg.Machine.default(), next(visits(0, 1)))  # compiles
    compare(options.seed, options.visits)
    hold(options.seed, options.picks)


if __name__ == "__main__":
    main()
