"""What an independent listener hears of a run: python-can's own client, on the hub's address.

It also says what others say on a real bus; nobody may mind.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import can
import numpy as np
import pytest

import duoglide as dg
from duoglide.drives import pdo

DEFAULT = dg.Machine.default()
MACHINE = replace(  # a busy computer must not be what stops this run
    DEFAULT,
    limits=DEFAULT.limits.scaled(0.3),
    drives=replace(
        DEFAULT.drives,
        setpoint_timeout=0.25,
        heartbeat_timeout=1.0,
        late_cycles=120,
        following_error_window=30.0,
        following_error_time=0.05,
        direction=(1, -1, 1),
        increments_per_mm=(1000.0, 500.0, 1024.0),
    ),
)
NODES = MACHINE.drives.node_ids
SETPOINTS = [pdo.RPDO1 + node for node in NODES]
ANSWERS = [pdo.TPDO1 + node for node in NODES]
BEATS = 25  # cycles: 50 ms of 2 ms
STRANGERS = [
    can.Message(arbitration_id=can_id, data=data, is_extended_id=extended)
    for can_id, data, extended in [
        (pdo.HEARTBEAT + 40, b"\0", False),  # another node boots, and is in fault
        (pdo.EMCY + 40, pdo.pack_emergency(0x2310, 3), False),
        (pdo.TPDO1 + 40, bytes(8), False),
        (pdo.SYNC, b"", True),
        (pdo.NMT, bytes((pdo.Nmt.STOP, 0)), True),
        (pdo.EMCY + NODES[0], pdo.pack_emergency(0x2310, 3), True),
        (pdo.RPDO1 + NODES[1], pdo.SETPOINT.pack(0, 0), True),  # power off
        (pdo.TPDO1 + NODES[2], pdo.FEEDBACK.pack(0x08, 0), True),  # fault
    ]
]


@dataclass(frozen=True)
class Recording:
    """The frames of a run, in their order."""

    frames: list[can.Message]
    report: dg.RunReport
    trajectory: dg.Trajectory

    @cached_property
    def cycles(self) -> list[list[can.Message]]:
        """The frames from each SYNC to the next while setpoints changed, and a little around."""
        starts = [i for i, m in enumerate(self.frames) if m.arbitration_id == pdo.SYNC]
        whole = [self.frames[a:b] for a, b in pairwise(starts)]
        targets = [[m.data[2:] for m in cycle if m.arbitration_id in SETPOINTS] for cycle in whole]
        moving = [k for k in range(1, len(whole)) if targets[k] != targets[k - 1]]
        return whole[moving[0] - 1 : moving[-1] + 2]

    @cached_property
    def targets(self) -> list[tuple[int, ...]]:
        """The setpoints of each cycle [increments]."""
        unpack = pdo.SETPOINT.unpack
        return [
            tuple(unpack(m.data)[1] for m in cycle if m.arbitration_id in SETPOINTS)
            for cycle in self.cycles
        ]


@contextmanager
def listening(bus: str) -> Iterator[list[can.Message]]:
    """Collect all frames of a bus, and now and then say something else."""
    _, host, port = bus.split(":")
    heard: list[can.Message] = []
    done = threading.Event()

    def listen(client: can.BusABC) -> None:
        while not done.is_set():
            message = client.recv(0.05)
            if message is not None:
                heard.append(message)
            if len(heard) % 50 == 1:
                for stranger in STRANGERS:
                    client.send(stranger)

    with can.Bus(interface="socketcand", host=host, port=int(port), channel="can0") as client:
        thread = threading.Thread(target=listen, args=(client,))
        thread.start()
        try:
            yield heard
        finally:
            done.set()
            thread.join()


@pytest.fixture(scope="module")
def recording() -> Recording:
    trajectory = dg.transfer(MACHINE, (-41.0, 0.0, 302.0), (-41.0, 60.0, 310.0))
    with dg.Robot.connect(MACHINE) as robot:
        robot.enable()
        robot.home()
        with listening(robot.bus) as frames:
            report = robot.run(trajectory)
            robot.disable()  # orders by SDO come after all that was said before
    return Recording(frames, report, trajectory)


def test_every_cycle_is_sync_then_answers_then_one_setpoint_for_each_drive(
    recording: Recording,
) -> None:
    beats = {pdo.HEARTBEAT + node for node in (*NODES, MACHINE.drives.host_id)}
    assert len(recording.cycles) > 50
    for cycle in recording.cycles:
        said = [m.arbitration_id for m in cycle if m.arbitration_id not in beats]
        assert said == [pdo.SYNC, *ANSWERS, *SETPOINTS]
        assert not any(m.is_extended_id or m.is_remote_frame for m in cycle)
        assert [m.dlc for m in cycle if m.arbitration_id == pdo.SYNC] == [0]


def test_setpoints_are_the_trajectory_in_increments_none_missing_and_in_order(
    recording: Recording,
) -> None:
    drives = MACHINE.drives
    scale = np.array(drives.direction) * np.array(drives.increments_per_mm)
    _, states = recording.trajectory.sample(drives.cycle)
    wanted = np.rint(states.carriages * scale).astype(int).tolist()
    expected, sent = distinct(map(tuple, wanted)), distinct(recording.targets)
    left = iter(expected)
    assert all(row in left for row in sent), "a setpoint is wrong, or out of order"
    assert len(expected) - len(sent) <= recording.report.skipped


def test_heartbeats_come_at_their_period(recording: Recording) -> None:
    for node in (*NODES, MACHINE.drives.host_id):
        beats = [
            k
            for k, cycle in enumerate(recording.cycles)
            for m in cycle
            if m.arbitration_id == pdo.HEARTBEAT + node
        ]
        gaps = [b - a for a, b in pairwise(beats)]
        assert gaps
        assert BEATS - 2 - recording.report.skipped <= min(gaps)
        assert max(gaps) <= BEATS + 2


def test_drives_follow_what_was_sent_two_cycles_before(recording: Recording) -> None:
    unpack = pdo.FEEDBACK.unpack
    answers = [
        [unpack(m.data) for m in cycle if m.arbitration_id in ANSWERS] for cycle in recording.cycles
    ]
    assert {word & 0x6F for row in answers for word, _ in row} == {0x27}  # enabled
    actual = np.array([[position for _, position in row] for row in answers])
    lag = np.abs(actual[2:] - np.array(recording.targets)[:-2])
    assert np.median(lag / np.array(MACHINE.drives.increments_per_mm)) < 0.5


def distinct(rows: Iterable[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Leave out rows that repeat the one before: the machine stands there."""
    kept: list[tuple[int, ...]] = []
    for row in rows:
        if not kept or kept[-1] != row:
            kept.append(row)
    return kept
