"""Ask the kernel and the interpreter for as little disturbance as they will grant."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from dataclasses import dataclass

from duoglide.control.channel.events import FIFO

_PR_SET_TIMERSLACK = 29
_MCL_CURRENT_AND_FUTURE = 3
_PRIORITY = 60  # above ordinary FIFO threads of the kernel's interrupts (50), below its watchdogs
_SWITCH_INTERVAL = 0.0002  # [s] a thread that loads setpoints must not hold the cycle up for 5 ms


@dataclass(frozen=True, slots=True)
class Privileges:
    """What the kernel has granted.

    Attributes:
        fifo: The thread runs under SCHED_FIFO.
        locked: Its memory is locked.
        slack: Timer slack is 1 us instead of 50.
    """

    fifo: bool
    locked: bool
    slack: bool

    def to_bits(self) -> int:
        """Return what the event of readiness carries."""
        return self.fifo * FIFO | self.locked << 1 | self.slack << 2


def become_realtime() -> Privileges:
    """Prepare the calling thread for the cycle; what is refused is reported, not raised.

    Threads that exist already keep their policy. Call this after everything is loaded: the garbage
    collector forgets what exists (freeze) and is switched off.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    slack = libc.prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(1000), 0, 0, 0) == 0
    locked = libc.mlockall(_MCL_CURRENT_AND_FUTURE) == 0
    fifo = _schedule(_PRIORITY)
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    return Privileges(fifo=fifo, locked=locked, slack=slack)


def become_helper() -> None:
    """Let the calling thread run almost as promptly as the cycle.

    While it holds the interpreter's lock the cycle waits for it; so nobody else may hold it up.
    """
    _schedule(_PRIORITY - 1)


def _schedule(priority: int) -> bool:
    """Put the calling thread under SCHED_FIFO; return whether that was granted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        return False
    return True
