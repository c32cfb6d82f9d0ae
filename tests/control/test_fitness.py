from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.host.run.fitness import machine_that_moves, require_fit
from duoglide.motion.profile import Profile


def test_what_begins_or_ends_in_motion_is_not_run_by_itself(machine: dg.Machine) -> None:
    whole = dg.plan(machine, dg.Path.line((-41, -40, 300), (-41, 40, 300)))
    require_fit(whole, machine)
    knot = len(whole.profile.knots) // 2
    part = whole.until(knot, whole.stops)
    with pytest.raises(dg.PathError, match="ends in motion"):
        require_fit(part, machine)
    with pytest.raises(dg.PathError, match=r"does not come to rest: .* nothing takes over"):
        require_fit(replace(part, whole=None), machine)
    time = whole.profile.knots[knot, 0]
    later = Profile(whole.profile.knots[knot:] - np.array([time, 0.0, 0.0, 0.0]))
    with pytest.raises(dg.PathError, match="begins in motion"):
        require_fit(dg.Trajectory(whole.path, later, whole.stops), machine)


@pytest.mark.parametrize(
    ("change", "quantity", "words"),
    [
        (
            {"keep_out": (dg.Box(low=(-60, -9, 280), high=(-20, 9, 303)),)},
            "keep_out",
            r"3 mm inside keep_out box",
        ),
        ({"carriage_width": 420.0}, "order", "less than carriage_width"),
        ({"clearance": 75.0}, "legs_flat", "below the clearance of 75 mm"),
    ],
)
def test_another_machine_says_which_room_is_left_and_by_how_much(
    machine: dg.Machine, change: dict[str, Any], quantity: str, words: str
) -> None:
    plan = dg.plan(machine, dg.Path.line((-41, -40, 300), (-41, 40, 300)), brake_safe=False)
    with pytest.raises(dg.PathError, match=words) as refusal:
        require_fit(plan, replace(machine, **change))
    assert refusal.value.quantity == quantity
    assert refusal.value.amount is not None
    assert 0.0 < refusal.value.amount < 100.0


def test_what_a_file_says_of_its_machine_is_believed_on_simulated_drives_only() -> None:
    told = dg.Machine(limits=dg.CarriageLimits(jerk=1e9))
    given = dg.Machine(clearance=3.0)
    assert machine_that_moves(None, told, "virtual") is told
    assert machine_that_moves(given, told, "udp:239.0.0.9:43999") is given
    default = dg.Machine.default()
    assert machine_that_moves(None, default, "socketcan:can0") == default
    with pytest.raises(dg.ConfigError, match=r"\(limits\), .*on socketcan:can0, .*--machine FILE"):
        machine_that_moves(None, told, "socketcan:can0")
