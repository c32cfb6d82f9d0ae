"""The C reference axis as three drives on a hub, brought up and streamed to by the real host."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from math import cos, pi

import canopen
import pytest
from drive_power import disable, enable, reset_fault

from duoglide.drives import pdo
from duoglide.drives.axis.axis import Axis
from duoglide.drives.bus.buses import frame_sender, open_bus
from duoglide.drives.cia402 import State
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.hub import Hub
from duoglide.drives.simulation.node.application import AxisApplication
from duoglide.drives.simulation.rack import DriveRack, build_rack
from duoglide.machine import DriveSettings

SETTINGS = DriveSettings(setpoint_timeout=1.0)  # the machine that tests may be busy
POSITIONS = (-50.0, 0.0, 80.0)


@pytest.fixture
def rack(make_c_axis: Callable[[], AxisApplication]) -> DriveRack:
    return build_rack(SETTINGS, POSITIONS, make_axis=make_c_axis)


@pytest.fixture
def network(rack: DriveRack) -> Iterator[canopen.Network]:
    done = threading.Event()
    with Hub(rack) as hub:

        def turn() -> None:
            while not done.is_set():
                hub.turn()

        thread = threading.Thread(target=turn)
        thread.start()
        network = canopen.Network(open_bus(hub.address))
        network.NOTIFIER_CYCLE = 0.02
        network.connect()
        try:
            yield network
        finally:
            network.disconnect()
            done.set()
            thread.join()


def stream(network: canopen.Network, axes: list[Axis], cycles: int) -> list[list[int]]:
    """Stream half a cosine; return the feedback of each axis, one list a SYNC."""
    feedback: list[list[int]] = [[], [], []]
    for axis, heard in zip(axes, feedback, strict=True):

        def note(can_id: int, data: bytearray, stamp: float, heard: list[int] = heard) -> None:
            heard.append(pdo.unpack_feedback(data).actual)

        network.subscribe(pdo.TPDO1 + axis.node_id, note)
    send = frame_sender(network.bus)
    start = time.monotonic()
    for k in range(cycles):
        move = 10.0 * (1.0 - cos(pi * k / cycles))
        frames = [(pdo.SYNC, b"")]
        for axis, position in zip(axes, POSITIONS, strict=True):
            target = axis.scale.to_increments(position + move)
            frames.append((pdo.RPDO1 + axis.node_id, pdo.SETPOINT.pack(0xF, target)))
        send(frames)
        time.sleep(max(0.0, start + SETTINGS.cycle * (k + 1) - time.monotonic()))
    deadline = time.monotonic() + 60.0  # three threads share one interpreter
    while min(map(len, feedback)) < cycles and time.monotonic() < deadline:
        time.sleep(0.01)
    return feedback


def test_the_c_axis_is_brought_up_streams_and_faults_as_a_drive(
    network: canopen.Network, rack: DriveRack
) -> None:
    axes = [Axis(network, SETTINGS, number) for number in (1, 2, 3)]
    for axis, position in zip(axes, POSITIONS, strict=True):
        axis.wait_for_boot()
        axis.configure((-360.0, 360.0))
        axis.command(pdo.Nmt.START)
        enable(axis)
        axis.start_homing(position)
        assert axis.homing_done()
        axis.end_homing(position)

    feedback = stream(network, axes, 400)
    for heard, position, snapshot in zip(feedback, POSITIONS, rack.snapshot(), strict=True):
        assert len(heard) == 400
        assert snapshot.position == pytest.approx(position + 20.0, abs=0.1)
        wanted = [position + 10.0 * (1.0 - cos(pi * (k - 2) / 400)) for k in range(2, 400)]
        errors = sorted(abs(a / 1000.0 - w) for a, w in zip(heard[2:], wanted, strict=True))
        assert errors[len(errors) // 2] < 0.1

    faults.DeviceFault(2).apply(rack.nodes[1])
    assert axes[1].read_state() in (State.FAULT_REACTION_ACTIVE, State.FAULT)
    reset_fault(axes[1])
    enable(axes[1])
    for axis in axes:
        disable(axis)
        axis.close()
