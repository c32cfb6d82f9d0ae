"""Which controlword each drive gets: the three drives' power as one goal."""

from __future__ import annotations

from collections.abc import Sequence

from duoglide.control.channel.orders import Power
from duoglide.control.streamer.tracks import AxisTrack
from duoglide.drives.cia402 import Control, State, controlword_towards

_QUICK_STOP_TIME = 0.5  # [s] that drives get for a quick stop before their power is taken
_SWITCH_OFF_TIME = 1.0  # [s] that drives get to switch off once the host is gone
_RESET_PERIOD = 16  # cycles: half of them with bit 7, half without, so that an edge comes again

_ONE_DOWN = {
    State.OPERATION_ENABLED: State.SWITCHED_ON,
    State.SWITCHED_ON: State.READY_TO_SWITCH_ON,
}


def controlword(power: Power, state: State | None, cycle: int) -> int:
    """Return what to send a drive in ``state`` so that it goes where ``power`` wants it.

    A drive in fault, or in a state that has no name, gets zeros, which enable nothing.
    """
    if power is Power.RESET and state is State.FAULT:
        return _RESET if cycle % _RESET_PERIOD >= _RESET_PERIOD // 2 else 0
    return _WORDS.get((power, state), 0)


def _word(power: Power, state: State) -> int:
    """Return the controlword for one pair; ``controlword`` looks it up."""
    if power is Power.ON:
        return int(controlword_towards(state, State.OPERATION_ENABLED) or 0)
    if power.homes:  # who has left operation enabled is not brought back: homing has failed
        if state is not State.OPERATION_ENABLED:
            return int(Control.DISABLE_VOLTAGE)
        begins = power is Power.HOMING_START
        return int(Control.START_HOMING if begins else Control.ENABLE_OPERATION)
    if power is Power.QUICK_STOP:
        moving = state in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
        return int(Control.QUICK_STOP if moving else Control.DISABLE_VOLTAGE)
    goal = _ONE_DOWN.get(state, State.SWITCH_ON_DISABLED)
    return int(controlword_towards(state, goal) or 0)


_HELPLESS = (State.NOT_READY_TO_SWITCH_ON, State.FAULT, State.FAULT_REACTION_ACTIVE)
_RESET = int(Control.FAULT_RESET)
_WORDS: dict[tuple[Power, State | None], int] = {
    (power, state): _word(power, state)
    for power in Power
    for state in State
    if state not in _HELPLESS
}


def all_in(tracks: Sequence[AxisTrack], state: State) -> bool:
    """Whether every drive has last shown ``state``."""
    return all(track.state is state for track in tracks)


class Departure:
    """How the drives are left once the host is gone: at rest first, then without power."""

    def __init__(self) -> None:
        self._seconds = 0.0

    def may_switch_off(self, seconds: float, quick_stop: bool) -> bool:
        """Let time pass [s]; whether drives in a quick stop have had the time that it takes."""
        self._seconds += seconds
        return not quick_stop or self._seconds > _QUICK_STOP_TIME

    def is_over(self, power: Power, tracks: Sequence[AxisTrack]) -> bool:
        """Whether all are off, or have had all the time that they get."""
        off = power is Power.OFF and all_in(tracks, State.SWITCH_ON_DISABLED)
        return off or self._seconds > _QUICK_STOP_TIME + _SWITCH_OFF_TIME
