"""Compile what a first plan comes to last, in a process beside it.

numba makes the loops of planning once per machine, and keeps them. In one process it makes one
after the other, and the very first plan waits for all of them. ``beside`` has another process make
those of stops and braking meanwhile: ``python -m duoglide.planning.compile_ahead``.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

_LENGTH = 20.0  # [mm]; the move that is stopped is so long.
_RAMP = 0.05  # a quarter of its time [s]


@contextmanager
def beside() -> Iterator[None]:
    """Have another process compile meanwhile, unless all is there; it ends with the block.

    Where no process can be started, the plan waits for the compiler as it would without.
    """
    process = None if ready() else _start()
    try:
        yield
    finally:
        if process is not None:
            process.kill()  # numba writes what it keeps to another name, and then moves it
            process.wait()


def ready() -> bool:
    """Whether numba keeps all that a plan needs on this machine, so that none is compiled first.

    Loads numba, which a plan does anyway.
    """
    from duoglide.kinematics.compiled import kept
    from duoglide.kinematics.headroom import nearby_kernel
    from duoglide.planning.braking import carriage_bounds, led_kernel
    from duoglide.planning.braking import kernel as brake_kernel
    from duoglide.planning.rounding import deviation
    from duoglide.planning.stops import kernel as stop_kernel
    from duoglide.planning.timing import interior_point, motion_kernel, rows

    return all(
        kept(loop)
        for loop in (
            motion_kernel.carriage_motion,
            rows.fill_limits,
            interior_point.take_steps,
            carriage_bounds.through_links,
            nearby_kernel.swing,
            stop_kernel.find_largest_slopes,
            stop_kernel.fill_windows,
            brake_kernel.spread,
            led_kernel.follow,
            deviation.measure_deviation,
        )
    )


def _start() -> subprocess.Popen[bytes] | None:
    try:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", __name__],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # keys at the terminal are for the first process alone
        )
    except OSError:
        return None


def main() -> None:
    """Certify the stops and the braking of a move that needs no solver."""
    from duoglide.machine import Machine
    from duoglide.motion.motion import Motion
    from duoglide.motion.path.carriage import map_to_carriages
    from duoglide.motion.path.path import Path
    from duoglide.motion.profile import Profile
    from duoglide.planning.braking.certificate import brake_report
    from duoglide.planning.braking.led import led_stops
    from duoglide.planning.check.check import check_path
    from duoglide.planning.stops.certificate import certify_stops

    machine = Machine.default()
    path = Path.line((-41.0, 0.0, 300.0), (-41.0, _LENGTH, 300.0))
    jerk = 0.5 * _LENGTH / _RAMP**3
    t, speed, peak = _RAMP, jerk * _RAMP**2, jerk * _RAMP
    knots = np.array(
        [
            [0.0, 0.0, 0.0, 0.0],
            [t, _LENGTH / 12.0, 0.5 * speed, peak],
            [2.0 * t, 0.5 * _LENGTH, speed, 0.0],
            [3.0 * t, _LENGTH * 11.0 / 12.0, 0.5 * speed, -peak],
            [4.0 * t, _LENGTH, 0.0, 0.0],
        ]
    )
    move = Motion(map_to_carriages(check_path(machine, path)), Profile(knots))
    certify_stops(move)
    brake_report(move)
    led_stops(move)


if __name__ == "__main__":
    main()
