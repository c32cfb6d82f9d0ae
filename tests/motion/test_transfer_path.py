from __future__ import annotations

import json

import numpy as np
import pytest

import duoglide as dg
from duoglide.motion.path.transfer import TransferPath

MACHINE = dg.Machine.default()
BREAKS = np.array([0.0, 0.5, 0.8])
TABLE = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 4, 3))
PATH = TransferPath(MACHINE, BREAKS, TABLE, 5.0)


def test_derivatives_are_those_of_the_polynomials() -> None:
    for t in (0.0, 0.2, 0.49, 0.5, 0.7, 0.8):
        piece = 0 if t < 0.5 else 1
        for carriage in range(3):
            curve = np.polynomial.Polynomial(TABLE[piece, :, carriage])
            expected = [curve.deriv(k)(t - BREAKS[piece]) for k in range(4)]
            np.testing.assert_allclose(PATH.derivatives(t)[:, carriage], expected, atol=1e-12)


def test_a_piece_can_be_named_at_a_break() -> None:
    before = PATH.derivatives(np.array([0.5]), np.array([0]))[0, 0]
    np.testing.assert_allclose(before, 0.5 ** np.arange(4.0) @ TABLE[0], atol=1e-12)


def test_it_is_clamped_to_its_ends() -> None:
    np.testing.assert_array_equal(PATH.derivatives(-1.0), PATH.derivatives(0.0))
    np.testing.assert_array_equal(PATH.derivatives(9.0), PATH.derivatives(0.8))


def test_the_document_brings_it_back_exactly() -> None:
    again = TransferPath.from_dict(json.loads(json.dumps(PATH.to_dict())))
    times = np.linspace(0.0, 0.8, 33)
    np.testing.assert_array_equal(again.derivatives(times), PATH.derivatives(times))
    assert again.machine == MACHINE
    assert again.least_clearance == 5.0


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(dg.InputError, match="polynomials"):
        TransferPath(MACHINE, BREAKS, TABLE[:1], 5.0)
    with pytest.raises(dg.InputError, match="increase"):
        TransferPath(MACHINE, BREAKS[::-1], TABLE, 5.0)
    with pytest.raises(dg.InputError, match="breaks"):
        TransferPath.from_dict({"machine": {}})
