"""Time the planner and its peers on the same moves, the same limits, in one run; print a table.

    python tests/benchmarks/planner.py [--moves 200] [--seed 1]

Every method but the last one moves along the same blended curve. "Over reference" is the duration
over that of this planner on a fine grid. A method fails where it gives no motion, or one that
exceeds a limit by more than 0.1 % between its own points. Times are of one core, start-up excluded.
"""

from __future__ import annotations

import argparse
import importlib.util
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import ruckig
import toppra
from scipy.ndimage import uniform_filter1d
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

import duoglide as dg
from duoglide.arrays import FloatArray
from duoglide.motion.blending import round_corners
from duoglide.motion.carriage_path import CarriagePath, map_to_carriages
from duoglide.planning.blends import choose_blends
from duoglide.planning.timing import time_path
from duoglide.planning.timing_span import Effort

FINE = Effort(coarse=100, cells=800, per_piece=20, rounds=6, refine=1, tolerance=1e-6)
SAMPLES = 2000
QUANTILES = {"median": 0.5, "p95": 0.95, "worst": 1.0}


@dataclass(frozen=True)
class Move:
    """A move as programmed and as checked."""

    machine: dg.Machine
    path: dg.Path
    carriages: CarriagePath


def moves(seed: int, count: int) -> list[Move]:
    """Return feasible moves: lifts 10 to 80 mm, 10 to 150 m/s^2, 316 to 20 000 m/s^3."""
    rng = np.random.default_rng(seed)
    found: list[Move] = []
    while len(found) < count:
        limits = dg.CarriageLimits(
            velocity=rng.uniform(1500.0, 6000.0),
            acceleration=10 ** rng.uniform(4.0, 5.18),
            jerk=10 ** rng.uniform(5.5, 7.3),
        )
        machine = dg.Machine(limits=limits)
        ends = rng.uniform([-90.0, -150.0, 245.0], [60.0, 150.0, 300.0], (2, 3))
        try:
            path = dg.pick_and_place(*ends, rng.uniform(10.0, 80.0), rng.uniform(1.0, 8.0))
            path = choose_blends(machine, path)
            found.append(Move(machine, path, map_to_carriages(dg.check_path(machine, path))))
        except dg.DuoglideError:
            continue
    return found


def this_planner(move: Move) -> float:
    """Time with Duoglide, blends given."""
    return time_path(move.carriages).duration


def with_blends(move: Move) -> float:
    """Choose blends anew within the same tolerances, check, and time."""
    deviation = round_corners(move.path).deviation[1:-1]
    path = dg.Path(move.path.segments, tuple(deviation.tolist()))
    return dg.plan(move.machine, path, brake_safe=False).duration


def toppra_speed(move: Move, cells: int = 400) -> tuple[FloatArray, FloatArray]:
    """Return toppra's grid and its path speed there: no limit of jerk."""
    limits, end = move.machine.limits, move.carriages.curve.end

    class Geometric:
        path_interval = np.array([0.0, end])
        duration, dof, waypoints = end, 3, None

        def __call__(self, sigma: FloatArray, order: int = 0) -> FloatArray:
            values = move.carriages.derivatives(np.asarray(sigma, dtype=float))
            return values[..., order, :]

    both = [np.stack([-v, v], axis=1) for v in (limits.velocity, limits.acceleration)]
    grid = 0.5 * end * (1.0 - np.cos(np.linspace(0.0, np.pi, cells + 1)))
    solver = toppra.algorithm.TOPPRA(
        [JointVelocityConstraint(both[0]), JointAccelerationConstraint(both[1])],
        Geometric(),
        gridpoints=grid,
    )
    solver.compute_parameterization(0.0, 0.0)
    if solver.problem_data.sd_vec is None:
        raise dg.LimitError("toppra")
    return grid, solver.problem_data.sd_vec


def toppra_alone(move: Move) -> float:
    """Return toppra's duration: a bound, not a plan."""
    grid, speed = toppra_speed(move)
    return float(np.sum(2.0 * np.diff(grid) / (speed[1:] + speed[:-1])))


