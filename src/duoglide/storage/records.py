"""What a log holds: the topics, their records, and the JSON schema of each.

A plan is a run that has not happened, so both have the same topics. Every record is one JSON
object, so that Foxglove, PlotJuggler and ten lines of Python can read it without this package.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Any, ClassVar, Protocol, Self, TypeAlias

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
        """Build the record from its decoded JSON object."""
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

    def to_json(self) -> bytes:
        """Return the message as one JSON object; formatted by hand, for this is the hot path."""
        return (
            b'{"cycle":%d,"path_time":%b,"setpoint":[%d,%d,%d],"actual":[%d,%d,%d],"lateness":%d,'
            b'"missing":%d,"phase":%d,"rate":%b,"controlword":[%d,%d,%d],"statusword":[%d,%d,%d]}'
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
        )

    @classmethod
    def from_json(cls, fields: Mapping[str, Any]) -> Self:
        """Build the record from its decoded JSON object."""
        return cls(
            cycle=int(fields["cycle"]),
            phase=Phase(fields["phase"]),
            path_time=float(fields["path_time"]),
            rate=float(fields["rate"]),
            setpoint=_ints(fields["setpoint"]),
            actual=_ints(fields["actual"]),
            controlword=_ints(fields["controlword"]),
            statusword=_ints(fields["statusword"]),
            lateness=int(fields["lateness"]),
            missing=int(fields["missing"]),
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
            text=str(fields["text"]),
            axis=int(fields["axis"]),
            code=int(fields["code"]),
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
            path_time=float(fields["path_time"]),
            position=_floats(fields["position"]),
            carriages=_floats(fields["carriages"]),
            velocity=_floats(fields["velocity"]),
            acceleration=_floats(fields["acceleration"]),
            jerk=_floats(fields["jerk"]),
        )


RECORDS: Mapping[Topic, type[CycleRecord] | type[EventRecord] | type[MotionRecord]] = {
    Topic.CYCLE: CycleRecord,
    Topic.EVENT: EventRecord,
    Topic.MOTION: MotionRecord,
}


def _float(value: float) -> bytes:
    """Return the shortest text that reads back as the same float64."""
    return float.__repr__(float(value)).encode()


def _ints(values: Any) -> IntTriple:
    first, second, third = values
    return int(first), int(second), int(third)


def _floats(values: Any) -> Triple:
    first, second, third = values
    return float(first), float(second), float(third)
