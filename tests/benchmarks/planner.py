"""Time the planner and its peers on the same moves, the same limits, in one run; print a table.

    python tests/benchmarks/planner.py [--moves 200] [--seed 1] [--witness 20]

Every method but the last one moves along the same blended curve. "Over reference" is the duration
over that of this planner on a fine grid. A method fails where it gives no motion, or one that
exceeds a limit by more than 0.1 % between its own points. Times are of one core, start-up excluded.

Each of the planner's timings has a row on the same curves, with the jerk limit and without.
"without a jerk limit" is compared with the same reference, so that it is below 1. toppra and
copp-py are asked in units in which the path is about 1 long and takes about 1: in mm and s, toppra
finds nothing on three of the 200 moves of seed 1, where a square of a speed of some 1e7 and its own
tolerances of 1e-10 to 1e-8 do not go together. What copp-py finds is slowed until its samples keep
every limit, as the rest.

The reference is the planner itself. So the first moves, 20 of them, are also timed by direct
collocation with casadi and IPOPT (``witness.py``), which takes some 20 s a move.
"""

from __future__ import annotations

import argparse
import importlib.util
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import ruckig
import toppra
from scipy.ndimage import uniform_filter1d
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

import duoglide as dg
from duoglide.arrays import FloatArray
from duoglide.motion.path.carriage import CarriagePath, map_to_carriages
from duoglide.motion.path.rounded import round_corners
from duoglide.planning.rounding.choice import choose_blends
from duoglide.planning.timing.span import Effort
from duoglide.planning.timing.time_path import time_path

copp_py: Any = None
witness: Any = None
if importlib.util.find_spec("casadi") is not None:
    witness = importlib.import_module("witness")
if importlib.util.find_spec("copp_py") is not None:
    copp_py = importlib.import_module("copp_py")

FINE = Effort(coarse=100, cells=800, per_piece=20, rounds=6, refine=1, tolerance=1e-6)
SAMPLES = 2000
METRE = 1000.0  # mm
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
        pick, place = rng.uniform([-90.0, -150.0, 245.0], [60.0, 150.0, 300.0], (2, 3))
        try:
            path = dg.pick_and_place(pick, place, rng.uniform(10.0, 80.0), rng.uniform(1.0, 8.0))
            path = choose_blends(machine, path).path
            found.append(Move(machine, path, map_to_carriages(dg.check_path(machine, path))))
        except dg.DuoglideError:
            continue
    return found


def this_planner(move: Move) -> float:
    """Time with Duoglide, blends given."""
    return time_path(move.carriages).duration


def by(timing: dg.Timing) -> Callable[[Move], float]:
    """Time with Duoglide by one of its methods."""
    return lambda move: time_path(move.carriages, Effort(timing=timing)).duration


def without_jerk_limit(move: Move) -> float:
    """Time with Duoglide as a machine that is limited in velocity and acceleration alone."""
    limits = move.machine.limits
    free = dg.CarriageLimits(
        velocity=limits.velocity, acceleration=limits.acceleration, jerk=np.inf
    )
    machine = replace(move.machine, limits=free)
    return time_path(map_to_carriages(replace(move.carriages.checked, machine=machine))).duration


def whole_plan(timing: dg.Timing) -> Callable[[Move], float]:
    """Choose blends anew within the same tolerances, check, time and certify stops."""

    def measure(move: Move) -> float:
        deviation = round_corners(move.path).deviation[1:-1]
        path = dg.Path(move.path.segments, tuple(deviation.tolist()))
        return dg.plan(move.machine, path, brake_safe=False, timing=timing).duration

    return measure


def toppra_speed(move: Move, cells: int = 400) -> tuple[FloatArray, FloatArray]:
    """Return toppra's grid and its path speed there: no limit of jerk."""
    limits, end = move.machine.limits, move.carriages.curve.end
    second = float(np.maximum(end / limits.velocity, (end / limits.acceleration) ** 0.5).max())

    class Geometric:
        path_interval = np.array([0.0, 1.0])
        duration, dof, waypoints = 1.0, 3, None

        def __call__(self, share: FloatArray, order: int = 0) -> FloatArray:
            values = move.carriages.derivatives(np.asarray(share, dtype=float) * end)
            return values[..., order, :] * end ** (order - 1)

    scaled = limits.velocity * second / end, limits.acceleration * second**2 / end
    both = [np.stack([-v, v], axis=1) for v in scaled]
    grid = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, cells + 1))
    solver = toppra.algorithm.TOPPRA(
        [JointVelocityConstraint(both[0]), JointAccelerationConstraint(both[1])],
        Geometric(),
        gridpoints=grid,
    )
    solver.compute_parameterization(0.0, 0.0)
    if solver.problem_data.sd_vec is None:
        raise dg.LimitError("toppra")
    return grid * end, solver.problem_data.sd_vec * end / second


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


