from __future__ import annotations

import pytest

from duoglide.drives import pdo
from duoglide.drives.cia402 import Control
from duoglide.drives.simulation.firmware.objects import RefusalError
from duoglide.drives.simulation.rack import DriveRack, build_rack
from duoglide.drives.standstill import INDEX, seconds_in
from duoglide.machine import DriveSettings

PERIOD = 2000  # [us]


@pytest.fixture
def rack() -> DriveRack:
    rack = build_rack(DriveSettings(), (0.0, 10.0, -20.0))
    switch_on(rack)
    return rack


def switch_on(rack: DriveRack) -> None:
    rack.poll(0)
    rack.poll(PERIOD)
    for node in rack.nodes:
        node.objects.write(0x6060, 0, 8)
    rack.receive(pdo.NMT, pdo.pack_nmt(pdo.Nmt.START, 0), PERIOD)
    for word in (Control.SHUTDOWN, Control.SWITCH_ON, Control.ENABLE_OPERATION):
        for node in rack.nodes:
            node.objects.write(0x6040, 0, word)


def cycle(rack: DriveRack, now: int, target: int, behind: int = 0) -> None:
    rack.receive(pdo.SYNC, b"", now, behind)
    for node in rack.nodes:
        rack.receive(pdo.RPDO1 + node.node_id, pdo.SETPOINT.pack(15, target), now)


def watch_the_host(rack: DriveRack) -> None:
    for node in rack.nodes:
        node.objects.write(0x1400, 5, 20)
        node.objects.write(0x6007, 0, 3)
        node.objects.write(0x605A, 0, 6)


def demands(rack: DriveRack) -> list[float]:
    return [node.axis.servo_demand / 256 for node in rack.nodes]


def test_the_drives_start_where_their_carriages_stand(rack: DriveRack) -> None:
    assert [s.position for s in rack.snapshot()] == [0.0, 10.0, -20.0]


@pytest.mark.parametrize("shake", [0, 700, -700, 1500])
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
        cycle(rack, 48_000, 100 * k, behind=19 - k)
    assert demands(rack) == [100.0 * 17] * 3


def test_a_sync_that_the_host_has_left_out_is_a_period_that_has_passed(rack: DriveRack) -> None:
    """The setpoints go on with the schedule, and so do the drives, by one period on their own."""
    for k in range(10):
        cycle(rack, 10_000 + k * PERIOD, 100 * k)
    for k in range(11, 16):  # the tenth is left out
        cycle(rack, 10_000 + k * PERIOD, 100 * k)
        assert demands(rack)[0] == pytest.approx(100.0 * (k - 2), abs=101.0)
    assert demands(rack) == [100.0 * 13] * 3


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


@pytest.fixture
def patient() -> DriveRack:
    """Return drives that stand still with their host for up to 0.1 s, in the middle of a run."""
    rack = build_rack(DriveSettings(), (0.0, 10.0, -20.0), standstill=0.1)
    switch_on(rack)
    assert seconds_in(rack.nodes[1].objects.upload(INDEX, 0)) == 0.1
    watch_the_host(rack)
    for k in range(10):
        cycle(rack, 10_000 + k * PERIOD, 100 * k)
    return rack


def test_while_the_computer_stands_still_no_time_passes_for_the_drives(patient: DriveRack) -> None:
    last = 10_000 + 9 * PERIOD
    patient.poll(last + 90_000)
    for k in range(10, 15):
        cycle(patient, last + 90_000 + (k - 10) * PERIOD, 100 * k)
    assert demands(patient) == [100.0 * 12] * 3


@pytest.mark.parametrize("gone", [False, True])
def test_a_host_that_stays_away_or_is_gone_is_missed(patient: DriveRack, gone: bool) -> None:
    last = 10_000 + 9 * PERIOD
    if gone:
        patient.abandon()
    patient.poll(last + (30_000 if gone else 101_000))
    assert {s.state.name for s in patient.snapshot()} == {"QUICK_STOP_ACTIVE"}


