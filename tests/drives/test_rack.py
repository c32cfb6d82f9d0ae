from __future__ import annotations

import pytest

from duoglide.drives import pdo
from duoglide.drives.cia402 import Control
from duoglide.drives.rack import DriveRack
from duoglide.drives.simulated import build_rack
from duoglide.machine import DriveSettings

PERIOD = 2000  # [us]


@pytest.fixture
def rack() -> DriveRack:
    rack = build_rack(DriveSettings(), (0.0, 10.0, -20.0))
    rack.poll(0)
    rack.poll(PERIOD)
    for node in rack.nodes:
        node.objects.write(0x6060, 0, 8)
    rack.receive(pdo.NMT, pdo.pack_nmt(pdo.Nmt.START, 0), PERIOD)
    for word in (Control.SHUTDOWN, Control.SWITCH_ON, Control.ENABLE_OPERATION):
        for node in rack.nodes:
            node.objects.write(0x6040, 0, word)
    return rack


def cycle(rack: DriveRack, now: int, target: int) -> None:
    rack.receive(pdo.SYNC, b"", now)
    for node in rack.nodes:
        rack.receive(pdo.RPDO1 + node.node_id, pdo.pack_setpoint(15, target), now)


def demands(rack: DriveRack) -> list[float]:
    return [node.axis.servo_demand / 256 for node in rack.nodes]


def test_the_drives_start_where_their_carriages_stand(rack: DriveRack) -> None:
    assert [s.position for s in rack.snapshot()] == [0.0, 10.0, -20.0]


@pytest.mark.parametrize("shake", [0, 700, -700, 1900])
def test_shaken_syncs_do_not_show_in_the_motion(rack: DriveRack, shake: int) -> None:
    now = 10_000
    for k in range(100):
        late = shake if k % 2 else 0
        cycle(rack, now + k * PERIOD + late, 100 * k)
        rack.poll(now + k * PERIOD + late + 50)
        if k > 3:
            assert demands(rack) == [100.0 * (k - 2)] * 3


def test_a_burst_after_a_pause_is_taken_as_the_cycles_that_it_is(rack: DriveRack) -> None:
    for k in range(10):
        cycle(rack, 10_000 + k * PERIOD, 100 * k)
    for k in range(10, 20):  # the process was held up; its socket kept the frames
        cycle(rack, 50_000, 100 * k)
    assert demands(rack) == [100.0 * 17] * 3


def test_when_sync_stays_away_the_wall_clock_takes_over(rack: DriveRack) -> None:
    for node in rack.nodes:
        node.objects.write(0x1400, 5, 20)
        node.objects.write(0x6007, 0, 3)
        node.objects.write(0x605A, 0, 6)
    now = 10_000
    for k in range(10):
        cycle(rack, now + k * PERIOD, 100 * k)
    last = now + 9 * PERIOD
    stopped = None
    for late in range(0, 60_000, 500):
        rack.poll(last + late)
        states = {s.state.name for s in rack.snapshot()}
        if stopped is None and states == {"QUICK_STOP_ACTIVE"}:
            stopped = late
    assert stopped is not None
    assert 18_000 <= stopped <= 24_000
    assert all(s.velocity == pytest.approx(0.0, abs=1e-6) for s in rack.snapshot())


def test_drives_count_in_their_own_direction() -> None:
    settings = DriveSettings(direction=(1, -1, 1))
    rack = build_rack(settings, (0.0, 0.0, 0.0))
    rack.poll(0)
    for node in rack.nodes:
        node.plant.position = 3.0
    rack.poll(1000)
    assert [node.axis.actual for node in rack.nodes] == [3000, -3000, 3000]
