"""A plan or a run as a ROS 2 bag: joint states, the planned trajectory, transforms, the model."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import LogError
from duoglide.kinematics.export import to_urdf
from duoglide.planning.trajectory import Trajectory
from duoglide.playback.shown.scene import FOOT, Bodies, Scene, read_scene
from duoglide.storage import Log, Topic

if TYPE_CHECKING:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys.store import Typestore

METRE = 1e-3  # one millimetre
CARRIAGES = ["carriage_1", "carriage_2", "carriage_3"]
TRAJECTORY_POINTS = 10_000  # at most; a point a cycle where that is fewer
_TYPES = {
    "/robot_description": "std_msgs/msg/String",
    "/joint_trajectory": "trajectory_msgs/msg/JointTrajectory",
    "/joint_states": "sensor_msgs/msg/JointState",
    "/carriages/setpoint": "sensor_msgs/msg/JointState",
    "/carriages/actual": "sensor_msgs/msg/JointState",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/rosout": "rcl_interfaces/msg/Log",
}
_KEPT = ("/robot_description", "/joint_trajectory")
"""Topics of one message, which whoever subscribes later is given too."""


def write_ros2(log: Log, folder: str | Path) -> int:
    """Write a log as a bag of ROS 2 (MCAP, with its ``metadata.yaml``); needs the extra ``ros2``.

    In metres and radians, as ROS has them: ``/joint_states`` of the whole mechanism and ``/tf`` 60
    times a second, ``/carriages/setpoint`` and ``/carriages/actual`` each cycle, the plan as
    ``/joint_trajectory``, ``/robot_description`` as URDF, and events as ``/rosout``.

    Args:
        log: A plan or a run.
        folder: Where to write the bag; nothing must be there.

    Returns:
        How many messages it has.

    Raises:
        LogError: The log cannot be read, something is there already, or it cannot be written.
        ModuleNotFoundError: rosbags is not installed.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    scene = read_scene(log)
    if not len(scene.stamps):
        raise LogError(f"{log.path} has no cycle: there is nothing to write into a bag")
    with _appearing_folder(folder) as temporary:
        with Writer(temporary, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            bag = _Bag(writer, get_typestore(Stores.ROS2_JAZZY))
            bag.write_scene(scene)
            for t, event in log.records(Topic.EVENT):
                bag.write_event(log.anchor.stamp(t), event.text, event.kind.value, event.code != 0)
        return sum(writer.counts.values())


class _Bag:
    """A bag that is being written.

    Args:
        writer: Open.
        types: The messages of a ROS distribution.
    """

    def __init__(self, writer: Writer, types: Typestore) -> None:
        self._writer = writer
        self._types = types
        self._topics: dict[str, Any] = {}

    def write_scene(self, scene: Scene) -> None:
        """Write all but the events."""
        begin = int(scene.stamps[0])
        if scene.bodies is not None:
            urdf = to_urdf(scene.machine.geometry, scene.bodies.centre[0])
            self._write("/robot_description", begin, data=urdf)
            self._write_bodies(scene.bodies, scene.stamps[scene.bodies.rows].tolist())
        if scene.plan is not None:
            self._write_plan(begin, scene.plan)
        if scene.run is not None:
            stamps = scene.stamps.tolist()
            self._write_carriages("/carriages/setpoint", stamps, scene.run.setpoint_mm)
            self._write_carriages("/carriages/actual", stamps, scene.carriages)

    def write_event(self, stamp: int, text: str, kind: str, alarming: bool) -> None:
        """Write what happened."""
        level = 40 if alarming else 20
        self._write(
            "/rosout", stamp, stamp=self._time(stamp), level=level, name=f"duoglide.{kind}",
            msg=text, file="", function="", line=0,
        )  # fmt: skip

    def _write_bodies(self, bodies: Bodies, stamps: list[int]) -> None:
        names = list(bodies.values)
        scale = np.array([METRE if name in CARRIAGES else 1.0 for name in names])
        table = np.stack([bodies.values[name] for name in names], axis=1) * scale
        for frame, stamp in enumerate(stamps):
            self._write_joints("/joint_states", stamp, names, table[frame])
            transforms = [
                self._make(
                    "geometry_msgs/msg/TransformStamped",
                    header=self._header(stamp),
                    child_frame_id=name,
                    transform=self._transform(origin[frame], turn[frame]),
                )
                for name, (origin, turn) in bodies.poses.items()
            ]
            self._write("/tf", stamp, transforms=transforms)

    def _write_carriages(self, topic: str, stamps: list[int], millimetres: FloatArray) -> None:
        for stamp, row in zip(stamps, millimetres * METRE, strict=True):
            self._write_joints(topic, stamp, CARRIAGES, row)

    def _write_joints(
        self, topic: str, stamp: int, names: list[str], positions: FloatArray
    ) -> None:
        none = np.empty(0)
        self._write(
            topic, stamp, header=self._header(stamp), name=names, position=positions,
            velocity=none, effort=none,
        )  # fmt: skip

    def _write_plan(self, stamp: int, plan: Trajectory) -> None:
        """Write the planned trajectory of the carriages."""
        cycle = plan.machine.drives.cycle
        count = int(np.ceil(plan.duration / cycle)) + 1
        times = np.linspace(0.0, plan.duration, min(max(count, 2), TRAJECTORY_POINTS))
        state = plan.at(times)
        points = [
            self._make(
                "trajectory_msgs/msg/JointTrajectoryPoint",
                positions=place,
                velocities=velocity,
                accelerations=acceleration,
                effort=np.empty(0),
                time_from_start=self._duration(t),
            )
            for t, place, velocity, acceleration in zip(
                times.tolist(),
                state.carriages * METRE,
                state.velocity * METRE,
                state.acceleration * METRE,
                strict=True,
            )
        ]
        self._write(
            "/joint_trajectory", stamp, header=self._header(stamp), joint_names=CARRIAGES,
            points=points,
        )  # fmt: skip

    def _write(self, topic: str, stamp: int, /, **fields: Any) -> None:
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(
                topic,
                _TYPES[topic],
                typestore=self._types,
                offered_qos_profiles=[_quality(topic in _KEPT)],
            )
        message = self._make(_TYPES[topic], **fields)
        content = self._types.serialize_cdr(message, _TYPES[topic])
        self._writer.write(self._topics[topic], stamp, content)

    def _make(self, kind: str, **fields: Any) -> Any:
        return self._types.types[kind](**fields)

    def _time(self, stamp: int) -> Any:
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        return self._make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)

    def _duration(self, t: float) -> Any:
        seconds, nanoseconds = divmod(round(t * 1e9), 1_000_000_000)
        return self._make("builtin_interfaces/msg/Duration", sec=seconds, nanosec=nanoseconds)

    def _header(self, stamp: int) -> Any:
        return self._make("std_msgs/msg/Header", stamp=self._time(stamp), frame_id=FOOT)

    def _transform(self, origin: FloatArray, turn: FloatArray) -> Any:
        place = dict(zip("xyz", (origin * METRE).tolist(), strict=True))
        quaternion = dict(zip("xyzw", turn.tolist(), strict=True))
        return self._make(
            "geometry_msgs/msg/Transform",
            translation=self._make("geometry_msgs/msg/Vector3", **place),
            rotation=self._make("geometry_msgs/msg/Quaternion", **quaternion),
        )


def _quality(kept: bool) -> Any:
    """Return how a topic is played: reliably, and whether later subscribers are given it too."""
    from rosbags.interfaces import (
        Qos,
        QosDurability,
        QosHistory,
        QosLiveliness,
        QosReliability,
        QosTime,
    )

    never = QosTime(0, 0)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if kept else 100,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if kept else QosDurability.VOLATILE,
        deadline=never,
        lifespan=never,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )


@contextmanager
def _appearing_folder(folder: str | Path) -> Iterator[Path]:
    """Give the path of a folder to make, and put it in the place of ``folder`` when it is whole.

    Raises:
        LogError: Something is there already, or it cannot be written.
    """
    goal = Path(folder)
    if goal.exists() or goal.is_symlink():
        raise LogError(f"cannot write {folder}: it is there already; take another name for the bag")
    aside = goal.with_name(f".{goal.name}.{os.getpid()}.part")
    try:
        aside.mkdir()
        yield aside / goal.name  # the files of a bag are named after its folder
        (aside / goal.name).replace(goal)
    except OSError as error:
        raise LogError(f"cannot write {folder}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(aside, ignore_errors=True)
