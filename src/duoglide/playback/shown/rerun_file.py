"""A plan or a run as a recording of Rerun: the mechanism in 3D, series, events, and their views."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.drawing.picture import COLOURS as CARRIAGE_COLOURS
from duoglide.errors import LogError
from duoglide.kinematics.export import COLOURS, RADIUS
from duoglide.playback.columns import Columns, columns_of, run_columns
from duoglide.playback.shown.foxglove_scene import DONE_COLOUR, PLANNED_COLOUR, from_z
from duoglide.playback.shown.scene import FOOT, Bodies, Scene, boxes, read_scene
from duoglide.storage import Log, Topic
from duoglide.storage.atomic import appearing

METRE = 1e-3  # one millimetre
TIMELINE = "time"
_EYE, _TARGET = (1.0, -0.75, 0.75), (0.0, 0.0, 0.12)  # [m], of the first view
_RUN_SERIES = {
    "carriages": {
        f"{name}_{n}": f"{name}_{n}_mm" for n in (1, 2, 3) for name in ("setpoint", "actual")
    },
    "following_error": {f"carriage_{n}": f"following_error_{n}_mm" for n in (1, 2, 3)},
    "clearance": {"clearance": "clearance_mm"},
    "lateness": {"lateness": "lateness_us"},
}
_PLAN_SERIES = {
    "carriages": {f"carriage_{n}": f"carriages_{n}_mm" for n in (1, 2, 3)},
    "velocity": {f"carriage_{n}": f"velocity_{n}_mm_per_s" for n in (1, 2, 3)},
    "acceleration": {f"carriage_{n}": f"acceleration_{n}_mm_per_s2" for n in (1, 2, 3)},
}
_TITLES = {
    "carriages": "Carriages [mm]",
    "following_error": "Following error [mm]",
    "clearance": "Clearance [mm]",
    "lateness": "Lateness [us]",
    "velocity": "Velocity [mm/s]",
    "acceleration": "Acceleration [mm/s^2]",
}


def write_rerun(log: Log, file: str | Path) -> int:
    """Write a log for Rerun's viewer, with the views that show it; needs the extra ``rerun``.

    Lengths in 3D are in metres; series keep the units of their names.

    Args:
        log: A plan or a run.
        file: Where to write (.rrd).

    Returns:
        How many rows it has: a cycle of a run, a sample of a plan.

    Raises:
        LogError: The log cannot be read or holds nothing to show, or the file cannot be written.
        ModuleNotFoundError: rerun-sdk is not installed.
    """
    import rerun as rr

    scene = read_scene(log)
    if not len(scene.stamps):
        raise LogError(f"{log.path} has no cycle: there is nothing to show")
    series = _RUN_SERIES if scene.run is not None else _PLAN_SERIES
    columns = columns_of(log) if scene.run is None else run_columns(scene.run)
    with appearing(file) as temporary:
        recording = rr.RecordingStream("duoglide", send_properties=False)
        rr.set_log_time_enabled(False, recording)
        recording.save(temporary)
        recording.send_blueprint(_views(list(series)))
        _send_path(recording, scene)
        if scene.bodies is not None:
            _send_bodies(recording, scene, scene.bodies)
        _send_series(recording, scene, series, columns)
        _send_events(recording, log)
        recording.flush()
        recording.disconnect()
    return len(scene.stamps)


def _times(stamps: Any) -> Any:
    """Return stamps [ns since 1970] as the times of rows."""
    import rerun as rr

    return rr.TimeColumn(TIMELINE, timestamp=np.asarray(stamps, dtype="datetime64[ns]"))


def _send_bodies(recording: Any, scene: Scene, bodies: Bodies) -> None:
    """Send the bodies once, each below a frame of its own that moves."""
    import rerun as rr

    recording.log("robot", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for body in bodies.tree.bodies:
        bars = [bar for bar in body.bars if bar.start != bar.end]
        ways = np.array([np.subtract(bar.end, bar.start) for bar in bars])
        lengths = np.linalg.norm(ways, axis=1)
        recording.log(
            f"robot/{body.name}/bars",
            rr.Capsules3D(
                lengths=lengths * METRE,
                radii=RADIUS * METRE,
                translations=np.array([bar.start for bar in bars]) * METRE
                - np.array(body.origin) * METRE,
                quaternions=[
                    rr.Quaternion(xyzw=from_z(way / length))
                    for way, length in zip(ways, lengths, strict=True)
                ],
                colors=COLOURS[body.name],
                fill_mode="solid",
            ),
            static=True,
        )
        origin, turn = bodies.poses[body.name]
        recording.send_columns(
            f"robot/{body.name}",
            [_times(scene.stamps[bodies.rows])],
            rr.Transform3D.columns(translation=origin * METRE, quaternion=turn),
        )
    for number, block in enumerate(boxes(scene.machine.geometry, bodies.tree)):
        recording.log(
            f"robot/{block.body}/block_{number}" if block.body != FOOT else f"robot/rail_{number}",
            rr.Boxes3D(
                centers=[np.array(block.centre) * METRE],
                sizes=[np.array(block.size) * METRE],
                colors=COLOURS.get(block.body, (0.59, 0.61, 0.63)),
                fill_mode="solid",
            ),
            static=True,
        )


def _send_path(recording: Any, scene: Scene) -> None:
    """Send the path that was planned, and the one done as it grows."""
    import rerun as rr

    if len(scene.planned):
        recording.log(
            "path/planned", rr.LineStrips3D([scene.planned * METRE], colors=PLANNED_COLOUR),
            static=True,
        )  # fmt: skip
    done = scene.done()
    if done:
        recording.log("path/done", rr.LineStrips3D.from_fields(colors=DONE_COLOUR), static=True)
        recording.send_columns(
            "path/done",
            [_times([stamp for stamp, _ in done])],
            rr.LineStrips3D.columns(strips=[points * METRE for _, points in done]),
        )


def _send_series(
    recording: Any, scene: Scene, groups: dict[str, dict[str, str]], columns: Columns
) -> None:
    """Send the columns as curves, carriages in their colours, setpoints thin and grey."""
    import rerun as rr

    for group, curves in groups.items():
        for name, column in curves.items():
            path = f"{group}/{name}"
            carriage = name[-1:] if name[-1:] in "123" else ""
            colour = CARRIAGE_COLOURS[int(carriage) - 1] if carriage else "#4d4d4d"
            thin = name.startswith("setpoint")
            style = rr.SeriesLines(
                names=name.replace("_", " "),
                colors=_channels("#9a9a9a" if thin else colour),
                widths=1.0 if thin else 1.8,
            )
            recording.log(path, style, static=True)
            values: FloatArray = np.asarray(columns[column], dtype=np.float64)
            known = np.isfinite(values)
            recording.send_columns(
                path, [_times(scene.stamps[known])], rr.Scalars.columns(scalars=values[known])
            )


def _send_events(recording: Any, log: Log) -> None:
    """Send what happened."""
    import rerun as rr

    events = [(log.anchor.stamp(t), event) for t, event in log.records(Topic.EVENT)]
    if events:
        recording.send_columns(
            "events",
            [_times([stamp for stamp, _ in events])],
            rr.TextLog.columns(
                text=[f"{event.kind.value}: {event.text}" for _, event in events],
                level=["ERROR" if event.code else "INFO" for _, event in events],
            ),
        )


def _views(groups: list[str]) -> Any:
    """Return the views: the mechanism at the left, series and events at the right."""
    import rerun.blueprint as rrb

    mechanism = rrb.Spatial3DView(
        origin="/",
        contents=["robot/**", "path/**"],
        name="Mechanism",
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=_EYE, look_target=_TARGET, eye_up=(0.0, 0.0, 1.0)),
    )
    curves = [rrb.TimeSeriesView(origin=group, name=_TITLES[group]) for group in groups]
    events = rrb.TextLogView(origin="events", name="Events")
    return rrb.Blueprint(
        rrb.Horizontal(mechanism, rrb.Vertical(*curves, events), column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _channels(colour: str) -> tuple[int, int, int]:
    """Return a colour of the form #rrggbb as its three channels."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue
