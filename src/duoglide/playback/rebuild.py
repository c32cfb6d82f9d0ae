"""The motion of a recorded run, from the plan in its log and the path time of each cycle.

A run at full speed was the plan, cycle by cycle, and gives the plan back. A run that was slowed
down, held or stopped gives a trajectory on the same curve whose profile has a knot at every cycle,
with exactly the path parameter that was streamed then. Either way the setpoints come out the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.control.channel.scale import Scales
from duoglide.errors import DuoglideError, LogError
from duoglide.motion.pace import Pace
from duoglide.motion.path.actions import WaitInput
from duoglide.planning.trajectory import Trajectory
from duoglide.playback.run_data import IntArray, RunData, read_run
from duoglide.storage import Document, Log, LogKind
from duoglide.storage.records import is_part


@dataclass(frozen=True, slots=True)
class Recorded:
    """A run that can be streamed again.

    Attributes:
        plan: What was to be streamed.
        motion: What was streamed: the plan itself if its pace was never changed.
        data: The run.
    """

    plan: Trajectory
    motion: Trajectory
    data: RunData


def rebuild(log: Log) -> Recorded:
    """Return the motion of a run.

    Raises:
        LogError: Not a run, it never came onto its plan, cycles of it are lost, or its setpoints
            are not those of its plan.
    """
    if log.kind is not LogKind.RUN:
        raise LogError(f"{log.path} is a {log.kind}, not a run: `duoglide stream` streams it")
    plan = plan_of(log)
    data = read_run(log)
    rows = program_rows(log, data)
    _require_every_cycle(log, data.cycle[rows])
    _require_same_setpoints(log, plan, data, rows)
    times = path_times(data, rows)
    if _nominal(plan, data, rows, times):
        return Recorded(plan, plan, data)
    return Recorded(plan, _repaced(plan, data, rows, times), data)


def plan_of(log: Log) -> Trajectory:
    """Return the trajectory in a log.

    Raises:
        LogError: It holds none, or none that can be understood and that its machine can follow.
    """
    try:
        return Trajectory.from_document(log.document(Document.TRAJECTORY))
    except DuoglideError as error:
        raise LogError(f"{log.path}: {error}") from error


def plans_of(log: Log) -> dict[int, Trajectory]:
    """Return the plan of each part of a program in a log; part 0 of any other run.

    Raises:
        LogError: One cannot be understood, or its machine cannot follow it.
    """
    first = first_part(log)
    plans = {first: plan_of(log)}
    for name, document in log.documents.items():
        if is_part(name):
            number = int(name.rpartition("_")[2])
            try:
                plans[number] = Trajectory.from_document(document)
            except DuoglideError as error:
                raise LogError(f"{log.path}: part {number}: {error}") from error
    return plans


def is_program(log: Log) -> bool:
    """Whether a run was a program of more parts than one."""
    return first_part(log) > 0 or any(is_part(name) for name in log.documents)


def first_part(log: Log) -> int:
    """Return which part of a program is the first in a log; 0 but in the later files of a run."""
    text = log.metadata.get("first_part", "0")
    if not text.isdecimal():
        raise LogError(f"{log.path}: the head of the log says first_part = {text!r:.40}")
    return int(text)


def rebuild_parts(log: Log) -> list[Trajectory]:
    """Return the parts of a recorded program, whole: their plans, up to where each was left.

    Its last part is the way to rest, as a program ends. Which pace they were run at is not in them.

    Raises:
        LogError: The log does not begin with the program, parts or cycles of it are lost, or its
            setpoints are not those of its plans.
    """
    if first_part(log):
        raise LogError(
            f"{log.path} is a later file of a run, and begins in the middle of its program: replay"
            " its first file"
        )
    plans, data = plans_of(log), read_run(log)
    rows = program_rows(log, data)
    _require_every_cycle(log, data.cycle[rows])
    passed = np.unique(data.part[rows]).tolist()
    if lost := sorted(set(range(passed[-1] + 1)) - set(plans)):
        raise LogError(f"{log.path}: the plan of part {lost[0]} is not in it")
    for part in passed:
        whole = plans[part].whole or plans[part]
        _require_same_setpoints(log, whole, data, rows[data.part[rows] == part])
    last = plans[passed[-1]]
    return [*(plans[part] for part in range(passed[-1])), last.whole or last]


def program_rows(log: Log, data: RunData) -> IntArray:
    """Return the rows from the first cycle on the plan to the one that came to its end.

    Raises:
        LogError: There are none.
    """
    on = np.flatnonzero(data.on_plan)
    if len(on) == 0:
        raise LogError(f"{log.path} holds no cycle on its plan: there is nothing to replay")
    end = int(on[-1]) + 1
    arrived = end < len(data) and data.path_time[end] > data.path_time[end - 1]
    return np.arange(on[0], end + int(arrived))  # the last step is made in a cycle that then holds


def path_times(data: RunData, rows: IntArray) -> FloatArray:
    """Return when each of these rows was streamed, from path time 0 on [s]."""
    cycle = data.machine.drives.cycle
    begun = 1 if data.path_time[rows[0]] > 0.0 else 0  # the start itself was held before
    times: FloatArray = (data.cycle[rows] - data.cycle[rows[0]] + begun) * cycle
    return times


def _nominal(plan: Trajectory, data: RunData, rows: IntArray, times: FloatArray) -> bool:
    """Whether each cycle was the plan's own, to the last bit, up to the end."""
    expected = np.minimum(times, plan.duration)
    got = data.path_time[rows]
    return bool(np.array_equal(expected, got)) and got[-1] == plan.duration


def _require_every_cycle(log: Log, cycle: IntArray) -> None:
    """Refuse a log that has lost cycles of its plan; one that the streamer left out is none."""
    (gaps,) = np.nonzero(np.diff(cycle) > 1)
    if log.left_out and len(gaps):
        first, last = cycle[gaps[0]] + 1, cycle[gaps[0] + 1] - 1
        raise LogError(
            f"{log.path}: {log.left_out} messages have been filtered out or lost, cycles {first} to"
            f" {last} of the plan among them; what was streamed then is not known"
        )


def _require_same_setpoints(log: Log, plan: Trajectory, data: RunData, rows: IntArray) -> None:
    """Refuse a log whose setpoints are not its plan's at its path times."""
    carriages = plan.at(data.path_time[rows]).carriages
    wrong = (Scales.of(data.machine.drives).increments(carriages) != data.setpoint[rows]).any(1)
    if wrong.any():
        row = rows[int(np.argmax(wrong))]
        raise LogError(
            f"{log.path}: the setpoint of cycle {data.cycle[row]} is not that of the plan at path"
            f" time {data.path_time[row]:.6f} s; the log does not fit itself"
        )


def _repaced(plan: Trajectory, data: RunData, rows: IntArray, times: FloatArray) -> Trajectory:
    """Return the plan's curve with the pace of the run."""
    if any(isinstance(action, WaitInput) for _, action in plan.actions):
        raise LogError(
            "a run that was slowed down, held or stopped and waits for inputs cannot be replayed as"
            " it was; --override 100 replays its plan"
        )
    u, rate = data.path_time[rows], data.rate[rows]
    if times[0] > 0.0:
        times, u, rate = (
            np.concatenate([first, column])
            for first, column in (([0.0], times), ([0.0], u), (rate[:1], rate))
        )
    if len(times) < 2:
        raise LogError("a run of one cycle cannot be replayed")
    return Trajectory.repaced(plan, Pace(times, u, rate))