@pytest.mark.parametrize("anew", [False, True])
def test_the_promise_outlives_a_long_silence_but_not_another_bring_up(anew: bool) -> None:
    rack = build_rack(DriveSettings(), (0.0, 10.0, -20.0), standstill=0.1)
    rack.poll(0)
    rack.poll(PERIOD)
    rack.nodes[0].objects.upload(INDEX, 0)
    rack.receive(pdo.SYNC, b"", 10_000)
    rack.poll(400_000)
    if anew:
        rack.receive(pdo.NMT, pdo.pack_nmt(pdo.Nmt.ENTER_PRE_OPERATIONAL, 1), 400_000)
    assert rack.nodes[2]._standstill.agreed is not anew


def test_a_host_that_does_not_ask_is_missed_at_once() -> None:
    rack = build_rack(DriveSettings(), (0.0, 10.0, -20.0), standstill=0.1)
    switch_on(rack)
    watch_the_host(rack)
    for k in range(10):
        cycle(rack, 10_000 + k * PERIOD, 100 * k)
    rack.poll(10_000 + 9 * PERIOD + 30_000)
    assert {s.state.name for s in rack.snapshot()} == {"QUICK_STOP_ACTIVE"}


def test_drives_that_never_stand_still_do_not_have_the_object() -> None:
    never = build_rack(DriveSettings(), (0.0, 10.0, -20.0), standstill=0.0)
    with pytest.raises(RefusalError):
        never.nodes[0].objects.upload(INDEX, 0)


@pytest.mark.parametrize("data", [b"", b"\x64", b"\x64\0\0\0", b"\xff\xff\xff\xff", bytes(8)])
def test_what_another_manufacturer_keeps_there_is_no_standstill(data: bytes) -> None:
    assert seconds_in(data) == 0.0


def test_drives_count_in_their_own_direction() -> None:
    settings = DriveSettings(direction=(1, -1, 1))
    rack = build_rack(settings, (0.0, 0.0, 0.0))
    rack.poll(0)
    for node in rack.nodes:
        node.plant.position = 3.0
    rack.poll(1000)
    assert [node.axis.actual for node in rack.nodes] == [3000, -3000, 3000]


def test_without_its_host_a_carriage_brakes_after_one_bridged_cycle(rack: DriveRack) -> None:
    """The distance that brake-safe plans count on: one cycle at speed, then 0x6085."""
    for node in rack.nodes:
        node.objects.write(0x6065, 0, 0xFFFFFFFF)
    speed, deceleration = 1000.0, 60e3  # mm/s, mm/s^2
    now, cycles = 10_000, 100
    for k in range(cycles):
        cycle(rack, now + k * PERIOD, round(k * speed * PERIOD * 1e-3))
    last = now + (cycles - 1) * PERIOD
    latched = (cycles - 2) * speed * PERIOD * 1e-6  # the setpoint in force when the host dies
    for late in range(0, 100_000, 1000):
        rack.poll(last + late)
    expected = latched + speed * PERIOD * 1e-6 + speed**2 / (2.0 * deceleration)
    for snapshot, start in zip(rack.snapshot(), (0.0, 10.0, -20.0), strict=True):
        assert snapshot.position - start == pytest.approx(expected, abs=0.05)


def test_a_jammed_carriage_is_a_fault_within_window_and_time(rack: DriveRack) -> None:
    sent: list[tuple[int, bytes]] = []
    rack.attach(lambda can_id, data: sent.append((can_id, data)))
    rack.nodes[1].plant.jammed = True
    for k in range(60):  # 1 m/s: beyond 5 mm after 3 cycles, for longer than 10 ms 5 cycles later
        cycle(rack, 10_000 + k * PERIOD, 2000 * k)
        emergencies = [f for f in sent if f[0] == pdo.EMCY + 2]
        if emergencies:
            break
    assert pdo.unpack_emergency(emergencies[0][1]).code == 0x8611
    assert 8 <= k <= 12
    others = [f for f in sent if f[0] in (pdo.EMCY + 1, pdo.EMCY + 3)]
    assert others == []
