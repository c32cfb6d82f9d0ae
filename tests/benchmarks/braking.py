"""Brake safety, attacked: ``python tests/benchmarks/braking.py [PLANS] [SEED]``.

Random four-point polylines of the default machine are planned as anybody would plan them. Then any
subset of the drives begins to brake at any time, the others follow within the reaction time, each
with a deceleration of its own. Printed: how many plans came apart, and what the safety costs.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import duoglide as dg

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from drive_stops import least_carriage_margin, least_clearance, random_stops

STOPS = 400
ALLOWED = 1e-3  # mm that the certificate may take
SHARES = np.linspace(0.0, 1.0, 60)


def random_path(machine: dg.Machine, rng: np.random.Generator) -> dg.Path:
    """Draw four points whose clearance is over 3 mm."""
    while True:
        points = rng.uniform([-90.0, -150.0, 235.0], [90.0, 150.0, 325.0], (4, 3))
        inside = dg.reachable(machine.geometry, points).all()
        if inside and dg.clearance(machine.geometry, points).min() > 3.0:
            return dg.Path.polyline(points, tolerance=4.0)


def main(plans: int = 200, seed: int = 1) -> None:
    """Plan, stop, count."""
    machine, rng = dg.Machine.default(), np.random.default_rng(seed)
    print(f"{plans} plans, {STOPS} stops each, seed {seed}, {machine.reaction_cycles} cycles")
    apart = below = tight = refused = unsafe_before = 0
    costs, took, left = [], [], []
    while len(costs) < plans:
        path = random_path(machine, rng)
        try:
            draft = dg.plan(machine, path, brake_safe=False)
        except dg.DuoglideError:
            continue
        stops = random_stops(draft, STOPS, rng)
        unsafe_before += least_clearance(draft, stops.at(draft, SHARES)) == -np.inf
        begin = time.process_time()
        try:
            safe = dg.plan(machine, path)
        except dg.PathError:
            refused += 1
            continue
        took.append(time.process_time() - begin)
        costs.append(safe.duration / draft.duration)
        stops = random_stops(safe, STOPS, rng)
        carriages = stops.at(safe, SHARES)
        found = least_clearance(safe, carriages)
        margin = least_carriage_margin(safe, carriages)
        tight += margin < machine.carriage_margin - ALLOWED
        apart += found == -np.inf
        below += found < safe.report.braking_clearance - 1e-6
        left.append(found - safe.report.braking_clearance)
    quarter, half, most = np.quantile(costs, [0.25, 0.5, 1.0])
    print(f"came apart: {apart}; below the clearance that was certified: {below}")
    print(f"below the carriage margin of {machine.carriage_margin:g} mm: {tight}")
    print(f"without being made brake-safe {unsafe_before} of {plans + refused} would come apart")
    print(f"refused, as no speed is safe: {refused}")
    print(f"times as long: quartile {quarter:.3f}, median {half:.3f}, worst {most:.3f}")
    print(f"planning: median {1e3 * np.median(took):.0f} ms, worst {1e3 * max(took):.0f} ms")
    print(f"found above the certified clearance: median {np.median(left):.2f} mm")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
