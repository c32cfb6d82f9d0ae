"""A plan or a run as a table of named columns, with what follows from it: tool, margins, errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from duoglide.arrays import AXES, BoolArray, FloatArray
from duoglide.errors import InputError, SingularityError, UnreachableError
from duoglide.kinematics.dynamics.dynamics import carriage_forces
from duoglide.kinematics.model import forward, reachable
from duoglide.kinematics.singularity.margins import clearance, margins
from duoglide.machine import Geometry, Machine
from duoglide.motion.forces import forward_rates
from duoglide.playback.run_data import IntArray, RunData, machine_of, read_run
from duoglide.storage import Log, LogKind, MotionRecord, Topic

Columns = dict[str, Any]
"""Column name, with its unit as the last word, to an array of one value a row."""


_RATES = ("carriages", "velocity", "acceleration")

FAMILIES = (
    "legs_vertical",
    "strut",
    "legs_parallel",
    "legs_flat",
    "arm_strut",
    "arm_flat",
)
"""The margins, as ``Margins`` names them."""


def columns_of(log: Log) -> Columns:
    """Return the table of a plan or of a run.

    Raises:
        LogError: A message cannot be read.
    """
    if log.kind is LogKind.RUN:
        return run_columns(read_run(log))
    records = [record for _, record in log.records(Topic.MOTION)]
    return _plan_columns(records, machine_of(log))


def run_columns(data: RunData) -> Columns:
    """Return the table of a run: one row a cycle."""
    position = platform(data.machine.geometry, data.actual_mm)
    columns: Columns = {
        "time_s": data.time,
        "cycle": data.cycle,
        "phase": data.phase,
        "path_time_s": data.path_time,
        "rate": data.rate,
    }
    _add_axes(columns, "setpoint", "inc", data.setpoint)
    _add_axes(columns, "actual", "inc", data.actual)
    _add_axes(columns, "setpoint", "mm", data.setpoint_mm)
    _add_axes(columns, "actual", "mm", data.actual_mm)
    _add_axes(columns, "following_error", "mm", data.following_error)
    for index, name in enumerate("xyz"):
        columns[f"{name}_mm"] = position[:, index]
    columns.update(margin_columns(data.machine.geometry, position))
    _add_axes(columns, "controlword", "", data.controlword)
    _add_axes(columns, "statusword", "", data.statusword)
    columns["lateness_us"] = data.lateness
    columns["missing"] = data.missing
    columns["part"] = data.part
    return columns


def _plan_columns(records: list[MotionRecord], machine: Machine) -> Columns:
    columns: Columns = {"path_time_s": np.array([record.path_time for record in records])}
    position = _rows([record.position for record in records])
    for index, name in enumerate("xyz"):
        columns[f"{name}_mm"] = position[:, index]
    for name, unit in (
        ("carriages", "mm"),
        ("velocity", "mm_per_s"),
        ("acceleration", "mm_per_s2"),
        ("jerk", "mm_per_s3"),
    ):
        _add_axes(columns, name, unit, _rows([getattr(record, name) for record in records]))
    rates = (_rows([getattr(record, name) for record in records]) for name in _RATES)
    _add_axes(columns, "force", "N", _forces(machine, *rates))
    return columns


def _forces(
    machine: Machine, carriages: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Return the forces of each row [N], NaN where the records hold no motion of the links."""
    try:
        state = forward_rates(machine.geometry, carriages, velocity, acceleration)
        return carriage_forces(machine, *state)
    except (UnreachableError, SingularityError, InputError):
        return np.full(carriages.shape, np.nan)


def platform(geometry: Geometry, carriages: FloatArray) -> FloatArray:
    """Return the platform centre of each row [mm], NaN where the carriages hold none.

    Args:
        geometry: Dimensions of the robot.
        carriages: [mm], shape (n, 3).
    """
    try:
        return forward(geometry, carriages)
    except (UnreachableError, SingularityError):
        position = np.full(carriages.shape, np.nan)
        for row, triple in zip(position, carriages, strict=True):
            try:
                row[:] = forward(geometry, triple)
            except (UnreachableError, SingularityError):
                continue
        return position


def margin_columns(geometry: Geometry, position: FloatArray) -> Columns:
    """Return clearance and every margin at each row of positions [mm], NaN where there is none."""
    table = {f"{name}_mm": np.full(len(position), np.nan) for name in ("clearance", *FAMILIES)}
    known: BoolArray = np.asarray(np.isfinite(position).all(axis=-1))
    known[known] = reachable(geometry, position[known])
    if known.any():
        table["clearance_mm"][known] = clearance(geometry, position[known])
        measured = margins(geometry, position[known])
        for name in FAMILIES:
            table[f"{name}_mm"][known] = getattr(measured, name)
    return table


def _add_axes(columns: Columns, name: str, unit: str, values: FloatArray | IntArray) -> None:
    """Add one column per carriage."""
    for axis in range(AXES):
        columns["_".join(filter(None, (name, str(axis + 1), unit)))] = values[:, axis]


def _rows(triples: list[tuple[float, float, float]]) -> FloatArray:
    return np.array(triples, dtype=np.float64).reshape(-1, AXES)
