"""What a plan or a run looks like over time: the arrays that pictures and pages draw."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LogError
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.model import forward, reachable
from duoglide.kinematics.singularity.margins import clearance
from duoglide.motion.path.carriage import CarriagePath
from duoglide.motion.picks import count_picks
from duoglide.planning.trajectory import Trajectory
from duoglide.playback.run_data import RunData, read_run
from duoglide.storage import LogKind, read_log

if TYPE_CHECKING:
    from duoglide.machine import Geometry

_SAMPLES = 1500  # as many as a plot shows


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A motion over time.

    Attributes:
        times: [s], shape (n,).
        carriages: [mm], shape (n, 3).
        velocities: [mm/s], shape (n, 3).
        positions: Platform centre [mm], shape (n, 3).
        clearances: To the nearest singular surface or edge of reach [mm], shape (n,).
        margins: How far all carriages may be off before links part [mm], shape (n,).
        words: What it is, in Markdown.
    """

    times: FloatArray
    carriages: FloatArray
    velocities: FloatArray
    positions: FloatArray
    clearances: FloatArray
    margins: FloatArray
    words: str

    def position_at(self, t: float) -> FloatArray:
        """Return the platform position at time ``t`` [mm], between the samples and clamped."""
        return np.array([np.interp(t, self.times, self.positions[:, k]) for k in range(3)])


def recording_of(trajectory: Trajectory) -> Recording:
    """Sample a trajectory for a picture."""
    times, state = trajectory.sample(max(trajectory.duration / _SAMPLES, 1e-4))
    positions = trajectory.position_at(times)
    room = _measure(trajectory.machine.geometry, positions)
    path = trajectory.path
    picks = count_picks(path.checked.path) if isinstance(path, CarriagePath) else 0
    rate = f", {30.0 * picks / trajectory.duration:.0f} picks a minute" if picks else ""
    demand = trajectory.demand()
    forces = f", forces up to {demand.peak_force.max():.0f} N, {demand.energy.sum():.1f} J"
    words = f"**Plan**: {trajectory.duration:.4f} s, {_least(*room)}{rate}{forces}"
    return Recording(times, state.carriages, state.velocity, positions, *room, words)


def _measure(geometry: Geometry, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return clearance and carriage margin at positions [mm]; 0 where a run was out of reach."""
    within = reachable(geometry, positions)
    room, margin = np.zeros((2, len(positions)))
    room[within] = clearance(geometry, positions[within])
    margin[within] = carriage_margin(geometry, positions[within])
    return room, margin


def _least(room: FloatArray, margin: FloatArray) -> str:
    """Say how near links come to parting."""
    return f"least clearance {room.min():.2f} mm, least carriage margin {margin.min():.2f} mm"


def recording_of_run(run: RunData) -> Recording:
    """Take the arrays of a run for a picture: where the carriages really were.

    Raises:
        LogError: The run has no cycle.
    """
    if len(run) == 0:
        raise LogError("the run holds no cycle; there is nothing to show")
    rows = np.unique(np.linspace(0, len(run) - 1, _SAMPLES).astype(int))
    carriages = run.actual_mm
    velocities = np.gradient(carriages, run.time, axis=0) if len(run) > 1 else 0.0 * carriages
    positions = forward(run.machine.geometry, carriages[rows])
    room = _measure(run.machine.geometry, positions)
    worst = np.nanmax(np.abs(run.following_error), initial=0.0)
    words = (
        f"**Run**: {run.time[-1]:.3f} s, {len(run)} cycles, worst following error {worst:.3f} mm, "
        f"worst lateness {run.lateness.max()} us, {_least(*room)}"
    )
    return Recording(run.time[rows], carriages[rows], velocities[rows], positions, *room, words)


def load_recording(file: Path) -> tuple[Recording, Trajectory | None]:
    """Open a plan or a run.

    Returns:
        What to draw, and the trajectory, which only a plan has ready to run.

    Raises:
        LogError: Not a log, or it does not hold what it should.
        DuoglideError: What it holds cannot be.
    """
    log = read_log(file)
    if log.kind is LogKind.PLAN:
        trajectory = Trajectory.load(file)
        return recording_of(trajectory), trajectory
    return recording_of_run(read_run(log)), None
