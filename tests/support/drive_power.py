"""Drives enabled, disabled and reset over SDO: in the library, the streamer does so by PDO."""

from __future__ import annotations

import time
from collections.abc import Callable

from duoglide.drives.axis.axis import Axis
from duoglide.drives.cia402 import Control, Mode, State
from duoglide.errors import DriveTimeout

PATIENCE = 2.0  # for a drive to leave a state [s]
_FAULTY = (State.FAULT, State.FAULT_REACTION_ACTIVE)


def enable(axis: Axis) -> None:
    """Bring a drive to OPERATION_ENABLED in CSP, holding where it stands."""
    if axis.safe_torque_off():
        raise axis.error("safe torque off is active; close its circuit first", 0x5441)
    axis.set_mode(Mode.CYCLIC_SYNCHRONOUS_POSITION)
    axis.go_to(State.SWITCHED_ON)
    axis.write(0x607A, 0, axis.read(0x6064))  # or it would jump to an old target
    axis.go_to(State.OPERATION_ENABLED)


def disable(axis: Axis) -> None:
    """Bring a drive to SWITCH_ON_DISABLED, step by step; a fault stays one."""
    if axis.read_state() is State.OPERATION_ENABLED:
        axis.go_to(State.SWITCHED_ON)
    if axis.read_state() not in _FAULTY:
        axis.go_to(State.SWITCH_ON_DISABLED)


def reset_fault(axis: Axis) -> None:
    """Acknowledge a fault by a rising edge; DriveFault where its cause persists."""
    if axis.read_state() not in _FAULTY:
        return
    _wait(lambda: axis.read_state() is not State.FAULT_REACTION_ACTIVE, PATIENCE)
    axis.write(0x6040, 0, Control.DISABLE_VOLTAGE)
    axis.write(0x6040, 0, Control.FAULT_RESET)
    try:
        _wait(lambda: axis.read_state() is not State.FAULT, 0.5)
    except DriveTimeout as error:
        raise axis.fault() from error
    finally:
        axis.write(0x6040, 0, Control.DISABLE_VOLTAGE)


def _wait(reached: Callable[[], bool], patience: float) -> None:
    deadline = time.monotonic() + patience
    while not reached():
        if time.monotonic() > deadline:
            raise DriveTimeout(f"a drive stays in its state for {patience:g} s")
        time.sleep(0.002)
