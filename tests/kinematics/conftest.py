from __future__ import annotations

import numpy as np
import pytest
from numpy.random import Generator, default_rng

import duoglide as dg

BOX = 700.0  # [mm], half the side of a cube that holds the reach of every geometry below


def random_geometry(rng: Generator) -> dg.Geometry:
    """Draw dimensions unlike Table 1: riser and drops of either sign, even b < d."""
    while True:
        try:
            return dg.Geometry(
                rail_half_spacing=rng.uniform(20, 150),
                platform_half_width=rng.uniform(-30, 120),
                carriage_height=rng.uniform(-50, 100),
                leg_length=rng.uniform(80, 250),
                coupler_length=rng.uniform(20, 200),
                riser_height=rng.uniform(-60, 60),
                arm_length=rng.uniform(80, 260),
                arm_drop=rng.uniform(-60, 60),
                strut_drop=rng.uniform(-60, 60),
                strut_length=rng.uniform(150, 400),
            )
        except dg.ConfigError:
            continue


@pytest.fixture(scope="session")
def geometries() -> list[dg.Geometry]:
    """Table 1, a machine with b = d, and a score of random ones."""
    rng = default_rng(20)
    special = [
        dg.Geometry(),
        dg.Geometry(rail_half_spacing=60.0, platform_half_width=60.0, arm_drop=25.0),
    ]
    return special + [random_geometry(rng) for _ in range(20)]


class Poses:
    """Draws reachable poses of any geometry and mode."""

    def __init__(self, seed: int) -> None:
        self.rng = default_rng(seed)

    def __call__(self, geometry: dg.Geometry, mode: dg.WorkingMode, count: int) -> np.ndarray:
        found = np.empty((0, 3))
        for _ in range(60):
            cube = self.rng.uniform(-BOX, BOX, (8 * count, 3))
            found = np.concatenate([found, cube[dg.reachable(geometry, cube, mode)]])
            if len(found) >= count:
                break
        return found[:count]


@pytest.fixture
def poses() -> Poses:
    return Poses(21)
