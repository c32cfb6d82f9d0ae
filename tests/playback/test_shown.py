"""Exports for programs that show robots, read by readers of others."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import jsonschema
import numpy as np
import pytest
from google.protobuf import json_format
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rerun.chunk import RrdReader
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

import duoglide as dg
from duoglide.kinematics.skeleton import joints
from duoglide.playback.run_data import read_run
from duoglide.playback.shown.foxglove import GROUPS, write_foxglove
from duoglide.playback.shown.foxglove_layout import write_layout
from duoglide.playback.shown.foxglove_schemas import SCHEMAS
from duoglide.playback.shown.rerun_file import write_rerun
from duoglide.playback.shown.ros2 import write_ros2
from duoglide.playback.shown.scene import read_scene
from duoglide.storage import Phase, Topic, read_log

Pace = Sequence[tuple[float, float, Phase]]


def read_messages(file: Path) -> dict[str, list[tuple[int, Any]]]:
    """Return topic to the stamps and contents of its messages."""
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            found[channel.topic].append((message.log_time, json.loads(message.data)))
    return found


@pytest.fixture
def exported(run_log: Path, tmp_path: Path) -> Path:
    file = tmp_path / "fox.mcap"
    write_foxglove(read_log(run_log), file)
    return file


def as_protobuf_writes_it(content: Any) -> Any:
    """Return a message with times and durations as Protobuf has them in JSON."""
    if isinstance(content, list):
        return [as_protobuf_writes_it(item) for item in content]
    if not isinstance(content, dict):
        return content
    if set(content) == {"sec", "nsec"}:
        if content == {"sec": 0, "nsec": 0}:  # a duration: no message of a run is from 1970
            return "0s"
        whole = datetime.fromtimestamp(content["sec"], UTC).strftime("%Y-%m-%dT%H:%M:%S")
        return f"{whole}.{content['nsec']:09d}Z"
    return {key: as_protobuf_writes_it(item) for key, item in content.items()}


def test_foxgloves_own_definitions_take_every_message(exported: Path) -> None:
    seen: Counter[str] = Counter()
    with exported.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages():
            if not schema.name.startswith("foxglove."):
                continue
            seen[schema.name] += 1
            if seen[schema.name] > 8:
                continue
            name = schema.name.removeprefix("foxglove.")
            content = json.loads(message.data)
            module = import_module(f"foxglove_schemas_protobuf.{name}_pb2")
            parsed = json_format.ParseDict(
                as_protobuf_writes_it(content), getattr(module, name)()
            )  # refuses a field that it does not know, and a value of another kind
            assert parsed.ByteSize() > 0
            jsonschema.validate(content, json.loads(schema.data))
    assert set(seen) == set(SCHEMAS)


def test_messages_are_in_order_of_time(exported: Path) -> None:
    with exported.open("rb") as stream:
        stamps = [m.log_time for _, _, m in make_reader(stream).iter_messages(log_time_order=False)]
    assert stamps == sorted(stamps)


def test_bars_drawn_in_their_frames_meet_at_the_joints(
    exported: Path, trajectory: dg.Trajectory
) -> None:
    messages = read_messages(exported)
    ((_, scene),) = messages["/mechanism"]
    bars = {entity["id"]: entity["cylinders"] for entity in scene["entities"]}
    geometry = trajectory.machine.geometry
    poses = dict(messages["/pose"])
    frames = messages["/tf"]
    assert len(frames) > 20
    for stamp, content in frames[:: len(frames) // 5]:
        centre = 1e3 * np.array([poses[stamp]["pose"]["position"][k] for k in "xyz"])
        at = joints(geometry, centre)
        transforms = {item["child_frame_id"]: item for item in content["transforms"]}
        for name, number in (("leg_1", 1), ("leg_2", 2)):
            found = ends_of(bars[name][0], transforms[name])
            assert found == pytest.approx(np.array([at[f"B{number}"], at[f"C{number}"]]), abs=1e-4)
        middle = [ends_of(bars[f"strut_{side}"][0], transforms[f"strut_{side}"]) for side in SIDES]
        assert np.mean(middle, axis=0) == pytest.approx(np.array([at["B3"], at["C3"]]), abs=1e-4)


SIDES = ("near", "far")


def ends_of(cylinder: dict[str, Any], transform: dict[str, Any]) -> np.ndarray:
    """Return where the ends of a cylinder of a body are in the base frame [mm]."""

    def placed(pose: dict[str, Any], point: np.ndarray, where: str, how: str) -> np.ndarray:
        turn = Rotation.from_quat([pose[how][k] for k in "xyzw"])
        return np.array([pose[where][k] for k in "xyz"]) + turn.apply(point)

    half = cylinder["size"]["z"] / 2.0
    local = placed(
        cylinder["pose"],
        np.array([[0.0, 0.0, -half], [0.0, 0.0, half]]),
        "position",
        "orientation",
    )
    return 1e3 * placed(transform, local, "translation", "rotation")


def test_the_path_planned_and_the_path_done_are_drawn(
    exported: Path, trajectory: dg.Trajectory
) -> None:
    messages = read_messages(exported)
    ((_, planned),) = messages["/path_planned"]
    points = points_of(planned)
    assert points[[0, -1]] == pytest.approx(trajectory.position_at([0.0, trajectory.duration]))
    done = messages["/path_done"]
    lengths = [len(points_of(content)) for _, content in done]
    assert lengths == sorted(lengths)
    assert points_of(done[-1][1])[-1] == pytest.approx(
        trajectory.position_at(trajectory.duration), abs=0.2
    )


def points_of(update: dict[str, Any]) -> np.ndarray:
    ((entity,),) = (update["entities"],)
    return 1e3 * np.array([[p[k] for k in "xyz"] for p in entity["lines"][0]["points"]])


def test_joint_states_read_what_the_carriages_read(exported: Path, run_log: Path) -> None:
    data = read_run(read_log(run_log))
    scene = read_scene(read_log(run_log))
    assert scene.bodies is not None
    states = [content for _, content in read_messages(exported)["/joint_states"]]
    assert len(states) == len(scene.bodies.rows)
    for state, row in zip(states, scene.bodies.rows.tolist(), strict=True):
        read = [1e3 * joint["position"] for joint in state["joints"][:3]]
        assert read == pytest.approx(data.actual_mm[row].tolist(), abs=1e-5)


def test_a_plan_shows_its_mechanism_too(trajectory: dg.Trajectory, tmp_path: Path) -> None:
    trajectory.save(tmp_path / "plan.mcap")
    write_foxglove(read_log(tmp_path / "plan.mcap"), tmp_path / "fox.mcap")
    topics = set(read_messages(tmp_path / "fox.mcap"))
    assert topics == {Topic.MOTION, "/mechanism", "/tf", "/joint_states", "/path_planned"}


def test_a_run_whose_links_never_closed_has_its_series(
    write_run: Callable[[Pace], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = read_log(write_run([(0.0, 0.0, Phase.HOLD)] * 3))
    nowhere = lambda geometry, carriages: np.full(carriages.shape, np.nan)  # noqa: E731
    monkeypatch.setattr("duoglide.playback.shown.scene.platform", nowhere)
    assert read_scene(log).bodies is None
    write_foxglove(log, tmp_path / "fox.mcap")
    topics = read_messages(tmp_path / "fox.mcap")
    assert set(GROUPS) <= set(topics)
    assert "/tf" not in topics


def panels_of(split: Any) -> list[str]:
    """Return the names of the panels in a tree of splits."""
    if isinstance(split, str):
        return [split]
    return panels_of(split["first"]) + panels_of(split["second"])


def test_the_layout_shows_topics_and_fields_of_the_export(exported: Path, tmp_path: Path) -> None:
    messages = read_messages(exported)
    count = write_layout(tmp_path / "layout.json")
    layout = json.loads((tmp_path / "layout.json").read_text("utf-8"))
    panels = layout["configById"]
    assert count == len(panels)
    assert sorted(panels_of(layout["layout"])) == sorted(panels)
    shown = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(shown) == 14
    for path in shown:
        topic, field = path.split(".")
        assert field in messages[topic][0][1], path
    assert set(panels["3D!mechanism"]["topics"]) <= set(messages)


def test_a_reader_of_ros_finds_the_run_in_its_bag(
    run_log: Path, trajectory: dg.Trajectory, tmp_path: Path
) -> None:
    log = read_log(run_log)
    count = write_ros2(log, tmp_path / "bag")
    assert [path.name for path in sorted((tmp_path / "bag").iterdir())] == [
        "bag.mcap",
        "metadata.yaml",
    ]
    found: dict[str, list[tuple[int, Any]]] = defaultdict(list)
    with (tmp_path / "bag" / "bag.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for _, channel, message, content in reader.iter_decoded_messages():
            assert channel.message_encoding == "cdr"
            found[channel.topic].append((message.log_time, content))
    assert sum(map(len, found.values())) == count
    data, scene = read_run(log), read_scene(log)
    for topic, expected in (("setpoint", data.setpoint_mm), ("actual", data.actual_mm)):
        rows = found[f"/carriages/{topic}"]
        assert [stamp for stamp, _ in rows] == scene.stamps.tolist()
        assert 1e3 * np.array([state.position for _, state in rows]) == pytest.approx(expected)
    assert rows[0][1].name == ["carriage_1", "carriage_2", "carriage_3"]
    ((_, plan),) = found["/joint_trajectory"]
    assert 1e3 * np.array(plan.points[-1].positions) == pytest.approx(trajectory.end)
    last = plan.points[-1].time_from_start
    assert last.sec + 1e-9 * last.nanosec == pytest.approx(trajectory.duration, abs=1e-8)
    middle = plan.points[len(plan.points) // 2]
    t = middle.time_from_start.sec + 1e-9 * middle.time_from_start.nanosec
    assert 1e3 * np.array(middle.velocities) == pytest.approx(trajectory.at(t).velocity, abs=1e-3)
    links = {
        link.attrib["name"] for link in Xml.fromstring(found["/robot_description"][0][1].data)
        if link.tag == "link"
    }  # fmt: skip
    stamp, tf = found["/tf"][-1]
    assert {item.child_frame_id for item in tf.transforms} | {"base"} == links
    foot = next(item.transform for item in tf.transforms if item.child_frame_id == "carriage_3")
    assert 1e3 * foot.translation.y == pytest.approx(scene.carriages[-1, 2])
    assert found["/joint_states"][-1][0] == stamp
    assert [content.msg for _, content in found["/rosout"]] == ["program started", "oh"]
    assert [content.level for _, content in found["/rosout"]] == [20, 40]


def test_a_bag_takes_the_place_of_nothing(run_log: Path, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(dg.LogError, match="is there already"):
        write_ros2(read_log(run_log), tmp_path / "bag")
    with pytest.raises(dg.LogError, match="cannot write"):
        write_ros2(read_log(run_log), tmp_path / "none" / "bag")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "run.mcap"]


def test_what_is_played_keeps_the_model_for_those_who_come_later(
    run_log: Path, tmp_path: Path
) -> None:
    write_ros2(read_log(run_log), tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as reader:
        kept = {
            connection.topic
            for connection in reader.connections
            if connection.ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"
        }
    assert kept == {"/robot_description", "/joint_trajectory"}


def test_reruns_own_reader_finds_the_run(
    run_log: Path, trajectory: dg.Trajectory, tmp_path: Path
) -> None:
    log = read_log(run_log)
    data, scene = read_run(log), read_scene(log)
    assert scene.bodies is not None
    assert write_rerun(log, tmp_path / "run.rrd") == len(data)
    reader = RrdReader(tmp_path / "run.rrd")
    assert len(reader.blueprints()) == len(reader.recordings()) == 1
    chunks = list(reader.stream().to_chunks())
    moving = {chunk.entity_path: chunk.to_record_batch() for chunk in chunks if not chunk.is_static}
    assert set(moving) == {
        "/events",
        "/path/done",
        "/clearance/clearance",
        "/lateness/lateness",
        *(f"/{group}/carriage_{n}" for group in ("following_error", "robot") for n in (1, 2, 3)),
        *(f"/carriages/{name}_{n}" for name in ("setpoint", "actual") for n in (1, 2, 3)),
        *(f"/robot/{body.name}" for body in scene.bodies.tree.bodies),
    }
    rows = moving["/carriages/actual_2"]
    assert rows.column("Scalars:scalars").flatten().to_pylist() == data.actual_mm[:, 1].tolist()
    stamps = rows.column("time").cast("int64").to_pylist()
    assert stamps == scene.stamps.tolist()
    foot = np.array(moving["/robot/carriage_3"].column("Transform3D:translation").to_pylist())
    assert 1e3 * foot[:, 0, 1] == pytest.approx(scene.carriages[scene.bodies.rows, 2], abs=1e-3)
    known = np.isfinite(data.following_error[:, 0]).sum()
    assert moving["/following_error/carriage_1"].num_rows == known < len(data)
    static = {chunk.entity_path: chunk.to_record_batch() for chunk in chunks if chunk.is_static}
    (line,) = static["/path/planned"].column("LineStrips3D:strips").to_pylist()[0]
    assert 1e3 * np.array(line[-1]) == pytest.approx(
        trajectory.position_at(trajectory.duration), abs=1e-3
    )


def test_a_plan_is_shown_by_rerun_and_written_for_ros(
    trajectory: dg.Trajectory, tmp_path: Path
) -> None:
    trajectory.save(tmp_path / "plan.mcap")
    log = read_log(tmp_path / "plan.mcap")
    assert write_rerun(log, tmp_path / "plan.rrd") > 20
    paths = {chunk.entity_path for chunk in RrdReader(tmp_path / "plan.rrd").stream().to_chunks()}
    assert {"/velocity/carriage_1", "/robot/platform", "/path/planned"} <= paths
    write_ros2(log, tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as reader:
        topics = {connection.topic for connection in reader.connections}
    assert topics == {"/robot_description", "/joint_states", "/tf", "/joint_trajectory"}
