"""The JSON schema of every topic, written into each log beside its messages."""

from __future__ import annotations

import json
from typing import Any

from duoglide.storage.records import Topic

_NUMBER: dict[str, Any] = {"type": "number"}
_WHOLE: dict[str, Any] = {"type": "integer"}
_TEXT: dict[str, Any] = {"type": "string"}
_WHOLES: dict[str, Any] = {"type": "array", "items": _WHOLE, "minItems": 3, "maxItems": 3}
_NUMBERS: dict[str, Any] = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}

_FIELDS: dict[Topic, dict[str, tuple[dict[str, Any], str]]] = {
    Topic.CYCLE: {
        "cycle": (_WHOLE, "number of the SYNC; the setpoint acts at the next one"),
        "phase": (_WHOLE, "0 hold, 1 approach, 2 program, 3 stop"),
        "path_time": (_NUMBER, "time along the trajectory, s"),
        "rate": (_NUMBER, "path time per time"),
        "setpoint": (_WHOLES, "target position 0x607A, increments, carriages 1 to 3"),
        "actual": (_WHOLES, "actual position 0x6064, increments, carriages 1 to 3"),
        "controlword": (_WHOLES, "0x6040, carriages 1 to 3"),
        "statusword": (_WHOLES, "0x6041, carriages 1 to 3"),
        "lateness": (_WHOLE, "start of the cycle after its deadline, us"),
        "missing": (_WHOLE, "bit i: no answer from drive i + 1 to this SYNC"),
        "part": (_WHOLE, "which part of a program path_time is along, from 0"),
    },
    Topic.EVENT: {
        "kind": (_TEXT, "what happened"),
        "text": (_TEXT, "in words"),
        "axis": (_WHOLE, "carriage 1 to 3, 0 for all"),
        "code": (_WHOLE, "CiA 301 emergency error code, 0 for none"),
    },
    Topic.MOTION: {
        "path_time": (_NUMBER, "time along the trajectory, s"),
        "position": (_NUMBERS, "platform centre, mm, x y z"),
        "carriages": (_NUMBERS, "mm, carriages 1 to 3"),
        "velocity": (_NUMBERS, "of the carriages, mm/s"),
        "acceleration": (_NUMBERS, "of the carriages, mm/s^2"),
        "jerk": (_NUMBERS, "of the carriages, mm/s^3"),
    },
}


def schema_name(topic: Topic) -> str:
    """Return the name of a topic's schema, such as ``duoglide.Cycle``."""
    return f"duoglide.{topic.removeprefix('/').title()}"


def schema_of(topic: Topic) -> bytes:
    """Return the JSON schema of a topic."""
    fields = _FIELDS[topic]
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": schema_name(topic),
        "type": "object",
        "properties": {
            name: {**kind, "description": description}
            for name, (kind, description) in fields.items()
        },
        "required": list(fields),
    }
    return json.dumps(schema).encode()
