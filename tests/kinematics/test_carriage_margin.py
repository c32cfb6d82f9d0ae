"""The carriage margin against links that are put together one by one, and nothing of the library's.

``closes`` draws the mechanism from PAPER's dimensions with sines and cosines, and measures every
link of what it has drawn. It knows of no margin, no region and no curve.
"""

from __future__ import annotations

from itertools import permutations, product
from typing import Any

import numpy as np
import pytest
from carriage_intervals import closes_throughout
from numpy.random import default_rng

import duoglide as dg

MODES = [dg.WorkingMode(v, w1, -w1, w3) for v, w1, w3 in product((1, -1), (-1, 1), (1, -1))]
ASSEMBLIES = [dg.AssemblyMode(m, n) for m in (1, -1) for n in (1, -1)]
INSIDE, BEYOND = 0.999, 1.003  # of the margin; beyond, an offset is met to a share of the steps
STEPS = 101


def closes(
    g: dg.Geometry, carriages: np.ndarray, assembly: dg.AssemblyMode, mode: dg.WorkingMode
) -> np.ndarray:
    """Tell where the links can be put together, in these modes and on no singular surface."""
    a1, a2, a3 = np.moveaxis(carriages, -1, 0)
    y, run = 0.5 * (a1 + a2), 0.5 * (a2 - a1 - g.coupler_length)  # half of B
    with np.errstate(invalid="ignore", divide="ignore"):
        alpha = np.arccos(run / g.leg_length) * assembly.m
        foot = np.stack(
            [
                np.full(y.shape, g.rail_half_spacing - g.platform_half_width),
                g.carriage_height + g.riser_height + g.arm_drop + g.leg_length * np.sin(alpha),
            ],
            axis=-1,
        )
        stand = np.array(
            [g.platform_half_width - g.rail_half_spacing, g.carriage_height + g.strut_drop]
        )
        reach = np.sqrt(g.strut_length**2 - (a3 - y) ** 2)
        towards = stand - foot
        apart = np.linalg.norm(towards, axis=-1)
        cosine = (apart**2 + g.arm_length**2 - reach**2) / (2.0 * apart * g.arm_length)
        turn = np.arctan2(towards[..., 1], towards[..., 0]) - assembly.n * np.arccos(cosine)
        arm = g.arm_length * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        pose = foot + arm
        strut = np.stack([pose[..., 0] - stand[0], y - a3, pose[..., 1] - stand[1]], axis=-1)
        wrong = np.abs(np.linalg.norm(strut, axis=-1) - g.strut_length)
        side = strut[..., 0] * arm[..., 1] - strut[..., 2] * arm[..., 0]
        return (
            (wrong < 1e-7)
            & (np.sin(alpha) * assembly.m > 0.0)
            & (run * (mode.w2 - mode.w1) > 0.0)
            & ((a3 - y) * mode.w3 > 0.0)
            & (arm[..., 1] * mode.v > 0.0)
            & (side * assembly.n > 0.0)
        )


def outermost() -> np.ndarray:
    """Return offsets that change the differences of carriages most: one up, one down, one free."""
    offsets = []
    for up, down, free in permutations(range(3)):
        offset = np.zeros((STEPS, 3))
        offset[:, up], offset[:, down] = 1.0, -1.0
        offset[:, free] = np.linspace(-1.0, 1.0, STEPS)
        offsets.append(offset)
    return np.concatenate(offsets)


def own_assemblies(g: dg.Geometry, position: np.ndarray, mode: dg.WorkingMode) -> np.ndarray:
    """Return the number in ASSEMBLIES of each pose."""
    found = dg.margins(g, position, mode)
    return 2 * (found.legs_flat < 0.0) + (found.arm_strut < 0.0)


