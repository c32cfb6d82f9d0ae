"""Runs on end, and what stops them: ``python tests/benchmarks/soak.py [MINUTES] [LOAD] [SEED]``.

Nothing is injected here, so that every stop is a false one. Plans of chance's making (polylines of
2 to 6 lines, with and without rounded corners) are streamed on the virtual bus one after the other,
each with its approach, while chance holds them, goes on, and changes the override. LOAD processes
that compute without a pause run beside. Printed: runs, cycles, stops by their words, setpoints and
feedback lost, lateness of the cycles, and what about the drives was remarked.

The exit code is 1 where a run was stopped.
"""

from __future__ import annotations

import os
import platform
import random
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

import duoglide as dg
from duoglide.control.host.run.handle import RunHandle

MACHINE = dg.Machine.default()
LOW, HIGH = np.array((-75.0, -150.0, 270.0)), np.array((55.0, 150.0, 345.0))
PLANS = 16
PLANNED_TRIES = 40 * PLANS


def make_plans(chance: np.random.Generator) -> list[dg.Trajectory]:
    """Return plans between random points; what a machine refuses is drawn again."""
    plans: list[dg.Trajectory] = []
    for _ in range(PLANNED_TRIES):
        corners = chance.uniform(LOW, HIGH, (int(chance.integers(2, 7)), 3))
        try:
            path = dg.Path.polyline(corners, tolerance=float(chance.choice((0.0, 2.0, 5.0))))
            plans.append(dg.plan(MACHINE, path))
        except dg.DuoglideError:
            continue
        if len(plans) == PLANS:
            break
    return plans


@contextmanager
def loaded(count: int) -> Iterator[None]:
    """Let processes compute meanwhile, as whoever started this one may: with its niceness."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


class Counts:
    """What has been seen so far."""

    def __init__(self) -> None:
        self.runs = self.cycles = self.skipped = self.lost = self.dropped = 0
        self.stops: Counter[str] = Counter()
        self.remarks: Counter[str] = Counter()
        self.late: list[tuple[float, float]] = []
        self.following = np.zeros(3)

    def add(self, report: dg.RunReport) -> None:
        """Count a run."""
        self.runs += 1
        self.cycles += report.cycles
        self.skipped += report.skipped
        self.lost += report.lost
        self.dropped += report.dropped
        self.late.append((report.lateness.p99, report.lateness.worst))
        self.following = np.maximum(self.following, np.abs(report.following_error))
        if not report.completed:
            self.stops["; ".join(trip.words for trip in report.faults) or report.ending] += 1
        self.remarks.update(report.remarks)

    def tell(self) -> None:
        """Print it."""
        p99, worst = np.array(self.late or [(0.0, 0.0)]).T
        print(f"{self.runs} runs, {self.cycles} cycles; stopped: {sum(self.stops.values())}")
        print(f"frames lost or late {self.lost}, cycles left out {self.skipped}", end="")
        print(f", records dropped {self.dropped}")
        print(f"lateness: p99 of a run, median {np.median(p99):.0f} us", end="")
        print(f", worst run {p99.max():.0f} us; worst cycle {worst.max():.0f} us")
        print(f"worst following error {np.round(self.following, 3).tolist()} mm")
        for words, count in (self.stops + self.remarks).most_common(12):
            print(f"  {count:4d}  {words}")


def disturb(handle: RunHandle, chance: random.Random) -> None:
    """Hold, go on and change the override, sometimes, until the run is over."""
    while not handle.done:
        time.sleep(chance.uniform(0.02, 0.2))
        match chance.randrange(8):
            case 0:
                handle.hold()
                time.sleep(chance.uniform(0.02, 0.2))
                handle.resume()
            case 1:
                handle.set_override(chance.uniform(0.1, 1.0))


def soak(seconds: float, plans: list[dg.Trajectory], seed: int) -> Counts:
    """Run plans until the time is over."""
    counts, chance = Counts(), random.Random(seed)
    end = time.monotonic() + seconds
    with dg.Robot.connect(MACHINE) as robot:
        while time.monotonic() < end:
            if not robot.enabled:
                robot.reset_fault()
                robot.enable()
                robot.home()
            handle = robot.start(chance.choice(plans), approach=True)
            disturb(handle, chance)
            counts.add(handle.wait())
    return counts


def main() -> int:
    """Soak, and print."""
    given = list(map(float, sys.argv[1:]))
    minutes, load, seed = given + [15.0, 0.0, 1.0][len(given) :]
    plans = make_plans(np.random.default_rng(int(seed)))
    where = f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}"
    print(f"{minutes:g} min, {len(plans)} plans, {load:g} busy processes, seed {seed:g}; {where}")
    before = os.getloadavg()[0]
    with loaded(int(load)):
        counts = soak(60.0 * minutes, plans, int(seed))
    print(f"load average {before:.1f} at first, {os.getloadavg()[0]:.1f} at last")
    counts.tell()
    return 1 if counts.stops else 0


if __name__ == "__main__":
    sys.exit(main())
