"""How fast the kinematics are: run with ``python tests/benchmarks/kinematics.py [POSES]``.

Batches are compared with a plain copy of the same positions, in the same run and thread; numpy
alone and a numerical inverse kinematics (on the loop closure) stand beside them.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.optimize import root

import duoglide as dg
from duoglide.kinematics import batch
from duoglide.kinematics.model import inverse_derivatives

SEED = 0
ROUNDS = 15
WARM_START = """
import sys, time, numpy as np, duoglide as dg
poses = np.tile([-41.0, 0.0, 302.0], (1_000_000, 1))
dg.inverse(dg.Geometry(), poses[:1])
for _ in range(2):
    start = time.perf_counter()
    dg.inverse(dg.Geometry(), poses)
    print(time.perf_counter() - start, "numba" in sys.modules)
"""


def processor() -> str:
    """Name the processor, where the system tells."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f"{len(names)} x {names[0]}" if names else platform.processor()


def seconds(task: Callable[[], object], rounds: int = ROUNDS) -> np.ndarray:
    """Return how long each of ``rounds`` runs of a task takes [s]."""
    times = []
    for _ in range(rounds):
        start = perf_counter()
        task()
        times.append(perf_counter() - start)
    return np.array(times)


def show(name: str, times: np.ndarray, unit: float, reference: float = 0.0) -> None:
    """Print best, median and worst of ``times`` in ``unit`` seconds, and best in copies."""
    best, middle, worst = times.min() / unit, np.median(times) / unit, times.max() / unit
    ratio = f"{times.min() / reference:7.2f}" if reference else ""
    print(f"{name:<44}{best:10.3f}{middle:10.3f}{worst:10.3f}{ratio}")


def random_positions(geometry: dg.Geometry, count: int) -> np.ndarray:
    """Draw reachable positions of the working mode that are clear of every surface."""
    rng = np.random.default_rng(SEED)
    found = np.empty((0, 3))
    while len(found) < count:
        cube = rng.uniform((-135.0, -150.0, 80.0), (225.0, 150.0, 370.0), (count, 3))
        cube = cube[dg.reachable(geometry, cube)]
        sides = dg.margins(geometry, cube)
        clear = (sides.legs_flat > 1.0) & (sides.arm_strut > 1.0) & (sides.strut > 1.0)
        found = np.concatenate([found, cube[clear]])
    return np.ascontiguousarray(found[:count])


