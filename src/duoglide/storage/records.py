"""What a log holds: the topics, their records, and the JSON schema of each.

A plan is a run that has not happened, so both have the same topics. Every record is one JSON
object, so that Foxglove, PlotJuggler and ten lines of Python can read it without this package.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from math import isfinite
from typing import Any, ClassVar, Protocol, Self, TypeAlias

_INT31 = 2**31 - 1
_INT63 = 2**63 - 1
_WORD = 0xFFFF
_NEARLY = 1e-3  # by which a clock that comes to its end may be beyond it
_LONGEST = 1e9  # [s]; no run takes thirty years
_NUMBERS = frozenset((int, float))  # and no bool, which is an int to Python

Triple: TypeAlias = tuple[float, float, float]
IntTriple: TypeAlias = tuple[int, int, int]


class LogKind(StrEnum):
    """What a log is about."""

    PLAN = "plan"
    RUN = "run"


class Topic(StrEnum):
    """The channels of a log."""

    CYCLE = "/cycle"
    EVENT = "/event"
    MOTION = "/motion"


class Document(StrEnum):
    """The documents that travel inside a log, as attachments."""

    MACHINE = "machine"
    TRAJECTORY = "trajectory"
    APPROACH = "approach"
    REPORT = "report"


def part_name(part: int) -> str:
    """Return the name of the plan of a part of a program.

    The first part in a file is its TRAJECTORY; the head says which part that is.
    """
    return f"{Document.TRAJECTORY}_{part}"


def is_part(name: str) -> bool:
    """Whether a document is the plan of a part, by ``part_name``."""
    return _PART.fullmatch(name) is not None


def is_document(name: str) -> bool:
    """Whether an attachment is one of ours."""
    return name in _DOCUMENTS or is_part(name)


_DOCUMENTS = frozenset(Document)
_PART = re.compile(rf"{Document.TRAJECTORY}_[1-9][0-9]{{0,8}}")


class Phase(IntEnum):
    """What the stream does in a cycle."""

    HOLD = 0  # at rest; the path time stands still
    APPROACH = 1  # on the way to the start; the path time is that of the approach
    PROGRAM = 2  # on the trajectory
    STOP = 3  # stopping along the trajectory


class EventKind(StrEnum):
    """What happened, outside the regular cycle."""

    STARTED = "started"
    FINISHED = "finished"
    HOLD = "hold"
    RESUME = "resume"
    OVERRIDE = "override"
    STOP = "stop"
    QUICK_STOP = "quick_stop"
    FAULT = "fault"
    EMERGENCY = "emergency"
    TIMEOUT = "timeout"
    LATE = "late"
    LOST = "lost"
    BUS = "bus"
    OUTPUT = "output"
    INPUT = "input"
    NOTE = "note"


class Record(Protocol):
    """One message of a topic."""

    TOPIC: ClassVar[Topic]

    def to_json(self) -> bytes:
        """Return the message as one JSON object."""
        ...

    @classmethod
    def from_json(cls, fields: Mapping[str, Any]) -> Self:
        """Build the record from its decoded JSON object.

        Raises:
            KeyError: A field lacks.
            ValueError: A field is of another kind, or out of its range.
        """
        ...


@dataclass(frozen=True, slots=True)
class CycleRecord:
    """One SYNC cycle of a stream. Everything in it is as the bus saw it.

    Attributes:
        cycle: Number of the SYNC, counted from the start of the stream. ``actual`` and
            ``statusword`` were sampled at this SYNC; ``setpoint`` and ``controlword`` were sent
            after it and act at SYNC ``cycle + 1``.
        phase: What the stream did.
        path_time: Time along the trajectory (in ``APPROACH``: along the approach) that
            ``setpoint`` was computed from [s], to the last bit.
        rate: Path time per time, 1 at full speed.
        setpoint: Target position 0x607A of each drive [increments].
        actual: Actual position 0x6064 of each drive, the last one received [increments].
        controlword: 0x6040 of each drive.
        statusword: 0x6041 of each drive, the last one received.
        lateness: How long after its deadline the cycle began [us].
        missing: Bit i is set where drive i's answer to this SYNC did not come.
        part: Which part of a program ``path_time`` is along, from 0; 0 of any other run.
    """

    TOPIC: ClassVar[Topic] = Topic.CYCLE

    cycle: int
    phase: Phase
    path_time: float
    rate: float
    setpoint: IntTriple
    actual: IntTriple
    controlword: IntTriple
    statusword: IntTriple
    lateness: int = 0
    missing: int = 0
    part: int = 0

    def to_json(self) -> bytes:
        """Return the message as one JSON object; formatted by hand, for this is the hot path."""
        return (
            b'{"cycle":%d,"path_time":%b,"setpoint":[%d,%d,%d],"actual":[%d,%d,%d],"lateness":%d,'
            b'"missing":%d,"phase":%d,"rate":%b,"controlword":[%d,%d,%d],"statusword":[%d,%d,%d],'
            b'"part":%d}'
        ) % (  # what changes comes first, so that the rest is one match for the compressor
            self.cycle,
            _float(self.path_time),
            *self.setpoint,
            *self.actual,
            self.lateness,
            self.missing,
            self.phase,
            _float(self.rate),
            *self.controlword,
            *self.statusword,
            self.part,
        )

    @classmethod
    def from_json(cls, fields: Mapping[str, Any]) -> Self:
        """Build the record from its decoded JSON object."""
        return cls(
            cycle=_whole(fields, "cycle", 0, _INT63),
            phase=Phase(_whole(fields, "phase", 0, max(Phase))),
            path_time=_real(fields, "path_time", -_NEARLY, _LONGEST),
            rate=_real(fields, "rate", -_NEARLY, 1.0 + _NEARLY),
            setpoint=_wholes(fields, "setpoint", -_INT31 - 1, _INT31),
            actual=_wholes(fields, "actual", -_INT31 - 1, _INT31),
            controlword=_wholes(fields, "controlword", 0, _WORD),
            statusword=_wholes(fields, "statusword", 0, _WORD),
            lateness=_whole(fields, "lateness", -_INT63, _INT63),
            missing=_whole(fields, "missing", 0, 0b111),
            part=_whole(fields, "part", 0, _INT63) if "part" in fields else 0,  # older logs
        )


@dataclass(frozen=True, slots=True)
class EventRecord:
    """Something that happened once.

    Attributes:
        kind: What.
        text: In words, with units.
        axis: Which carriage, 1 to 3; 0 where it concerns all of them.
        code: CiA 301 emergency error code, 0 where there is none.
    """

    TOPIC: ClassVar[Topic] = Topic.EVENT

    kind: EventKind
    text: str
    axis: int = 0
    code: int = 0

    def to_json(self) -> bytes:
        """Return the message as one JSON object."""
        fields = {"kind": self.kind, "text": self.text, "axis": self.axis, "code": self.code}
        return json.dumps(fields).encode()

    @classmethod
    def from_json(cls, fields: Mapping[str, Any]) -> Self:
        """Build the record from its decoded JSON object."""
        return cls(
            kind=EventKind(fields["kind"]),
            text=_text(fields, "text"),
            axis=_whole(fields, "axis", 0, 3),
            code=_whole(fields, "code", 0, _WORD),
        )


@dataclass(frozen=True, slots=True)
class MotionRecord:
    """A sample of the planned motion, for pictures; the trajectory document is the exact thing.

    Attributes:
        path_time: Time along the trajectory [s].
        position: Platform centre in the base frame [mm].
        carriages: [mm].
        velocity: Of the carriages [mm/s].
        acceleration: Of the carriages [mm/s^2].
        jerk: Of the carriages [mm/s^3].
    """

    TOPIC: ClassVar[Topic] = Topic.MOTION

    path_time: float
    position: Triple
    carriages: Triple
    velocity: Triple
    acceleration: Triple
    jerk: Triple

    def to_json(self) -> bytes:
        """Return the message as one JSON object."""
        fields = {
            "path_time": self.path_time,
            "position": self.position,
            "carriages": self.carriages,
            "velocity": self.velocity,
            "acceleration": self.acceleration,
            "jerk": self.jerk,
        }
        return json.dumps(fields, allow_nan=False, separators=(",", ":")).encode()

    @classmethod
    def from_json(cls, fields: Mapping[str, Any]) -> Self:
        """Build the record from its decoded JSON object."""
        return cls(
            path_time=_real(fields, "path_time", -_NEARLY, _LONGEST),
            position=_reals(fields, "position"),
            carriages=_reals(fields, "carriages"),
            velocity=_reals(fields, "velocity"),
            acceleration=_reals(fields, "acceleration"),
            jerk=_reals(fields, "jerk"),
        )


RECORDS: Mapping[Topic, type[CycleRecord] | type[EventRecord] | type[MotionRecord]] = {
    Topic.CYCLE: CycleRecord,
    Topic.EVENT: EventRecord,
    Topic.MOTION: MotionRecord,
}


def _float(value: float) -> bytes:
    """Return the shortest text that reads back as the same float64."""
    return float.__repr__(float(value)).encode()


def _whole(fields: Mapping[str, Any], name: str, low: int, high: int) -> int:
    """Return a whole number within its range."""
    value = fields[name]
    if type(value) is int and low <= value <= high:
        return value
    raise ValueError(f"{name} = {value!r:.60}: must be a whole number from {low} to {high}")


def _real(fields: Mapping[str, Any], name: str, low: float, high: float) -> float:
    """Return a number within its range."""
    value = fields[name]
    if type(value) in _NUMBERS and low <= value <= high:
        return float(value)
    raise ValueError(f"{name} = {value!r:.60}: must be a finite number, from {low:g} to {high:g}")


def _wholes(fields: Mapping[str, Any], name: str, low: int, high: int) -> IntTriple:
    """Return three whole numbers within their range."""
    values = fields[name]
    if type(values) is list and len(values) == 3:
        first, second, third = values
        if (
            type(first) is type(second) is type(third) is int
            and low <= first <= high
            and low <= second <= high
            and low <= third <= high
        ):
            return first, second, third
    raise ValueError(f"{name} = {values!r:.60}: must be three whole numbers from {low} to {high}")


def _reals(fields: Mapping[str, Any], name: str) -> Triple:
    """Return three finite numbers."""
    values = fields[name]
    if type(values) is list and len(values) == 3:
        first, second, third = values
        if {type(first), type(second), type(third)} <= _NUMBERS and all(map(isfinite, values)):
            return float(first), float(second), float(third)
    raise ValueError(f"{name} = {values!r:.60}: must be three finite numbers")


def _text(fields: Mapping[str, Any], name: str) -> str:
    """Return a text."""
    value = fields[name]
    if isinstance(value, str):
        return value
    raise ValueError(f"{name} = {value!r:.60}: must be a text")
