"""Staying on the path, attacked: ``python tests/benchmarks/led_stops.py [PLANS] [FAULTS] [SEED]``.

Random four-point polylines of the default machine are planned as anybody would plan them, and run
on simulated drives, by a clock that is a counter. A random drive fails at a random cycle, in half
of the cases at its beginning and else somewhere in it: once where it is promised that the platform
stays within a millimetre of its path, once anywhere. In half of the latter another drive fails some
cycles later. Whether links part is asked of the lengths. Then setpoints of a random drive are lost
for good at a random cycle, once with the drive followed and once not.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from braking import random_path
from cell_by_hand import CellByHand
from drive_stops import closes
from led_runs import LedRuns, by_themselves, fail, given_up

import duoglide as dg
from duoglide.drives import pdo

CYCLES = 70


def random_runs(machine: dg.Machine, rng: np.random.Generator) -> LedRuns:
    """Plan the next random path that can be planned."""
    while True:
        try:
            return LedRuns.of(dg.plan(machine, random_path(machine, rng)))
        except dg.DuoglideError:
            continue


def _fail_at(again: int, cell: CellByHand, axis: int) -> Callable[[int], None]:
    """Return what lets another drive fail after so many cycles; -1: never."""
    return lambda cycles: fail(cell, axis) if cycles == again else None


def lose(runs: LedRuns, axis: int, rng: np.random.Generator) -> tuple[float, float]:
    """Lose an axis's setpoints for good; return how far the platform leaves its path [mm].

    Returns:
        Where the drive is not followed, as it was once, and where it is; inf where links part.
    """
    assert runs.stops is not None
    cycle = int(rng.integers(2, len(runs.stops.promised) - 4))
    off = []
    for each in (LedRuns(runs.plan, None), runs):
        cell = each.until(cycle)
        cell.to_drives = lambda frame: [] if frame[0] == pdo.RPDO1 + axis else [frame]
        places: list[np.ndarray] = []
        away = each.off_path(cell, CYCLES, None, places)
        off.append(away if closes(runs.plan.machine.geometry, np.array(places)).all() else np.inf)
    return off[0], off[1]


def main(plans: int = 20, faults: int = 20, seed: int = 1) -> None:
    """Plan, fail, count."""
    machine, rng = dg.Machine.default(), np.random.default_rng(seed)
    lost: list[tuple[float, float]] = []
    shares, promised, elsewhere, apart, left, ends = [], [], [], 0, 0, {True: 0, False: 0}
    for _ in range(plans):
        runs = random_runs(machine, rng)
        assert runs.stops is not None
        shares.append(runs.stops.shares)
        for number in range(2 * faults):
            axis = int(rng.integers(1, 4))
            cycles = runs.promised(axis) if number % 2 else range(len(runs.stops.promised) - 3)
            if not len(cycles):
                continue
            cycle = int(rng.choice(cycles))
            cell = runs.until(cycle)
            if rng.random() < 0.5:
                cell.pass_within(float(rng.random()))
            fail(cell, axis)
            again = int(rng.integers(1, 8)) if number % 4 == 2 else -1
            other = axis % 3 + 1

            places: list[np.ndarray] = []
            off = runs.off_path(cell, CYCLES, _fail_at(again, cell, other), places)
            apart += not closes(machine.geometry, np.array(places)).all()
            if number % 2:
                promised.append(off)
                left += by_themselves(cell) or given_up(cell)
                if off > 1.0:
                    print(f"  {off:.2f} mm: axis {axis}, cycle {cycle}, {runs.plan!r}", flush=True)
            elif again < 0:
                elsewhere.append(off)
                ends[by_themselves(cell)] += 1
        lost += [lose(runs, int(rng.integers(1, 4)), rng) for _ in range(faults)]
    print(f"{plans} plans, seed {seed}; promised for {np.mean(shares, axis=0).round(2)} of them")
    print(f"links apart in {apart} runs of {plans * 2 * faults}, in which a second drive may fail")
    print(
        f"where promised: {len(promised)} faults, off path median {np.median(promised):.2f} mm,"
        f" 99 % {np.quantile(promised, 0.99):.2f}, worst {max(promised):.2f};"
        f" over 1 mm: {sum(off > 1.0 for off in promised)}; not followed to the end: {left}"
    )
    print(
        f"anywhere: {len(elsewhere)} faults, {ends[False]} followed to the end, {ends[True]} not;"
        f" off path median {np.median(elsewhere):.2f} mm, worst {max(elsewhere):.2f}"
    )
    print(f"setpoints of an axis lost for good, {len(lost)} times:")
    for words, off in zip(("not followed", "followed"), np.transpose(lost), strict=True):
        median, high = np.quantile(off, (0.5, 0.9), method="lower")
        print(f"  drive {words}: median {median:.2f} mm, 90 % {high:.2f}, worst {off.max():.2f}")
    worse = sum(after > before + 0.1 for before, after in lost)
    print(f"  followed and farther off than not followed: {worse}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
