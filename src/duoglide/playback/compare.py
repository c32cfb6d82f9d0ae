"""Two runs side by side: where their setpoints and their carriages differ."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from duoglide.arrays import AXES
from duoglide.errors import LogError
from duoglide.playback.run_data import IntArray, RunData


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """How two runs of one trajectory differ, cycle by cycle.

    Attributes:
        cycles: How many cycles on the program each has.
        common: How many were compared: those that neither run left out for being late.
        setpoint: Worst difference of setpoints per carriage [increments].
        actual: Worst difference of actual positions per carriage [mm], where both answered.
        path_time: Worst difference of path time [s].
        first: Number of the first cycle on the program whose setpoints differ; -1 for none.
    """

    cycles: tuple[int, int]
    common: int
    setpoint: tuple[int, ...]
    actual: tuple[float, ...]
    path_time: float
    first: int

    @property
    def same_setpoints(self) -> bool:
        """Whether every setpoint that both have is the same, bit for bit."""
        return self.first < 0

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "same_setpoints": self.same_setpoints}


def compare(one: RunData, other: RunData) -> Comparison:
    """Compare the setpoints on the program of two runs, and what the carriages made of them.

    Raises:
        LogError: A run has no cycle on its program.
    """
    rows = [_program_rows(data) for data in (one, other)]
    numbers = [d.cycle[r] - d.cycle[r[0]] for d, r in zip((one, other), rows, strict=True)]
    common, in_one, in_other = np.intersect1d(*numbers, return_indices=True)
    a, b = rows[0][in_one], rows[1][in_other]
    setpoint = np.abs(one.setpoint[a] - other.setpoint[b])
    different = np.flatnonzero(setpoint.any(axis=1))
    return Comparison(
        cycles=(len(rows[0]), len(rows[1])),
        common=len(common),
        setpoint=tuple(int(worst) for worst in setpoint.max(axis=0)),
        actual=_worst_actual(one, a, other, b),
        path_time=float(np.abs(one.path_time[a] - other.path_time[b]).max()),
        first=int(common[different[0]]) if len(different) else -1,
    )


def _worst_actual(one: RunData, a: IntArray, other: RunData, b: IntArray) -> tuple[float, ...]:
    """Return the worst difference of each carriage in rows where both runs have its answer [mm]."""
    difference = np.abs(one.actual_mm[a] - other.actual_mm[b])
    missing = one.missing[a] | other.missing[b]
    for axis in range(AXES):
        difference[(missing >> axis) & 1 == 1, axis] = 0.0
    return tuple(float(worst) for worst in difference.max(axis=0, initial=0.0))


def _program_rows(data: RunData) -> IntArray:
    rows: IntArray = np.flatnonzero(data.on_program)
    if len(rows) == 0:
        raise LogError("a run without a cycle on its program cannot be compared")
    return rows
