"""What the banner says, and which buttons can act, in every state of a machine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from duoglide.control.channel.events import RunState
from duoglide.control.host.run.handle import RunStatus
from duoglide.drives.cia402 import State
from duoglide.viewer.look import Look
from duoglide.viewer.situation import Level, Situation

OFF, ON = (State.SWITCH_ON_DISABLED,) * 3, (State.OPERATION_ENABLED,) * 3


def look(run: RunState | None = None, **changes: Any) -> Look:
    status = RunStatus(run, 0.5, 0.02, (0.0,) * 3, (0.0,) * 3, 9.0, 0.02) if run else None
    values: dict[str, Any] = {
        "states": ON, "carriages": np.zeros(3), "homed": True, "why_not_homed": "", "enabled": True,
        "latched": (), "position": np.zeros(3), "run": status,
    }  # fmt: skip
    return Look(**values | changes)


NOT_HOMED: dict[str, Any] = {"homed": False, "why_not_homed": "it was switched on anew"}
FAULT: dict[str, Any] = {"latched": ("axis 2: following error",), "enabled": False, "states": OFF}
CASES: list[tuple[dict[str, Any], str, Level, str, set[str]]] = [
    ({}, "Not connected", Level.IDLE, "Press Connect", {"connect"}),
    ({"busy": "Connecting"}, "Connecting", Level.IDLE, "", set()),
    ({"blind": "gone"}, "No answer", Level.FAULT, "press Reset fault", {"reset"}),
    (
        {"look": look(enabled=False, states=OFF, **NOT_HOMED)},
        "No power", Level.IDLE, "Press Enable and home", {"bring_up"},
    ),
    ({"look": look(**NOT_HOMED)}, "Not homed", Level.IDLE, "Press Enable", {"bring_up", "disable"}),
    ({"look": look()}, "Ready", Level.READY, "Plan a pick", {"disable", "small_moves"}),
    (
        {"look": look(), "loaded": True},
        "Ready", Level.READY, "Press Run", {"disable", "small_moves", "run"},
    ),
    (
        {"look": look(), "loaded": True, "ended": "stopped on the path at path time 0.1 s"},
        "Stopped", Level.WAITING, "Press Run", {"disable", "small_moves", "run"},
    ),
    ({"look": look(), "busy": "Homing"}, "Homing", Level.MOVING, "", set()),
    ({"look": look(RunState.RUNNING), "busy": "x"}, "Running", Level.MOVING, "", {"hold"}),
    ({"look": look(RunState.HELD), "busy": "x"}, "Held", Level.WAITING, "Resume", {"resume"}),
    ({"look": look(RunState.STOPPING), "busy": "x"}, "Stopping", Level.WAITING, "", set()),
    ({"look": look(**FAULT)}, "Faulted", Level.FAULT, "press Reset fault", {"reset"}),
    (
        {"look": look(enabled=False, states=(*ON[:2], State.FAULT))},
        "Faulted", Level.FAULT, "press Reset fault", {"reset"},
    ),
    ({"look": look(), "own": False}, "Ready", Level.READY, "Its owner", set()),
    ({"look": look(RunState.RUNNING), "own": False}, "Running", Level.MOVING, "", {"hold"}),
    ({"look": look(**FAULT), "own": False}, "Faulted", Level.FAULT, "Its owner", set()),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "word", "level", "advice", "allowed"), CASES)
def test_each_state_has_its_word_its_colour_its_advice_and_its_buttons(
    changes: dict[str, Any], word: str, level: Level, advice: str, allowed: set[str]
) -> None:
    situation = Situation(**{"own": True} | changes)
    banner = situation.banner
    assert (banner.word, banner.level) == (word, level)
    assert advice in banner.advice
    assert bool(advice) == bool(banner.advice)
    assert {name for name, can in situation.allowed._asdict().items() if can} == allowed


def test_a_fault_is_told_in_words_and_speed_in_percent() -> None:
    assert Situation(own=True, look=look(**FAULT)).banner.detail == "axis 2: following error"
    in_fault = look(enabled=False, states=(*ON[:2], State.FAULT))
    assert Situation(own=True, look=in_fault).banner.detail == "axis 3 is in fault"
    assert Situation(own=True, look=look(RunState.RUNNING)).banner.detail == "speed 2 %"


def test_lamps_do_not_show_what_is_not_known() -> None:
    assert Situation(own=True).banner.lamps == (False, None, None)
    assert Situation(own=True, look=look(), blind="gone").banner.lamps == (None, None, None)
    assert Situation(own=True, look=look(**NOT_HOMED)).banner.lamps == (True, False, True)