def worst_factor(move: Move, sigma: FloatArray, step: float) -> float:
    """Return the factor of time that brings sampled sigma within every limit, by differences."""
    limits = move.machine.limits
    values = move.carriages.derivatives(np.pad(sigma, 3, mode="edge"))[:, 0]
    factor = 0.0
    for order, limit in enumerate((limits.velocity, limits.acceleration, limits.jerk), start=1):
        values = np.diff(values, axis=0) / step
        factor = max(factor, float((np.abs(values) / limit).max()) ** (1.0 / order))
    return factor


def toppra_smoothed(move: Move) -> float:
    """Smooth toppra's sigma(t) by a moving average, twice, then stretch; best of some windows."""
    grid, speed = toppra_speed(move)
    times = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(grid) / (speed[1:] + speed[:-1]))])
    best = np.inf
    for window in np.geomspace(0.01, 0.3, 8) * times[-1]:
        step = (times[-1] + 2.0 * window) / SAMPLES
        t = np.arange(SAMPLES + 1) * step - window
        size = max(1, round(window / step))
        sigma = np.interp(t, times, grid)
        for _ in range(2):
            sigma = uniform_filter1d(sigma, size, mode="nearest")
        sigma = np.clip(sigma, 0.0, grid[-1])
        best = min(best, (times[-1] + 2.0 * window) * worst_factor(move, sigma, step))
    return float(best)


def ruckig_on_sigma(move: Move) -> float:
    """Let ruckig move sigma under constant limits, then stretch."""
    end = move.carriages.curve.end
    slopes = np.abs(move.carriages.derivatives(np.linspace(0.0, end, 500))[:, 1]).max(axis=0)
    limits = move.machine.limits
    state = ruckig.InputParameter(1)
    state.target_position = [end]
    state.max_velocity = [float((limits.velocity / slopes).min())]
    state.max_acceleration = [float((limits.acceleration / slopes).min())]
    state.max_jerk = [float((limits.jerk / slopes).min())]
    motion = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(state, motion)
    step = motion.duration / SAMPLES
    sigma = np.array([motion.at_time(k * step)[0][0] for k in range(SAMPLES + 1)])
    return float(motion.duration * worst_factor(move, sigma, step))


def stop_at_corners(move: Move) -> float:
    """Go straight to each corner and stop there, each leg at its optimum."""
    corners = tuple(0.0 for _ in move.path.corners)
    exact = dg.Path(move.path.segments, corners)
    return time_path(map_to_carriages(dg.check_path(move.machine, exact))).duration


METHODS: dict[str, Callable[[Move], float]] = {
    "Duoglide, blends given": this_planner,
    "Duoglide, blends chosen": with_blends,
    "toppra alone (no jerk limit: a bound, not a plan)": toppra_alone,
    "toppra, moving average, stretched": toppra_smoothed,
    "ruckig on sigma, stretched": ruckig_on_sigma,
    "stop at the corners, each leg optimal": stop_at_corners,
}


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    every = moves(chosen.seed, chosen.moves)
    reference = [time_path(move.carriages, FINE).duration for move in every]
    print(
        f"{chosen.moves} moves, seed {chosen.seed}; {platform.machine()}, "
        f"Python {platform.python_version()}, numpy {np.__version__}, toppra 0.6, ruckig 0.19\n"
    )
    columns = ["method"]
    columns += [f"{what}: {which}" for what in ("over reference", "ms") for which in QUANTILES]
    print("| " + " | ".join([*columns, "failures"]) + " |")
    print("|---" * (len(columns) + 1) + "|")
    for name, method in METHODS.items():
        method(every[0])
        ratios, times, failures = [], [], 0
        for move, best in zip(every, reference, strict=True):
            begin = time.process_time()
            try:
                ratios.append(method(move) / best)
            except dg.DuoglideError:
                failures += 1
            times.append(1e3 * (time.process_time() - begin))
        ratio = np.quantile(ratios, list(QUANTILES.values()))
        compute = np.quantile(times, list(QUANTILES.values()))
        cells = [f"{value:.3f}" for value in ratio] + [f"{value:.1f}" for value in compute]
        print(f"| {name} | {' | '.join(cells)} | {failures} |")
    if importlib.util.find_spec("copp_py") is None:
        print("\ncopp-py is not installed, and not compared.")


if __name__ == "__main__":
    main()