def copp(move: Move, cells: int = 200, rounds: int = 3) -> float:
    """Time with copp-py: TOPP2-RA, then TOPP3-SOCP with the jerk limit linearised anew; stretch."""
    limits, end = move.machine.limits, move.carriages.curve.end
    second = toppra_alone(move)  # its solver stalls in units of mm and s
    even = np.linspace(0.0, end, cells + 1)
    s = np.unique(np.concatenate([even, move.carriages.curve.breaks]))
    s = s[np.diff(s, prepend=-1.0) > 1e-6]
    states = move.carriages.derivatives(s) * end ** np.arange(-1.0, 3.0)[:, None]
    q = [np.ascontiguousarray(states[:, k]) for k in range(4)]
    s = s / end
    robot = copp_py.Robot(3, capacity=s.size)
    robot.append_s(s)
    robot.set_q(*q[:3], 0, dddq=q[3])
    for order, add, limit in (
        (1, robot.add_velocity_limits, limits.velocity),
        (2, robot.add_acceleration_limits, limits.acceleration),
        (3, robot.add_jerk_limits, limits.jerk),
    ):
        scaled = limit * (second**order / end)
        add(scaled, -scaled, start_idx_s=0, length=s.size)
    solver = copp_py.solver
    try:
        quick = solver.topp2_ra.Problem(
            robot.constraints, idx_s_interval=(0, s.size - 1), a_boundary=(0.0, 0.0)
        )
        a, b = np.array(solver.topp2_ra.solve(quick)), None
        for _ in range(rounds):
            problem = solver.topp3_socp.Problem(robot.constraints, a, b_linearization=b)
            profile = solver.topp3_socp.solve(problem)
            a, b = np.array(profile.a), np.array(profile.b)
        duration, times = copp_py.interpolation.s_to_t_topp3(s, profile)
        step = duration / SAMPLES
        sigma = copp_py.interpolation.t_to_s_topp3_uniform(s, profile, times, step) * end
    except copp_py.CoppError as error:
        raise dg.LimitError(f"copp-py: {error}") from error
    duration, step = duration * second, step * second
    sigma = np.clip(np.append(sigma, end), 0.0, end)
    return float(duration * max(1.0, worst_factor(move, sigma, step)))


def ruckig_on_sigma(move: Move) -> float:
    """Let ruckig move sigma under constant limits, then stretch."""
    end = move.carriages.curve.end
    slopes = np.abs(move.carriages.derivatives(np.linspace(0.0, end, 500))[:, 1]).max(axis=0)
    limits = move.machine.limits
    state = ruckig.InputParameter(1)
    state.target_position = [
        end / METRE
    ]  # with numbers as large as those in mm it gives up at times
    state.max_velocity = [float((limits.velocity / slopes).min()) / METRE]
    state.max_acceleration = [float((limits.acceleration / slopes).min()) / METRE]
    state.max_jerk = [float((limits.jerk / slopes).min()) / METRE]
    motion = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(state, motion)
    step = motion.duration / SAMPLES
    sigma = METRE * np.array([motion.at_time(k * step)[0][0] for k in range(SAMPLES + 1)])
    return float(motion.duration * worst_factor(move, sigma, step))


def stop_at_corners(move: Move) -> float:
    """Go straight to each corner and stop there, each leg at its optimum."""
    corners = tuple(0.0 for _ in move.path.corners)
    exact = dg.Path(move.path.segments, corners)
    return time_path(map_to_carriages(dg.check_path(move.machine, exact))).duration


METHODS: dict[str, Callable[[Move], float]] = {
    "Duoglide, blends given": this_planner,
    "Duoglide, blends chosen": whole_plan(dg.Timing.NEAR_OPTIMAL),
    "Duoglide, timing toppra, retimed under the jerk limit": by(dg.Timing.TOPPRA),
    "Duoglide, timing ruckig": by(dg.Timing.RUCKIG),
    "Duoglide, timing toppra, blends chosen": whole_plan(dg.Timing.TOPPRA),
    "Duoglide, timing ruckig, usual blends": whole_plan(dg.Timing.RUCKIG),
    "Duoglide without a jerk limit (toppra)": without_jerk_limit,
    "toppra alone (no jerk limit: a bound, not a plan)": toppra_alone,
    "toppra, moving average, stretched": toppra_smoothed,
    "ruckig on sigma, stretched": ruckig_on_sigma,
    "stop at the corners, each leg optimal": stop_at_corners,
}


if copp_py is not None:
    METHODS["copp-py TOPP3-SOCP, 201 nodes, stretched"] = copp


def compare_with_witness(every: list[Move], reference: list[float]) -> None:
    """Print how long this planner's motions take beside those that direct collocation finds."""
    if witness is None:
        print("\ncasadi is not installed, no witness is asked: pip install casadi")
        return
    times: list[float] = []
    planned, fine, steps = [], [], []
    for move, best in zip(every, reference, strict=True):
        begin = time.process_time()
        geometry, limits = move.machine.geometry, move.machine.limits
        found, used = witness.witness(geometry, limits, move.carriages.curve)
        times.append(time.process_time() - begin)
        if used:
            planned.append(this_planner(move) / found)
            fine.append(best / found)
            steps.append(used)
    print(
        f"\n{len(steps)} of {len(every)} moves found by direct collocation too (casadi, IPOPT;"
        f" {min(steps)} to {max(steps)} steps, {np.median(times):.0f} s in the median)."
        "\nDuration over that:"
    )
    for name, ratios in (("Duoglide, blends given", planned), ("the reference", fine)):
        low, middle, high = np.quantile(ratios, [0.0, 0.5, 1.0])
        print(f"  {name}: median {middle:.4f}, worst {high:.4f}, least {low:.4f}")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--witness", type=int, default=20, help="moves timed by casadi too")
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
    if copp_py is None:
        print("\ncopp-py is not installed, and not compared: pip install copp-py")
    if chosen.witness:
        compare_with_witness(every[: chosen.witness], reference)


if __name__ == "__main__":
    main()
