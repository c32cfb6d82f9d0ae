from __future__ import annotations

import pytest

from duoglide.drives.cia402 import (
    Command,
    Control,
    Mode,
    State,
    command_of,
    controlword_towards,
    decode,
    emergency_words,
)
from duoglide.drives.simulation.firmware.axis import FirmwareAxis
from duoglide.errors import DriveError

GOALS = [
    State.SWITCH_ON_DISABLED,
    State.READY_TO_SWITCH_ON,
    State.SWITCHED_ON,
    State.OPERATION_ENABLED,
]


def axis_in(state: State) -> FirmwareAxis:
    axis = FirmwareAxis()
    axis.tick(1000, 0)
    for word in (Control.SHUTDOWN, Control.SWITCH_ON, Control.ENABLE_OPERATION):
        if axis.state is not state:
            axis.write(0x6040, 0, word)
    if state is State.QUICK_STOP_ACTIVE:
        axis.write(0x605A, 0, 6)
        axis.write(0x6040, 0, Control.QUICK_STOP)
    return axis


def test_exactly_53248_statuswords_match_no_state() -> None:
    undefined = 0
    for word in range(1 << 16):
        try:
            decode(word)
        except DriveError as error:
            undefined += 1
            assert f"0x{word:04X}" in str(error)
    assert undefined == 53_248


@pytest.mark.parametrize("state", State)
def test_a_state_is_decoded_whatever_the_other_bits_say(state: State) -> None:
    for others in range(0, 1 << 16, 37):
        assert decode(state.pattern | others & ~state.mask) is state


def test_no_statusword_matches_two_states() -> None:
    for low in range(128):
        assert sum(low & state.mask == state.pattern for state in State) <= 1


def test_every_controlword_commands_something() -> None:
    words = {
        Control.DISABLE_VOLTAGE: Command.DISABLE_VOLTAGE,
        Control.QUICK_STOP: Command.QUICK_STOP,
        Control.SHUTDOWN: Command.SHUTDOWN,
        Control.SWITCH_ON: Command.SWITCH_ON,
        Control.ENABLE_OPERATION: Command.ENABLE,
        Control.START_HOMING: Command.ENABLE,
    }
    assert {word: command_of(word) for word in words} == words


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("start", [*GOALS, State.QUICK_STOP_ACTIVE])
def test_a_drive_gets_from_every_state_to_every_goal(start: State, goal: State) -> None:
    axis = axis_in(start)
    assert axis.state is start
    for _ in range(12):
        word = controlword_towards(decode(axis.statusword), goal)
        assert word is not None
        axis.write(0x6040, 0, word)
        axis.tick(1000, 0)
    assert axis.state is goal


def test_a_fault_is_not_left_on_the_way_to_somewhere() -> None:
    with pytest.raises(DriveError, match="reset it"):
        controlword_towards(State.FAULT, State.OPERATION_ENABLED)


def test_a_drive_is_let_alone_while_it_brakes_by_itself() -> None:
    assert controlword_towards(State.FAULT_REACTION_ACTIVE, State.OPERATION_ENABLED) is None


def test_a_quick_stop_needs_power() -> None:
    assert controlword_towards(State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE) == 0x0002
    with pytest.raises(DriveError, match="no quick stop from switched on"):
        controlword_towards(State.SWITCHED_ON, State.QUICK_STOP_ACTIVE)


def test_a_fault_cannot_be_a_goal() -> None:
    with pytest.raises(DriveError, match="cannot be commanded"):
        controlword_towards(State.SWITCHED_ON, State.FAULT)


def test_mode_8_is_bit_7_of_the_supported_modes() -> None:
    assert Mode.CYCLIC_SYNCHRONOUS_POSITION.supported_bit == 0x80
    assert Mode.HOMING.supported_bit == 0x20


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0x8611, "following error"),
        (0x2310, "over-current"),
        (0x8130, "heartbeat"),
        (0x2399, "current (code not named"),
        (0x3999, "voltage"),
        (0xFF42, "device specific"),
        (0x0000, "no error"),
        (0x0042, "unknown"),
    ],
)
def test_every_emergency_code_has_words(code: int, words: str) -> None:
    assert words in emergency_words(code)
