"""The carriage margin while drives brake, against brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drive_stops import least_carriage_margin, random_stops

import duoglide as dg
from duoglide.kinematics.carriage_margin import fold_of
from duoglide.kinematics.headroom.room import carriage_room, locate
from duoglide.planning.braking.blocks import Footprint, column_width, lowest_column
from duoglide.planning.braking.margin import margin_of
from duoglide.planning.braking.outline import carriages_of

SHARES = np.linspace(0.0, 1.0, 50)
BRACKET = 3e-7  # mm, to which a carriage margin is known
# Feet of the arm above and below B3: obstacles turn round where it is level with B3.
FOLDED = {"riser_height": -60.0, "strut_drop": 40.0}


def footprint(machine: dg.Machine, middle: np.ndarray, half: np.ndarray) -> Footprint:
    """Fill all columns of one block with a rectangle about a pose's D and S."""
    prints = Footprint.empty(machine, 1)
    (low, low_s), (high, high_s) = middle - half, middle + half
    edge = lowest_column(machine) + column_width(machine) * np.arange(prints.smin.shape[1])
    here = (edge + column_width(machine) > low) & (edge < high)
    prints.smin[0, here], prints.smax[0, here] = low_s, high_s
    prints.left[0, here] = np.maximum(edge, low)[here]
    prints.right[0, here] = np.minimum(edge + column_width(machine), high)[here]
    prints.nearest[0] = low
    return prints


@pytest.mark.parametrize("changes", [{}, FOLDED])
def test_the_least_margin_of_a_footprint_is_at_its_corners(changes: dict[str, float]) -> None:
    rng = np.random.default_rng(5)
    geometry = replace(dg.Geometry(), **changes)
    machine = dg.Machine(geometry=geometry, carriage_margin=1.0)
    fold = fold_of(geometry) + geometry.coupler_length
    assert (fold < np.inf) == bool(changes)
    kept = across = 0
    while kept < 60:
        one, two, three = rng.uniform(-350.0, 350.0, (3, 3))[0]
        middle = np.array([two - one, one + two - 2.0 * three])
        if changes and rng.integers(2):
            middle[0] = fold + rng.uniform(-4.0, 4.0)
        half = 10.0 ** rng.uniform(-1.0, 1.0, 2)
        share = np.linspace(-1.0, 1.0, 41)
        grid = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
        if changes:
            at_fold = grid[::41].copy()
            at_fold[:, 0] = np.clip((fold - middle[0]) / half[0], -1.0, 1.0)
            grid = np.concatenate([grid, at_fold])
        carriages = carriages_of(middle + grid * half)
        found = carriage_room(machine, *locate(machine, carriages))
        least = float(margin_of(footprint(machine, middle, half))[0][0])
        assert least <= found.min() + BRACKET
        if found.min() > -0.99:
            assert least >= found.min() - 1e-2 * float(half.max())
            across += abs(middle[0] - fold) < half[0]
            kept += 1
    assert not changes or across > 5


def worst_margin(motion: dg.Trajectory, seed: int) -> float:
    """Return the least carriage margin of random stops [mm], -inf where the links come apart."""
    drawn = random_stops(motion, 300, np.random.default_rng(seed))
    return least_carriage_margin(motion, drawn.at(motion, SHARES))


def test_drives_that_brake_leave_the_carriage_margin_that_is_asked_for() -> None:
    path = dg.Path.line((-80.0, -100.0, 300.0), (0.0, 100.0, 300.0))  # it leaves 10 mm
    unasked, asked = (dg.Machine(carriage_margin=margin) for margin in (0.0, 8.0))
    assert worst_margin(dg.plan(unasked, path), 1) < 4.0
    safe = dg.plan(asked, path)
    assert safe.report.brake_safe
    assert worst_margin(safe, 1) >= 8.0 - 1e-3


def test_a_path_that_keeps_just_the_margin_is_passed_at_a_speed_worth_having() -> None:
    """At rest, what drives may do is nothing: a footprint is as small as what it covers."""
    path = dg.Path.line((-41.0, -60.0, 300.0), (-41.0, 60.0, 290.0))
    least = dg.check_path(dg.Machine(), path).report["carriage_margin"].margin
    machine = dg.Machine(carriage_margin=least - 0.02)
    draft = dg.plan(machine, path, brake_safe=False)
    assert dg.plan(machine, path).duration < 8.0 * draft.duration
