"""A layout for Foxglove that shows what ``write_foxglove`` writes.

Foxglove opens it by "Import from file"; its panels name topics and fields of the export, which a
test holds against one.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from duoglide.drawing.picture import COLOURS
from duoglide.playback.shown.foxglove_scene import DONE, MECHANISM, PLANNED
from duoglide.playback.shown.scene import FOOT
from duoglide.storage.atomic import appearing

_CARRIAGES = (1, 2, 3)
_GREY, _RED = "#7f7f7f", "#cc0050"


def write_layout(file: str | Path) -> int:
    """Write the layout as JSON.

    Returns:
        How many panels it has.

    Raises:
        LogError: The file cannot be written.
    """
    found = layout()
    with appearing(file) as temporary:
        temporary.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return len(found["configById"])


def layout() -> dict[str, Any]:
    """Return the layout: the mechanism at the left, series and events at the right."""
    panels = {
        "3D!mechanism": _view(),
        "RosOut!events": {"searchTerms": [], "minLogLevel": 1},
        "Plot!carriages": _plot(
            "Carriages [mm]",
            [
                series
                for n in _CARRIAGES
                for series in (
                    _series(f"/carriage_{n}.setpoint_{n}_mm", f"setpoint {n}", _GREY, 1.0),
                    _series(f"/carriage_{n}.actual_{n}_mm", f"actual {n}", COLOURS[n - 1]),
                )
            ],
        ),
        "Plot!following": _plot(
            "Following error [mm]",
            [
                _series(
                    f"/carriage_{n}.following_error_{n}_mm", f"carriage {n}", COLOURS[n - 1], 1.2
                )
                for n in _CARRIAGES
            ],
        ),
        "Plot!clearance": _plot(
            "Clearance [mm]", [_series("/margins.clearance_mm", "clearance", _RED)]
        ),
        "Plot!pace": _plot("Lateness [us]", [_series("/path.lateness_us", "lateness", _GREY, 1.0)]),
        "StateTransitions!drives": {
            "paths": [
                {
                    "value": f"/drives.state_{n}",
                    "label": f"drive {n}",
                    "timestampMethod": "receiveTime",
                }
                for n in _CARRIAGES
            ],
            "isSynced": True,
        },
    }
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split(
            "row",
            55,
            _split("column", 72, "3D!mechanism", "RosOut!events"),
            _split(
                "column",
                60,
                _split("column", 50, "Plot!carriages", "Plot!following"),
                _split(
                    "column",
                    60,
                    _split("row", 50, "Plot!clearance", "Plot!pace"),
                    "StateTransitions!drives",
                ),
            ),
        ),
    }


def _split(direction: str, percent: float, first: Any, second: Any) -> dict[str, Any]:
    return {
        "direction": direction,
        "splitPercentage": percent,
        "first": first,
        "second": second,
    }


def _plot(title: str, paths: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": paths,
        "showLegend": True,
        "legendDisplay": "floating",
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
    }


def _series(path: str, label: str, colour: str, width: float = 1.5) -> dict[str, Any]:
    return {
        "value": path,
        "label": label,
        "color": colour,
        "lineSize": width,
        "enabled": True,
        "showLine": True,
        "timestampMethod": "receiveTime",
    }


def _view() -> dict[str, Any]:
    """Return the 3D panel: the whole machine, seen from above one end of the rails."""
    return {
        "followTf": FOOT,
        "followMode": "follow-none",
        "cameraState": {
            "perspective": True,
            "distance": 1.6,
            "phi": 62,
            "thetaOffset": 52,
            "target": [0, 0, 0],
            "targetOffset": [0, 0, 0.12],
            "targetOrientation": [0, 0, 0, 1],
            "fovy": 45,
            "near": 0.05,
            "far": 100,
        },
        "scene": {"transforms": {"visible": False, "enablePreloading": True}},
        "topics": {
            **{topic: {"visible": True} for topic in (MECHANISM, PLANNED, DONE)},
            "/pose": {"visible": False},
        },
        "layers": {
            "floor": {
                "layerId": "foxglove.Grid",
                "instanceId": "floor",
                "label": "floor",
                "visible": True,
                "frameId": FOOT,
                "size": 2,
                "divisions": 20,
                "lineWidth": 1,
                "color": "#8888884d",
                "position": [0, 0, -0.022],
                "rotation": [0, 0, 0],
                "order": 1,
            }
        },
    }
