"""A plan as an MCAP file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from duoglide.errors import LogError
from duoglide.motion.motion import Motion
from duoglide.storage import Document, LogKind, LogWriter, MotionRecord, Topic, read_log

SAMPLE = 0.002  # [s], of the motion records, which are for pictures only
_MOST_SAMPLES = 200_000


def save(path: str | os.PathLike[str], motion: Motion, document: Mapping[str, Any]) -> None:
    """Write a plan: see ``Trajectory.save``.

    Args:
        path: The file.
        motion: What is planned, for samples of it.
        document: The plan itself.
    """
    times, state = motion.sample(max(SAMPLE, motion.duration / _MOST_SAMPLES))
    columns = (
        motion.position_at(times),
        state.carriages,
        state.velocity,
        state.acceleration,
        state.jerk,
    )
    with LogWriter(Path(path), LogKind.PLAN) as log:
        log.attach(Document.MACHINE, motion.machine.to_dict())
        log.attach(Document.TRAJECTORY, document)
        for t, *rows in zip(times.tolist(), *(c.tolist() for c in columns), strict=True):
            log.write(Topic.MOTION, t, MotionRecord(t, *(tuple(row) for row in rows)))


def load(path: str | os.PathLike[str]) -> Mapping[str, Any]:
    """Read the document of a plan: see ``Trajectory.load``."""
    if not isinstance(path, str | os.PathLike):
        raise LogError(f"plan file {path!r:.80}: must be a path")
    document: Mapping[str, Any] = read_log(Path(path)).document(Document.TRAJECTORY)
    return document
