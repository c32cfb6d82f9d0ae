"""What Foxglove's own messages look like in JSON: as much of its schemas as is written here.

See <https://docs.foxglove.dev/docs/sdk/schemas>; a test holds every message against Foxglove's
definitions in Protobuf.
"""

from __future__ import annotations

import json
from typing import Any

_NUMBER, _WHOLE = {"type": "number"}, {"type": "integer"}
_TEXT, _TRUTH = {"type": "string"}, {"type": "boolean"}


def _object(title: str = "", **properties: Any) -> dict[str, Any]:
    named = {"title": title} if title else {}
    return {**named, "type": "object", "properties": properties}


def _list(item: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": item}


_TIME = _object("time", sec=_WHOLE, nsec=_WHOLE)
_DURATION = _object("duration", sec=_WHOLE, nsec=_WHOLE)
_XYZ = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_TURN = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_PLACE = _object(position=_XYZ, orientation=_TURN)
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_NOTHING = _list({"type": "object"})
_ENTITY = _object(
    timestamp=_TIME,
    frame_id=_TEXT,
    id=_TEXT,
    lifetime=_DURATION,
    frame_locked=_TRUTH,
    metadata=_NOTHING,
    arrows=_NOTHING,
    cubes=_list(_object(pose=_PLACE, size=_XYZ, color=_COLOUR)),
    spheres=_NOTHING,
    cylinders=_list(
        _object(pose=_PLACE, size=_XYZ, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR)
    ),
    lines=_list(
        _object(
            type=_WHOLE,
            pose=_PLACE,
            thickness=_NUMBER,
            scale_invariant=_TRUTH,
            points=_list(_XYZ),
            color=_COLOUR,
            colors=_list(_COLOUR),
            indices=_list(_WHOLE),
        )
    ),
    triangles=_NOTHING,
    texts=_list(
        _object(
            pose=_PLACE,
            billboard=_TRUTH,
            font_size=_NUMBER,
            scale_invariant=_TRUTH,
            color=_COLOUR,
            text=_TEXT,
        )
    ),
    models=_NOTHING,
)
_TRANSFORM = _object(
    timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_XYZ, rotation=_TURN
)
SCHEMAS: dict[str, dict[str, Any]] = {
    "foxglove.SceneUpdate": _object(deletions=_NOTHING, entities=_list(_ENTITY)),
    "foxglove.FrameTransforms": _object(transforms=_list(_TRANSFORM)),
    "foxglove.JointStates": _object(
        timestamp=_TIME, joints=_list(_object(name=_TEXT, position=_NUMBER))
    ),
    "foxglove.PoseInFrame": _object(timestamp=_TIME, frame_id=_TEXT, pose=_PLACE),
    "foxglove.Log": _object(
        timestamp=_TIME, level=_WHOLE, message=_TEXT, name=_TEXT, file=_TEXT, line=_WHOLE
    ),
}
"""Name to JSON schema."""


def schema_text(title: str, schema: dict[str, Any]) -> bytes:
    """Return a schema as a channel of an MCAP file has it."""
    return json.dumps({"title": title, **schema}).encode()
