"""A run as arrays: what the log holds, and what follows from it."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from duoglide.arrays import AXES, BoolArray, FloatArray
from duoglide.drives.scale import Scale
from duoglide.errors import ConfigError, InputError, LogError
from duoglide.machine import Machine
from duoglide.storage import Document, Log, LogKind, Phase, Topic

IntArray = NDArray[np.int64]
SETPOINT_DELAY = 2
"""Cycles from the SYNC that a setpoint follows to the SYNC at which it should be reached."""


@dataclass(frozen=True, slots=True, eq=False)
class RunData:
    """The cycles of a run; every array has one row a cycle.

    Attributes:
        machine: The machine of the log.
        time: From the first cycle [s], shape (n,).
        cycle: Number of the SYNC, shape (n,).
        phase: A ``Phase``, shape (n,).
        path_time: [s], shape (n,).
        rate: Path time per time, shape (n,).
        setpoint: [increments], shape (n, 3).
        actual: [increments], shape (n, 3).
        controlword: shape (n, 3).
        statusword: shape (n, 3).
        lateness: [us], shape (n,).
        missing: Bit i: drive i did not answer, shape (n,).
        part: Which part of a program ``path_time`` is along, shape (n,).
    """

    machine: Machine
    time: FloatArray
    cycle: IntArray
    phase: IntArray
    path_time: FloatArray
    rate: FloatArray
    setpoint: IntArray
    actual: IntArray
    controlword: IntArray
    statusword: IntArray
    lateness: IntArray
    missing: IntArray
    part: IntArray

    def __len__(self) -> int:
        return len(self.time)

    @property
    def on_plan(self) -> BoolArray:
        """Where the cycles belong to the trajectory, not to an approach or a rest, shape (n,)."""
        begun = np.logical_or.accumulate(self.phase == Phase.PROGRAM)
        return begun & np.isin(self.phase, (Phase.PROGRAM, Phase.STOP))

    @property
    def setpoint_mm(self) -> FloatArray:
        """Setpoints of the carriages [mm], shape (n, 3)."""
        return _mm(self.machine, self.setpoint)

    @property
    def actual_mm(self) -> FloatArray:
        """Actual positions of the carriages [mm], shape (n, 3)."""
        return _mm(self.machine, self.actual)

    @property
    def measured_mm(self) -> FloatArray:
        """Actual positions [mm], shape (n, 3); NaN where a drive's answer did not come in time."""
        measured = self.actual_mm
        for axis in range(AXES):
            measured[(self.missing >> axis) & 1 == 1, axis] = np.nan
        return measured

    @property
    def following_error(self) -> FloatArray:
        """Actual position minus the setpoint that should be reached then [mm], shape (n, 3).

        NaN where the log does not hold that setpoint, where the drive's answer did not come, and
        in the cycle after that.
        """
        error = np.full((len(self), AXES), np.nan)
        if len(self) == 0:
            return error
        row = np.searchsorted(self.cycle, self.cycle - SETPOINT_DELAY)
        known = self.cycle[row] == self.cycle - SETPOINT_DELAY
        error[known] = (self.actual_mm - self.setpoint_mm[row])[known]
        unsure = self.missing.copy()
        unsure[1:] |= self.missing[:-1]  # the first answer after a gap may be to an earlier SYNC
        for axis in range(AXES):
            error[(unsure >> axis) & 1 == 1, axis] = np.nan
        return error


def _mm(machine: Machine, increments: IntArray) -> FloatArray:
    """Return carriages [mm] from increments, shape (n, 3)."""
    mm = np.empty(increments.shape)
    for axis in range(AXES):
        scale = Scale.of(machine.drives, axis + 1)
        mm[:, axis] = [scale.to_mm(value) for value in increments[:, axis].tolist()]
    return mm


def machine_of(log: Log) -> Machine:
    """Return the machine that a log was made with.

    Raises:
        LogError: The log holds none, or one that breaks a rule.
    """
    try:
        return Machine.from_dict(log.document(Document.MACHINE))
    except (InputError, ConfigError) as error:
        raise LogError(f"{log.path}: {error}") from error


def read_run(log: Log) -> RunData:
    """Read the cycles of a run.

    Raises:
        LogError: Not a run, it does not hold its machine, or its cycles are not in order.
    """
    if log.kind is not LogKind.RUN:
        raise LogError(f"{log.path} is a {log.kind}, not a run: nothing has been streamed yet")
    times = array("d")
    wholes = {name: array("q") for name in _WHOLES}
    reals = {name: array("d") for name in ("path_time", "rate")}
    for t, record in log.records(Topic.CYCLE):
        times.append(t)
        for name, numbers in reals.items():
            numbers.append(getattr(record, name))
        for name, columns in _WHOLES.items():
            value = getattr(record, name)
            wholes[name].extend(value if columns > 1 else (value,))
    time = np.array(times)
    _require_order(log, np.array(wholes["cycle"], dtype=np.int64))
    return RunData(
        machine=machine_of(log),
        time=time - time[:1],
        path_time=np.array(reals["path_time"]),
        rate=np.array(reals["rate"]),
        **{name: _table(numbers, _WHOLES[name]) for name, numbers in wholes.items()},
    )


def _require_order(log: Log, cycle: IntArray) -> None:
    """Refuse a run whose cycles are not in order: two runs in one, or one that was sorted."""
    (wrong,) = np.nonzero(np.diff(cycle) <= 0)
    if len(wrong):
        before, after = cycle[wrong[0] : wrong[0] + 2]
        raise LogError(f"{log.path}: cycle {after} follows cycle {before}; it is not one run")


_WHOLES = {  # fields of whole numbers, and how many each has
    "cycle": 1,
    "phase": 1,
    "setpoint": AXES,
    "actual": AXES,
    "controlword": AXES,
    "statusword": AXES,
    "lateness": 1,
    "missing": 1,
    "part": 1,
}


def _table(numbers: array[int], columns: int) -> IntArray:
    """Return numbers as an array of shape (n,), or (n, columns)."""
    flat = np.array(numbers, dtype=np.int64)
    return flat if columns == 1 else flat.reshape(-1, columns)