def batches(geometry: dg.Geometry, position: np.ndarray) -> None:
    """Compare batches of poses with a copy of them."""
    carriages = dg.inverse(geometry, position)
    jobs: dict[str, Callable[[], object]] = {
        "inverse": lambda: dg.inverse(geometry, position),
        "forward": lambda: dg.forward(geometry, carriages),
        "margins": lambda: dg.margins(geometry, position),
        "margins, all six families read": lambda: dg.margins(geometry, position).by_family(),
    }
    print(f"\n{len(position)} poses [ms]{'':<27}      best    median     worst copies")
    copy = seconds(position.copy)
    show("a plain copy of the positions", copy, 1e-3, copy.min())
    for name, job in jobs.items():
        show(name, seconds(job), 1e-3, copy.min())
    worth, batch.WORTH_CALLING = batch.WORTH_CALLING, sys.maxsize
    for name, job in list(jobs.items())[:3]:
        show(f"{name}, numpy alone", seconds(job, 5), 1e-3, copy.min())
    batch.WORTH_CALLING = worth
    part = position[: len(position) // 10]
    show("clearance, a tenth of them", seconds(lambda: dg.clearance(geometry, part), 3), 1e-3)
    error = np.abs(dg.forward(geometry, carriages) - position).max()
    print(f"forward(inverse(p)) - p: worst {error:.1e} mm")


def newton(geometry: dg.Geometry, position: np.ndarray) -> np.ndarray:
    """Solve the loop closure of one pose numerically, from a guess 20 mm off."""
    g = geometry
    x, y, z = position
    drop = np.sqrt(g.arm_length**2 - (x - g.rail_half_spacing + g.platform_half_width) ** 2)
    h = z - g.arm_drop - g.riser_height - g.carriage_height - drop
    half = 0.5 * g.coupler_length
    X = x - g.platform_half_width + g.rail_half_spacing
    Z = z - g.strut_drop - g.carriage_height

    def residual(q: np.ndarray) -> np.ndarray:
        return np.array(
            [
                (y - half - q[0]) ** 2 + h * h - g.leg_length**2,
                (y + half - q[1]) ** 2 + h * h - g.leg_length**2,
                X * X + (y - q[2]) ** 2 + Z * Z - g.strut_length**2,
            ]
        )

    solution: np.ndarray = root(residual, dg.inverse(g, position) + 20.0, tol=1e-12).x
    return solution


def single_poses(geometry: dg.Geometry, position: np.ndarray) -> None:
    """Time one pose at a time, through the public functions, a few hundred microseconds at once.

    Longer stretches would measure who else uses the processor.
    """
    some = [tuple(row) for row in position[:100].tolist()]
    carriages = [tuple(row) for row in dg.inverse(geometry, position[:100]).tolist()]
    functions = (
        ("inverse", dg.inverse, some),
        ("forward", dg.forward, carriages),
        ("margins", dg.margins, some),
        ("reachable", dg.reachable, some),
        ("jacobian", dg.jacobian, some),
        ("clearance", dg.clearance, some),
    )
    print(f"\none pose [us]{'':<31}      best    median     worst")
    for name, function, poses in functions:
        times = seconds(lambda f=function, p=poses: [f(geometry, one) for one in p], 800)
        show(name, times / len(poses), 1e-6)
    few = some[:50]
    numerical = seconds(lambda: [newton(geometry, np.array(one)) for one in few], 5)
    show("inverse by scipy.optimize.root", numerical / len(few), 1e-6)
    off = max(
        np.abs(newton(geometry, np.array(one)) - dg.inverse(geometry, one)).max() for one in few
    )
    print(f"numerical minus closed form: worst {off:.1e} mm")


def planner_nodes(geometry: dg.Geometry, position: np.ndarray) -> None:
    """Time what the planner asks of a few thousand nodes."""
    rng = np.random.default_rng(SEED)
    jets = rng.normal(0.0, 1.0, (3000, 4, 3))
    jets[:, 0] = position[:3000]
    print(f"\n3000 nodes [ms]{'':<29}      best    median     worst")
    show(
        "inverse_derivatives to the third",
        seconds(lambda: inverse_derivatives(geometry, jets)),
        1e-3,
    )
    show("clearance", seconds(lambda: dg.clearance(geometry, position[:3000])), 1e-3)
    show("jacobian", seconds(lambda: dg.jacobian(geometry, position[:3000])), 1e-3)


def main() -> None:
    """Print the tables."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    geometry = dg.Geometry()
    print(f"{processor()}; Python {platform.python_version()}, numpy {np.__version__}; seed {SEED}")
    position = random_positions(geometry, count)
    batches(geometry, position)
    single_poses(geometry, position)
    planner_nodes(geometry, position)
    command = [sys.executable, "-c", WARM_START]
    first, second = [], []
    for _ in range(3):
        run = subprocess.run(command, capture_output=True, check=True, text=True)
        (at_once, _), (loading, loaded) = (line.split() for line in run.stdout.splitlines())
        assert loaded == "True"
        first.append(float(at_once))
        second.append(float(loading))
    print("\na new process, 1000000 poses [s]: best, worst")
    print(f"first call (numpy answers at once)   {min(first):.2f}, {max(first):.2f}")
    print(f"second call (loads what is compiled) {min(second):.2f}, {max(second):.2f}")


if __name__ == "__main__":
    main()
