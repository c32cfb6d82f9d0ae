"""Forces: ``python tests/benchmarks/forces.py [PICTURE]``.

Prints how far the closed form is from MuJoCo along five plans, how many forces a second both find
(MuJoCo's own inverse dynamics, whose closures are soft, and the one with closed loops), and what a
force limit costs in planning. Pinocchio, where it is installed, is asked for the open tree's
recursion alone. The picture, drawn only if a file is named, is the one in the docs: one move at
three payloads and three force limits.
"""

from __future__ import annotations

import platform
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import duoglide as dg
from duoglide.drawing.picture import COLOURS, LIMIT, Picture, drawn, save

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

PICK = dg.pick_and_place((-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0, 4.0)
PAYLOADS, FORCES = (0.0, 0.5, 1.0), (np.inf, 50.0, 25.0)
POSES, ROUNDS = 1_000_000, 7


def best(call: Callable[[], Any], rounds: int = ROUNDS) -> tuple[float, float]:
    """Return the median and the worst of a few runs [s of the processor]."""
    spent = []
    for _ in range(rounds):
        start = time.process_time()
        call()
        spent.append(time.process_time() - start)
    return float(np.median(spent)), max(spent)


def paths() -> dict[str, dg.Path]:
    """Five paths of one kind each."""
    points = [(-60.0, -80, 290), (-30.0, -20, 300), (-50.0, 40, 285), (-41.0, 90, 290)]
    return {
        "pick": PICK,
        "line": dg.Path.line((-66.0, -60, 302), (-16.0, 60, 292)),
        "arc": dg.Path.arc((-60.0, -40, 290), (-41.0, 0, 305), (-20.0, 40, 290)),
        "spline": dg.Path.through(points),
        "polyline": dg.Path.polyline(points, 3.0),
    }


def compare() -> None:
    """Print the distance from MuJoCo with its loops closed by Newton, and what each takes."""
    import mujoco
    from mujoco_witness import Witness

    machine = dg.Machine(masses=dg.Masses(payload=0.5))
    witness = Witness(dg.to_mjcf(machine))
    for name, path in paths().items():
        plan = dg.plan(machine, path, brake_safe=False)
        times = np.linspace(0.01, 0.99, 200) * plan.duration
        closed, state = plan.forces(times), plan.at(times)
        found = np.array(
            [witness.forces(type(state)(*(p[i] for p in _parts(state)))) for i in range(200)]
        )
        off = np.abs(found - closed).max() / np.abs(closed).max()
        print(f"{name:>9}: peak {np.abs(closed).max():6.1f} N, off by {off:.1e} of it")
    model, data = witness.model, witness.data
    one = dg.plan(machine, PICK, brake_safe=False).at(0.1)
    median, worst = best(lambda: witness.forces(one))
    print(f"MuJoCo, loops closed by Newton: {1.0 / median:.3g} forces/s (worst {1.0 / worst:.3g})")
    median, worst = best(lambda: [mujoco.mj_inverse(model, data) for _ in range(1000)])
    print(f"mj_inverse, soft closures: {1e3 / median:.3g} forces/s (worst {1e3 / worst:.3g})")


def _parts(state: dg.State) -> tuple[np.ndarray, ...]:
    return state.carriages, state.velocity, state.acceleration, state.jerk


def count_forces() -> None:
    """Print how many forces a second the closed form finds, one at a time and many."""
    machine, rng = dg.Machine.default(), np.random.default_rng(1)
    position = np.array([-41.0, 0.0, 302.0]) + rng.uniform(-20, 20, (POSES, 3))
    velocity, acceleration = rng.normal(0, 1e3, (2, POSES, 3))
    single = np.stack([position, velocity, acceleration], axis=1)[:20_000].tolist()
    one, _ = best(lambda: [dg.carriage_forces(machine, *rows) for rows in single])
    print(f"one at a time: {20_000 / one:.3g} forces/s")
    for _ in range(2):  # the first million answers loads the compiled loops
        dg.carriage_forces(machine, position, velocity, acceleration)
    median, worst = best(lambda: dg.carriage_forces(machine, position, velocity, acceleration))
    print(f"a million at once: {POSES / median:.3g} forces/s (worst {POSES / worst:.3g})")
    try:
        import pinocchio
    except ImportError:
        print("Pinocchio is not installed")
        return
    model = pinocchio.buildModelFromMJCF(dg.to_mjcf(machine))
    data, q = model.createData(), pinocchio.neutral(model)
    v, a = rng.normal(0, 1, (2, model.nv))
    median, _ = best(lambda: [pinocchio.rnea(model, data, q, v, a) for _ in range(1000)])
    print(f"Pinocchio, the open tree alone: {1e3 / median:.3g} forces/s")


def cost_of_limits() -> None:
    """Print what planning costs with force limits, interleaved with planning without."""
    free = dg.Machine(masses=dg.Masses(payload=0.5))
    for force in FORCES[1:]:
        limited = replace(free, limits=dg.CarriageLimits(force=force))
        spent: dict[str, list[float]] = {"free": [], "limited": []}
        for _ in range(15):
            for name, machine in (("free", free), ("limited", limited)):
                start = time.process_time()
                dg.plan(machine, PICK, brake_safe=False)
                spent[name].append(time.process_time() - start)
        usual, more = (1e3 * float(np.median(spent[name])) for name in ("free", "limited"))
        print(
            f"{force:g} N: plans take {more:.1f} ms instead of {usual:.1f} ms"
            f" (worst {1e3 * max(spent['limited']):.1f}), {100.0 * (more / usual - 1.0):+.0f} %"
        )


def draw() -> Picture:
    """Draw the largest force of any carriage over time, at three payloads and three limits."""
    with drawn((7.2, 5.4)) as figure:
        rows = figure.subplots(3, 1, sharex=True)
        for axes, force in zip(rows, FORCES, strict=True):
            for payload, colour in zip(PAYLOADS, COLOURS, strict=True):
                machine = dg.Machine(
                    limits=dg.CarriageLimits(force=force), masses=dg.Masses(payload=payload)
                )
                plan = dg.plan(machine, PICK, brake_safe=False)
                times = np.linspace(0.0, plan.duration, 3000)
                most = np.abs(plan.forces(times)).max(axis=1)
                words = f"{payload:g} kg: {plan.duration:.3f} s"
                print(f"limit {force:g} N, {words}, peak {most.max():.1f} N")
                axes.plot(times, most, color=colour, linewidth=1.6, label=words)
            if np.isfinite(force):
                axes.axhline(force, color=LIMIT, linestyle="--", linewidth=1.0)
            told = f"no more than {force:g} N" if np.isfinite(force) else "no limit"
            axes.set_title(f"Largest force of a carriage [N], {told}")
            axes.set_ylim(0.0, None)
            axes.legend(loc="upper right")
        rows[-1].set_xlabel("time [s]")
    return figure


if __name__ == "__main__":
    print(f"{platform.machine()}, Python {platform.python_version()}, seed 1")
    if len(sys.argv) > 1:
        save(draw(), Path(sys.argv[1]))
    compare()
    count_forces()
    cost_of_limits()
