from __future__ import annotations

import pickle

import pytest

import duoglide as dg
from duoglide import errors

TREE = {
    dg.DuoglideError: (
        dg.InputError,
        dg.ConfigError,
        dg.UnreachableError,
        dg.SingularityError,
        dg.PathError,
        dg.LimitError,
        dg.BusError,
        dg.DriveError,
        dg.LogError,
    ),
    dg.DriveError: (dg.DriveFault, dg.DriveTimeout, dg.FollowingError, dg.NotHomedError),
}


def test_the_tree_is_that_of_the_design() -> None:
    for parent, children in TREE.items():
        for child in children:
            assert child.__bases__[0] is parent
    assert issubclass(dg.InputError, ValueError)


def test_every_error_is_under_the_packages_name() -> None:
    classes = {
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, errors.DuoglideError)
    }
    assert classes <= set(dg.__all__)


@pytest.mark.parametrize(
    "error",
    [
        dg.InputError("no"),
        dg.UnreachableError("no", index=(1, 2), link="arm", shortfall=0.5),
        dg.SingularityError("no", index=(3,), family="arm_strut"),
        dg.PathError("no", arc_length=1.5, position=[1.0, 2.0, 3.0], quantity="reach", amount=2.0),
        dg.DriveFault("no", axis=2, code=0x8611),
    ],
)
def test_an_error_crosses_a_process_boundary_whole(error: dg.DuoglideError) -> None:
    other = pickle.loads(pickle.dumps(error))
    assert type(other) is type(error)
    assert str(other) == "no"
    assert vars(other) == vars(error)
