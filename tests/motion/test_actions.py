from __future__ import annotations

import pytest

import duoglide as dg
from duoglide.motion.path.actions import (
    Action,
    Dwell,
    SetOutput,
    SetPayload,
    WaitInput,
    needs_rest,
    read_action,
)


@pytest.mark.parametrize(
    "action",
    [SetOutput(1, 31, True), WaitInput(3, 0, False, 2.5), Dwell(0.1), SetPayload(0.25)],
)
def test_an_action_survives_its_table(action: Action) -> None:
    assert read_action(action.to_dict()) == action


def test_only_outputs_and_payloads_are_set_in_passing() -> None:
    assert not needs_rest(SetOutput(1, 0, True))
    assert not needs_rest(SetPayload(0.0))
    assert needs_rest(Dwell(1.0))
    assert needs_rest(WaitInput(1, 0, True))


@pytest.mark.parametrize(
    "table",
    [
        {"type": "sing"},
        {"type": "dwell"},
        {"type": "dwell", "seconds": 0},
        {"type": "set_payload", "mass": -0.1},
        {"type": "set_payload", "mass": "heavy"},
        {"type": "set_payload"},
        {"type": "dwell", "seconds": "long"},
        {"type": "set_output", "axis": 4, "bit": 0, "value": True},
        {"type": "set_output", "axis": 1, "bit": 32, "value": True},
        {"type": "set_output", "axis": 1, "bit": 0, "value": 1},
        {"type": "wait_input", "axis": 1, "bit": 0, "value": True, "timeout": -1},
        {"type": "wait_input", "axis": True, "bit": 0, "value": True},
        {"type": "set_output", "axis": 1, "bit": 0, "value": True, "colour": "red"},
    ],
)
def test_tables_that_make_no_action_are_refused(table: dict[str, object]) -> None:
    with pytest.raises(dg.InputError):
        read_action(table)
