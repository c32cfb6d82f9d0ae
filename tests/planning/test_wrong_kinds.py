"""What is no machine, path, action, box or file at all, at the edges that users call."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import duoglide as dg

LINE = dg.Path.line((-41, 0, 300), (-41, 10, 300))
MACHINE = dg.Machine.default()
CORNER = [(0, 0, 300), (0, 10, 300), (0, 10, 310)]
NONE: Any = None
FILE: Any = "cell.toml"
LIST: Any = [[0, 0, 300], [0, 10, 300]]

REFUSED: list[tuple[Callable[[], Any], type[dg.DuoglideError], str]] = [
    (lambda: dg.plan(LIST, LINE), dg.InputError, "machine must be a duoglide.Machine, got \\["),
    (lambda: dg.plan(MACHINE, LIST), dg.InputError, "path must be a duoglide.Path, got \\["),
    (lambda: dg.check_path(MACHINE, LIST), dg.InputError, "path must be a duoglide.Path"),
    (lambda: dg.check_path(LIST, LINE), dg.InputError, "machine must be a duoglide.Machine"),
    (lambda: dg.Robot.connect(NONE), dg.InputError, "duoglide.Machine, got None; .*load"),
    (lambda: dg.Robot.connect(FILE), dg.InputError, "duoglide.Machine, got 'cell.toml'"),
    (lambda: dg.Robot.connect(MACHINE, NONE), dg.BusError, "unknown bus None: the forms are"),
    (lambda: dg.replay(NONE), dg.InputError, "run = None: must be the path of a file"),
    (lambda: dg.replay(FILE, log=LIST), dg.InputError, "log = \\[\\[0.*must be the path"),
    (lambda: LINE.then(LIST), dg.InputError, "goes on with a Path"),
    (lambda: dg.chain([LINE, LIST]), dg.InputError, "part 1 of the chain"),
    (lambda: dg.chain(LIST), dg.InputError, "part 0 of the chain"),
    (lambda: dg.chain(5), dg.InputError, "paths must be a list of Paths, got 5"),  # type: ignore[arg-type]
    (lambda: list(dg.picks(5)), dg.InputError, "stations must be a list of points, got 5"),  # type: ignore[arg-type]
    (
        lambda: list(dg.picks(LIST, actions=5)),  # type: ignore[arg-type]
        dg.InputError,
        "actions must be a list of lists of actions, got 5",
    ),
    (
        lambda: list(dg.picks(LIST, actions=[dg.Dwell(1.0)])),  # type: ignore[list-item]
        dg.InputError,
        "from station 0 to station 1: at_place must be a list of actions, got Dwell",
    ),
    (
        lambda: dg.pick_and_place(CORNER[0], CORNER[1], at_pick=dg.Dwell(1.0)),  # type: ignore[arg-type]
        dg.InputError,
        "at_pick must be a list of actions, got Dwell",
    ),
    (lambda: LINE.at(0, LIST), dg.InputError, "at waypoint 0: .* is not an action"),
    (lambda: LINE.at(LIST, dg.Dwell(1.0)), dg.InputError, "must be a whole number"),
    (
        lambda: dg.pick_and_place(CORNER[0], CORNER[1], at_pick=LIST),
        dg.InputError,
        "is not an action",
    ),
    (lambda: dg.Path.polyline(CORNER, blends=2.0), dg.InputError, "must be a Blend"),  # type: ignore[arg-type]
    (lambda: dg.Path.from_dict(np.array(5.0)), dg.InputError, "not a path"),  # type: ignore[arg-type]
    (lambda: dg.Path.line((0, 0, 0), (1e200, 0, 0)), dg.InputError, "1e\\+200 mm"),
    (lambda: dg.Path.arc((0, 0, 0), (1e300, 0, 0), (0, 0, 1)), dg.InputError, "1e\\+300 mm"),
    (lambda: dg.Path.through([(0, 0, 0), (0, -1e308, 0)]), dg.InputError, "1e\\+308 mm"),
    (lambda: dg.Machine(keep_out=LIST), dg.ConfigError, "keep_out\\[0\\] = .*must be a Box"),
    (lambda: dg.Machine(keep_out=5.0), dg.ConfigError, "keep_out\\[0\\] = 5.0: must be a Box"),  # type: ignore[arg-type]
    (lambda: dg.Machine.from_dict(LIST), dg.ConfigError, "must be a table"),
    (lambda: dg.SetOutput(np.array([1, 2]), 1, True), dg.InputError, "must be 1, 2 or 3"),  # type: ignore[arg-type]
    (lambda: dg.SetOutput(1.0, 1, True), dg.InputError, "must be 1, 2 or 3"),  # type: ignore[arg-type]
    (lambda: dg.WorkingMode(v=LIST), dg.InputError, "must be \\+1 or -1"),
    (lambda: dg.AssemblyMode(m=np.zeros((2, 2))), dg.InputError, "must be \\+1 or -1"),  # type: ignore[arg-type]
    (lambda: dg.Trajectory.load(LIST), dg.LogError, "must be a path"),
    (lambda: dg.read_program(LIST), dg.InputError, "must be a path"),
]


@pytest.mark.parametrize(("call", "kind", "message"), REFUSED)
def test_a_value_of_the_wrong_kind_is_refused_by_name(
    call: Callable[[], Any], kind: type[dg.DuoglideError], message: str
) -> None:
    with pytest.raises(kind, match=message) as caught:
        call()
    assert len(str(caught.value)) < 200


def test_one_box_alone_counts_as_a_list_of_one() -> None:
    box = dg.Box(low=(0, 0, 0), high=(1, 1, 1))
    machine = dg.Machine(keep_out=box)  # type: ignore[arg-type]
    assert machine.keep_out == (box,)


def test_signs_of_numpy_are_signs() -> None:
    assert dg.WorkingMode(v=np.int64(-1), w1=np.float64(1.0)) == dg.WorkingMode(v=-1, w1=1)  # type: ignore[arg-type]
