"""The MCAP container for plans and runs: crash-safe to write, tolerant to read.

Arrays and JSON in, arrays and JSON out: nothing here knows what a trajectory is.
"""

from duoglide.storage.reader import Log, LogWarning, read_log
from duoglide.storage.records import (
    CycleRecord,
    Document,
    EventKind,
    EventRecord,
    LogKind,
    MotionRecord,
    Phase,
    Topic,
)
from duoglide.storage.writer import ClockAnchor, LogWriter

__all__ = [
    "ClockAnchor",
    "CycleRecord",
    "Document",
    "EventKind",
    "EventRecord",
    "Log",
    "LogKind",
    "LogWarning",
    "LogWriter",
    "MotionRecord",
    "Phase",
    "Topic",
    "read_log",
]
