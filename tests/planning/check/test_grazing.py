from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.rounded import round_corners
from duoglide.planning.check.rules import Rules
from duoglide.planning.check.search import first_failure


@pytest.mark.parametrize(("room", "expected"), [(1e-6, True), (8e-8, False), (-1e-6, False)])
def test_what_grazes_a_rule_is_refused_and_what_passes_by_a_nanometre_is_not(
    room: float, expected: bool
) -> None:
    """Lines that touch legs flat between their ends, a box, and the end of a rail."""
    free = dg.Machine(
        geometry=dg.Geometry(rail_half_length=9000.0), clearance=0.0, carriage_margin=0.0
    )
    outward = np.array([np.sin(-0.4), 0.0, np.cos(-0.4)])  # from legs flat, a circle about the arm
    touch = np.array([45.0, 0.0, 70.0]) + (180.0 + room) * outward
    along = 10.0 * np.array([outward[2], 0.3, -outward[0]])
    lid = dg.Box(low=(-99.0, -99.0, 320.0 + room), high=(99.0, 99.0, 400.0))
    reach = np.abs(dg.inverse(dg.Geometry(), np.array([-41.0, 99.0, 300.0]))).max()
    short = replace(free.geometry, rail_half_length=float(reach) + room)
    cases = (
        (free, dg.Path.line(touch - along, touch + along)),
        (replace(free, keep_out=(lid,)), dg.Path.line((-41, 0, 300), (-41, 0, 320))),
        (replace(free, geometry=short), dg.Path.line((-41, 0, 300), (-41, 99, 300))),
    )
    for machine, path in cases:
        rules = Rules.of(machine, round_corners(path).curve)
        assert (first_failure(rules) == np.inf) is expected


def test_a_check_never_waits_for_the_compiler() -> None:
    """A fresh process that checks, and checks again, loads no numba: neither once nor later."""
    code = (
        "import sys, duoglide as dg\n"
        "path = dg.pick_and_place((-41, -100, 295), (-41, 100, 295), tolerance=2.0)\n"
        "for _ in range(5): dg.check_path(dg.Machine.default(), path)\n"
        "print('numba' in sys.modules)\n"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["False"]
