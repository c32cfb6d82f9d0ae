from __future__ import annotations

import pickle

import pytest

import duoglide as dg


def test_the_machines_own_modes_are_the_defaults() -> None:
    assert dg.WorkingMode() == dg.WorkingMode(v=1, w1=-1, w2=1, w3=1)
    assert dg.AssemblyMode() == dg.AssemblyMode(m=1, n=1)


@pytest.mark.parametrize("value", [0, 2, 0.5, True, "+1", None, float("nan")])
def test_a_sign_that_is_not_plus_or_minus_one_is_refused_by_name(value: object) -> None:
    with pytest.raises(dg.InputError, match=r"WorkingMode\.w2 must be \+1 or -1"):
        dg.WorkingMode(w2=value)  # type: ignore[arg-type]
    with pytest.raises(dg.InputError, match=r"AssemblyMode\.n must be \+1 or -1"):
        dg.AssemblyMode(n=value)  # type: ignore[arg-type]


def test_modes_are_values() -> None:
    assert hash(dg.WorkingMode(v=-1)) == hash(dg.WorkingMode(v=-1.0))  # type: ignore[arg-type]
    assert pickle.loads(pickle.dumps(dg.AssemblyMode(m=-1))) == dg.AssemblyMode(m=-1)
    with pytest.raises(AttributeError):
        dg.WorkingMode().v = -1  # type: ignore[misc]
