"""A trajectory as an MCAP file."""

from __future__ import annotations

import os
from pathlib import Path

from duoglide.errors import ConfigError, InputError, LogError
from duoglide.motion.trajectory import Trajectory
from duoglide.storage import Document, LogKind, LogWriter, MotionRecord, Topic, read_log

SAMPLE = 0.002  # [s], of the motion records, which are for pictures only
_MOST_SAMPLES = 200_000


def save(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write ``trajectory``: see ``Trajectory.save``."""
    times, state = trajectory.sample(max(SAMPLE, trajectory.duration / _MOST_SAMPLES))
    columns = (
        trajectory.position_at(times),
        state.carriages,
        state.velocity,
        state.acceleration,
        state.jerk,
    )
    with LogWriter(Path(path), LogKind.PLAN) as log:
        log.attach(Document.MACHINE, trajectory.machine.to_dict())
        log.attach(Document.TRAJECTORY, trajectory.to_document())
        for t, *rows in zip(times.tolist(), *(c.tolist() for c in columns), strict=True):
            log.write(Topic.MOTION, t, MotionRecord(t, *(tuple(row) for row in rows)))


def load(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory: see ``Trajectory.load``."""
    if not isinstance(path, str | os.PathLike):
        raise LogError(f"plan file {path!r:.80}: must be a path")
    document = read_log(Path(path)).document(Document.TRAJECTORY)
    try:
        return Trajectory.from_document(document)
    except (InputError, ConfigError) as error:
        raise LogError(f"{path}: {error}") from error
