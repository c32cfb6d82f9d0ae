"""One root, differentiated three ways: one pose, arrays to any order, and bounds."""

from __future__ import annotations

from math import sqrt

import numpy as np

from duoglide.kinematics.derivatives import root_bounds, root_jet, root_jets

RNG = np.random.default_rng(11)
LENGTH = 250.0
SIDES = RNG.uniform(-100.0, 100.0, (200, 2, 4))  # a and b, each with three derivatives


ROOTS = [sqrt(LENGTH**2 - a[0] ** 2 - b[0] ** 2) for a, b in SIDES.tolist()]


def test_arrays_and_single_poses_have_the_same_derivatives() -> None:
    one = [root_jet(r, tuple(a), tuple(b)) for r, (a, b) in zip(ROOTS, SIDES.tolist(), strict=True)]
    many = root_jets(np.array(ROOTS), list(SIDES[:, 0].T), list(SIDES[:, 1].T))
    np.testing.assert_allclose(np.array(many).T, one, rtol=1e-11, atol=1e-9)


def test_bounds_hold_for_every_root_within_them_and_are_reached() -> None:
    for r, (a, b) in zip(ROOTS, SIDES.tolist(), strict=True):
        sizes = [tuple(map(abs, side)) for side in (a, b)]
        bounds = root_bounds(r, (sizes[0][0], sizes[1][0]), sizes[0][1:], sizes[1][1:])
        found = np.abs(root_jet(r, tuple(a), tuple(b))[1:])
        assert np.all(found <= np.array(bounds) * (1.0 + 1e-12))
        # One side alone, all of whose derivatives have one sign, uses the bound up.
        none = (0.0, 0.0, 0.0, 0.0)
        alone = root_bounds(r, (sizes[0][0], 0.0), sizes[0][1:], none[1:])
        np.testing.assert_allclose(root_jet(r, sizes[0], none)[1:], -np.array(alone), rtol=1e-12)
