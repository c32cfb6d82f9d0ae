from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.kinematics.constants import carriage_constants, pose_constants
from duoglide.kinematics.model import inverse_derivatives
from duoglide.kinematics.singularity.margins import clearance_gradient
from duoglide.kinematics.transmission import transmission

POSE = (-41.0, 0.0, 302.0)
OF_A_POSE = (
    dg.inverse,
    dg.margins,
    dg.clearance,
    clearance_gradient,
    dg.reachable,
    dg.jacobian,
    transmission,
    lambda g, pose, mode: inverse_derivatives(g, [pose], mode),
)


@pytest.mark.parametrize("mode", ["index", "x", None, 1, (1, -1, 1, 1), dg.AssemblyMode(), [], {}])
def test_what_is_no_working_mode_is_refused_with_the_name_of_what_is(mode: Any) -> None:
    geometry = dg.Geometry()
    dg.forward(geometry, dg.inverse(geometry, POSE))  # both kinds of constants are remembered now
    for function in OF_A_POSE:
        with pytest.raises(dg.InputError, match=r"mode must be a duoglide\.WorkingMode.*got"):
            function(geometry, POSE, mode)


@pytest.mark.parametrize("mode", ["x", None, -1, dg.WorkingMode()])
def test_what_is_no_assembly_mode_is_refused_with_the_name_of_what_is(mode: Any) -> None:
    geometry = dg.Geometry()
    carriages = dg.inverse(geometry, POSE)
    with pytest.raises(dg.InputError, match=r"mode must be a duoglide\.AssemblyMode.*got"):
        dg.forward(geometry, carriages, mode)


def test_a_machine_in_place_of_its_geometry_is_refused_with_the_way_out() -> None:
    machine: Any = dg.Machine.default()
    for function in (dg.inverse, dg.forward, dg.margins, dg.clearance, dg.reachable, dg.jacobian):
        with pytest.raises(dg.InputError, match=r"duoglide\.Geometry.*machine\.geometry"):
            function(machine, POSE)
    for function in (dg.inverse_all, dg.forward_all):
        with pytest.raises(dg.InputError, match=r"duoglide\.Geometry"):
            function("Table 1", POSE)  # type: ignore[operator]


def test_constants_are_computed_once_for_a_geometry_and_equal_modes() -> None:
    geometry = dg.Geometry()
    first = pose_constants(geometry, dg.WorkingMode())
    assert pose_constants(geometry, dg.WorkingMode()) is first
    assert carriage_constants(geometry, dg.AssemblyMode(1, 1)) is carriage_constants(
        geometry, pickle.loads(pickle.dumps(dg.AssemblyMode(1, 1)))
    )


def test_every_mode_has_constants_of_its_own() -> None:
    geometry = dg.Geometry()
    signs = np.stack(np.meshgrid(*[[-1, 1]] * 4), axis=-1).reshape(-1, 4).tolist()
    assert {pose_constants(geometry, dg.WorkingMode(*s))[8:] for s in signs} == set(
        map(tuple, signs)
    )
    assert [carriage_constants(geometry, dg.AssemblyMode(*s[:2]))[8:10] for s in signs] == [
        tuple(s[:2]) for s in signs
    ]


def test_what_a_geometry_remembers_goes_to_no_other() -> None:
    geometry = dg.Geometry()
    fresh, answer = dg.Geometry(), dg.inverse(geometry, POSE)
    longer = replace(geometry, leg_length=161.0)
    assert (dg.inverse(longer, POSE) != answer)[:2].all()
    assert geometry == fresh
    assert hash(geometry) == hash(fresh)
    assert repr(geometry) == repr(fresh)
    assert pickle.dumps(geometry) == pickle.dumps(fresh)
    for other in (pickle.loads(pickle.dumps(geometry)), copy.copy(geometry)):
        assert (dg.inverse(other, POSE) == answer).all()