def test_links_close_anywhere_within_the_margin_and_somewhere_not_just_beyond_it(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    rng = default_rng(4)
    worst = outermost()
    offsets = np.concatenate([rng.uniform(-1.0, 1.0, (100, 3)), worst])
    told = 0
    for geometry, mode in product(geometries[:10], MODES):
        position = poses(geometry, mode, 20)
        margin = dg.carriage_margin(geometry, position, mode)[:, None, None]
        carriages = dg.inverse(geometry, position, mode)[:, None]
        own = own_assemblies(geometry, position, mode)
        for i in np.unique(own):
            rows, assembly = own == i, ASSEMBLIES[i]
            within = carriages[rows] + INSIDE * margin[rows] * offsets
            assert closes(geometry, within, assembly, mode)[margin[rows, 0, 0] > 1e-4].all()
            beyond = carriages[rows] + (BEYOND * margin[rows] + 1e-5) * worst
            assert not closes(geometry, beyond, assembly, mode).all(axis=1).any()
            told += int(rows.sum())
    assert told > 1400


def test_carriages_in_intervals_close_just_when_all_of_them_do(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    """Intervals of very unlike lengths, whose hexagons are thin: an obstacle may cut through."""
    rng = default_rng(5)
    worst = outermost()
    offsets = np.concatenate([rng.uniform(-1.0, 1.0, (200, 3)), worst])
    answers = np.zeros(2, dtype=int)
    for geometry, mode in product(geometries[:8], MODES):
        position = poses(geometry, mode, 20)
        margin = dg.carriage_margin(geometry, position, mode)[:, None]
        own = own_assemblies(geometry, position, mode)
        middle = dg.inverse(geometry, position, mode)
        middle = middle + rng.uniform(-1.0, 1.0, middle.shape) * margin
        half = rng.exponential(1.0, middle.shape) * margin
        for i in np.unique(own):
            rows, assembly = own == i, ASSEMBLIES[i]
            m, h = middle[rows], half[rows]
            said = closes_throughout(geometry, m - h, m + h, assembly, mode)
            seen = closes(geometry, m[:, None] + h[:, None] * offsets, assembly, mode).all(axis=1)
            assert seen[said].all()
            less = 0.97 * h - 1e-6
            smaller = closes_throughout(geometry, m - less, m + less, assembly, mode)
            assert smaller[seen & (less.min(axis=1) > 0.0)].all()
            answers += [int(said.sum()), int((~said).sum())]
    assert answers.min() > 300


def test_intervals_of_the_margin_close_and_larger_ones_do_not(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    for geometry, mode in product(geometries[:6], MODES):
        position = poses(geometry, mode, 20)
        position = position[dg.carriage_margin(geometry, position, mode) > 1e-4]
        margin = dg.carriage_margin(geometry, position, mode)[:, None]
        carriages = dg.inverse(geometry, position, mode)
        own = own_assemblies(geometry, position, mode)
        for e, expected in ((margin - 1e-6, True), (margin + 1e-6, False)):
            for i in np.unique(own):
                rows = own == i
                ends = (carriages - e)[rows], (carriages + e)[rows]
                found = closes_throughout(geometry, *ends, ASSEMBLIES[i], mode)
                assert (found == expected).all()


def test_margin_changes_no_faster_than_the_carriage_that_moves_most(
    geometries: list[dg.Geometry], poses: Any
) -> None:
    rng = default_rng(6)
    for geometry, mode in product(geometries[:6], MODES):
        position = poses(geometry, mode, 20)
        beside = position + rng.normal(0.0, 1.0, position.shape)
        both = dg.reachable(geometry, beside, mode)
        if not both.any():
            continue
        here, there = (
            (dg.carriage_margin(geometry, p[both], mode), dg.inverse(geometry, p[both], mode))
            for p in (position, beside)
        )
        way = np.abs(here[1] - there[1]).max(axis=-1)
        assert (np.abs(here[0] - there[0]) <= way + 1e-6).all()


def test_margin_near_legs_flat_is_what_the_spread_of_the_carriages_lacks() -> None:
    geometry, pose = dg.Geometry(), (45.0, 0.0, 252.3)
    one, two, _ = dg.inverse(geometry, pose)
    lacking = geometry.coupler_length + 2.0 * geometry.leg_length - (two - one)
    assert dg.carriage_margin(geometry, pose) == pytest.approx(0.5 * lacking, abs=2e-7)
    assert 0.016 < dg.carriage_margin(geometry, pose) < 0.017  # where the clearance is 2.3 mm


def test_deepest_pose_of_the_flagship_move_keeps_14_mm_of_the_carriages() -> None:
    heights = np.linspace(295.0, 320.0, 26)
    pose = np.stack([np.full(26, -41.0), np.zeros(26), heights], axis=-1)
    margin = dg.carriage_margin(dg.Geometry(), pose)
    assert margin.min() == pytest.approx(14.645, abs=1e-3)
    assert dg.carriage_margin(dg.Geometry(), pose[0]) == margin[0]


def test_many_poses_have_the_margins_of_each(poses: Any) -> None:
    geometry = dg.Geometry(riser_height=-30.0, strut_drop=12.0)
    position = poses(geometry, dg.WorkingMode(), 300).reshape(-1, 3)
    many = dg.carriage_margin(geometry, position[None])
    assert many.shape == (1, len(position))
    one = [dg.carriage_margin(geometry, p) for p in position[:20]]
    np.testing.assert_allclose(many[0, :20], one, atol=1e-9)


def test_margin_is_nought_on_surfaces_and_in_modes_with_parallel_legs() -> None:
    geometry = dg.Geometry()
    assert dg.carriage_margin(geometry, (187.2797, 0.0, 250.0)) < 1e-6  # arm in line with strut
    assert dg.carriage_margin(geometry, (45.0, 0.0, 250.0)) == 0.0  # legs flat
    parallel = dg.WorkingMode(w1=1, w2=1)
    assert dg.carriage_margin(geometry, (-41.0, 0.0, 300.0), parallel) == 0.0
    carriages = dg.inverse(geometry, (-41.0, 0.0, 300.0), parallel)
    assert not closes_throughout(geometry, carriages, carriages, dg.AssemblyMode(), parallel)


def test_margin_refuses_what_is_out_of_reach() -> None:
    with pytest.raises(dg.UnreachableError, match="too short"):
        dg.carriage_margin(dg.Geometry(), (0.0, 0.0, 500.0))
