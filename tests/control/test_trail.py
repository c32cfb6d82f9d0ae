"""Every setpoint is accounted for: faults of single frames against drives with plants."""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct

import numpy as np
import pytest
from cell_by_hand import CellByHand, Frame, Spoil
from straight import Straight

import duoglide as dg
from duoglide.control.channel.events import Condition, Happening
from duoglide.control.channel.orders import Power
from duoglide.control.host.run.conduct import ConductTally
from duoglide.drives.simulation.plant import PlantParameters

WORDS = Struct("<Hi")
START = np.array([-250.0, 100.0, -150.0])
FOR_GOOD = 10**9


@pytest.fixture
def cell(machine: dg.Machine) -> CellByHand:
    return begun(CellByHand(machine, START))


def begun(cell: CellByHand) -> CellByHand:
    """Return the cell in the middle of a quick move, where it begins to slow down."""
    cell.enable()
    cell.run(Straight(cell.machine, START, length=250.0, duration=0.25))  # 2 m/s, 25 m/s^2
    cell.cycles(70)
    return cell


def only(identifier: int, change: Spoil) -> Spoil:
    return lambda frame: change(frame) if frame[0] == identifier else [frame]


def lose(count: int) -> Spoil:
    left = [count]

    def change(frame: Frame) -> list[Frame]:
        left[0] -= 1
        return [frame] if left[0] < 0 else []

    return change


def hold(cycles: int) -> Spoil:
    waiting: list[Frame] = []

    def change(frame: Frame) -> list[Frame]:
        waiting.append(frame)
        return [waiting.pop(0)] if len(waiting) > cycles else []

    return change


def move(by: Callable[[int], int], count: int = FOR_GOOD) -> Spoil:
    """Change positions; ``by`` is told how many frames there were before."""
    seen = [0]

    def change(frame: Frame) -> list[Frame]:
        word, place = WORDS.unpack(frame[1])
        shift = by(seen[0]) if seen[0] < count else 0
        seen[0] += 1
        place = min(max(place + shift, -(2**31)), 2**31 - 1)
        return [(frame[0], WORDS.pack(word, place))]

    return change


def test_on_the_simulated_drives_the_model_is_good_to_a_tenth_of_a_millimetre(
    cell: CellByHand,
) -> None:
    off = []
    for _ in range(80):
        cell.cycles(1)
        off += [trail.off for trail in cell.streamer._watch.trails]
    assert max(off) < 100
    assert cell.completed and not cell.events_of_loss and not cell.tripped()


@pytest.mark.parametrize("count", [1, 2])
def test_a_setpoint_or_two_lost_change_nothing(cell: CellByHand, count: int) -> None:
    cell.to_drives = only(0x201, lose(count))
    cell.to_the_end()
    assert cell.completed and not cell.tripped()


def test_setpoints_lost_in_a_row_are_counted_and_stopped_for(cell: CellByHand) -> None:
    cell.to_drives = only(0x201, lose(6))
    before = cell.number
    cell.to_the_end()
    assert (Condition.LOST, 1) in cell.tripped()
    assert sum(event.code for event in cell.events_of_loss) >= 2
    assert cell.happened(Happening.TRIP)[0].cycle - before < 12


def test_a_drive_that_hears_no_setpoints_any_more_is_not_left_to_its_watchdog(
    cell: CellByHand,
) -> None:
    cell.to_drives = only(0x201, lose(FOR_GOOD))
    begun_at = cell.number
    cell.to_the_end()
    quick = next(entry for entry in cell.log if entry.power == Power.QUICK_STOP)
    assert (Condition.LOST, 1) in cell.tripped()
    assert quick.cycle - begun_at <= 10
    assert abs(quick.following[0]) < 4_000


def test_a_carriage_that_creeps_away_where_it_stands_is_stopped_by_its_drive(
    machine: dg.Machine,
) -> None:
    cell = CellByHand(machine, START).enable()
    cell.to_drives = only(0x203, move(lambda k: 20 * k))
    cell.cycles(300)
    assert cell.log[-1].power == Power.QUICK_STOP
    assert {axis for _, axis in cell.tripped()} == {3}
    there = cell.rack.nodes[2].plant.position
    cell.cycles(200)
    assert cell.rack.nodes[2].plant.position == pytest.approx(there, abs=0.01)


def garble(word: int) -> Spoil:
    """Change one statusword."""
    left = [1]

    def change(frame: Frame) -> list[Frame]:
        left[0] -= 1
        good, place = WORDS.unpack(frame[1])
        return [(frame[0], WORDS.pack(word if left[0] >= 0 else good, place))]

    return change


def late(frames: int) -> Spoil:
    """Let some frames come right before their next one."""
    waiting: list[Frame] = []
    left = [frames]

    def change(frame: Frame) -> list[Frame]:
        left[0] -= 1
        if left[0] >= 0:
            waiting.append(frame)
            return []
        came = [*waiting, frame]
        waiting.clear()
        return came

    return change


BENIGN = {  # docs/faults.md has the same list
    "one setpoint lost": ("to_drives", 0x201, lambda: lose(1)),
    "two setpoints lost in a row": ("to_drives", 0x202, lambda: lose(2)),
    "one feedback lost": ("to_host", 0x181, lambda: lose(1)),
    "two feedbacks of a drive lost in a row": ("to_host", 0x183, lambda: lose(2)),
    "one SYNC lost": ("to_drives", 0x080, lambda: lose(1)),
    "one setpoint one cycle late": ("to_drives", 0x201, lambda: late(1)),
    "one feedback one cycle late": ("to_host", 0x182, lambda: late(1)),
    "one statusword that cannot be": ("to_host", 0x182, lambda: garble(0xFFFF)),
    "setpoints one cycle late for good": ("to_drives", 0x201, None),
    "feedback one cycle late for good": ("to_host", 0x181, None),
    "feedback with 0.1 mm of noise": (
        "to_host",
        0x182,
        lambda: move(lambda k: round(np.random.default_rng(k).normal(0.0, 100.0))),
    ),
}


@pytest.mark.parametrize("name", BENIGN)
@pytest.mark.parametrize("at", [20, 70, 110])
def test_what_is_benign_stops_nothing(machine: dg.Machine, name: str, at: int) -> None:
    way, identifier, spoil = BENIGN[name]
    cell = CellByHand(machine, START)
    if spoil is None:
        setattr(cell, way, only(identifier, hold(1)))
    cell.enable()
    cell.run(Straight(cell.machine, START, length=250.0, duration=0.25))
    cell.cycles(at)
    if spoil is not None:
        setattr(cell, way, only(identifier, spoil()))
    cell.to_the_end()
    assert cell.completed and not cell.tripped()


@pytest.mark.parametrize("skipped", [1, 2])
def test_a_cycle_or_two_that_come_late_stop_nothing(cell: CellByHand, skipped: int) -> None:
    cell.cycles(1, skipped)
    cell.to_the_end()
    assert cell.completed and not cell.tripped()


def test_feedback_two_cycles_late_is_stopped_for_at_speed_and_remarked(
    machine: dg.Machine,
) -> None:
    cell = CellByHand(machine, START)
    cell.to_host = only(0x182, hold(2))
    begun(cell).to_the_end()
    assert cell.tripped()[0] == (Condition.FOLLOWING_ERROR, 2)
    (remark,) = conduct_of(cell)
    assert remark.startswith("axis 2: follows 2.0 cycles later")


def test_feedback_with_2_mm_of_noise_is_stopped_for_and_remarked(cell: CellByHand) -> None:
    chance = np.random.default_rng(5)
    cell.to_host = only(0x182, move(lambda k: int(chance.integers(-2000, 2001))))
    cell.to_the_end()
    assert {axis for _, axis in cell.tripped()} == {2}
    assert any(remark.startswith("axis 2: feedback is noisy") for remark in conduct_of(cell))


OFF_FOR_GOOD = {
    "setpoints +10 mm": ("to_drives", 0x201, lambda k: 10_000),
    "setpoints +1 mm": ("to_drives", 0x201, lambda k: 1_000),
    "setpoints creep": ("to_drives", 0x201, lambda k: 20 * k),
    "feedback +10 mm": ("to_host", 0x181, lambda k: 10_000),
    "feedback +1 mm": ("to_host", 0x181, lambda k: 1_000),
    "feedback far away": ("to_host", 0x181, lambda k: -(2**31)),
}


@pytest.mark.parametrize("name", OFF_FOR_GOOD)
def test_what_is_off_for_good_is_stopped_for(cell: CellByHand, name: str) -> None:
    way, identifier, by = OFF_FOR_GOOD[name]
    setattr(cell, way, only(identifier, move(by)))
    cell.to_the_end()
    assert not cell.completed
    assert {axis for _, axis in cell.tripped()} == {1}


def test_one_position_that_cannot_be_is_named_and_fits_into_its_record(cell: CellByHand) -> None:
    cell.to_host = only(0x182, move(lambda k: -(2**31), 1))
    cell.cycles(2)
    assert cell.tripped()[0] == (Condition.FOLLOWING_ERROR, 2)
    assert min(entry.following[1] for entry in cell.log) < -(2**31) + 200_000


@pytest.mark.parametrize("axis", [1, 3])
def test_a_delay_of_one_cycle_for_good_is_remarked(machine: dg.Machine, axis: int) -> None:
    cell = CellByHand(machine, START)
    cell.to_drives = only(0x200 + axis, hold(1))
    begun(cell).to_the_end()
    assert cell.completed and not cell.tripped()
    remarks = conduct_of(cell)
    assert len(remarks) == 1 and f"axis {axis}: follows 1.0 cycles later" in remarks[0]


def test_noise_of_the_feedback_is_remarked(cell: CellByHand) -> None:
    chance = np.random.default_rng(3)
    cell.to_host = only(0x182, move(lambda k: round(chance.normal(0.0, 150.0))))
    cell.to_the_end()
    assert [remark.split(",")[0] for remark in conduct_of(cell)] == ["axis 2: feedback is noisy"]


def conduct_of(cell: CellByHand) -> list[str]:
    tally = ConductTally()
    for entry in cell.log:
        tally.add(entry)
    drives = cell.machine.drives
    whole = tally.conduct((0.001, 0.001, 0.001), drives.lag, drives.cycle)
    return [text for i, drive in enumerate(whole, 1) for text in drive.remarks(i, drives.cycle)]


def test_the_lag_of_a_drive_is_learned_from_a_run(machine: dg.Machine) -> None:
    plants = [PlantParameters(velocity_feedforward=0.9)] * 3
    cell = begun(CellByHand(machine, START, plants))
    cell.to_the_end()
    tally = ConductTally()
    for entry in cell.log:
        tally.add(entry)
    drives = cell.machine.drives
    for drive in tally.conduct((0.001, 0.001, 0.001), drives.lag, drives.cycle):
        assert drive.lag == pytest.approx(2 * 0.9 * 0.1 / (2 * np.pi * 80.0), rel=0.1)
        assert 0.0 < drive.acceleration_lag < 1 / (2 * np.pi * 80.0) ** 2


def test_a_carriage_that_does_not_arrive_ends_the_run_without_completing_it(
    machine: dg.Machine,
) -> None:
    cell = begun(CellByHand(machine, START))
    while not cell.log[-1].path_time >= 0.25:
        cell.cycles(1)
    cell.to_host = only(0x183, move(lambda k: 500))
    cell.to_the_end()
    assert not cell.completed
    assert (Condition.ASTRAY, 3) in cell.tripped()


def test_a_carriage_is_never_further_off_than_the_plan_leaves_it(machine: dg.Machine) -> None:
    left = {0.3: False, 1.5: True}
    for margin, completed in left.items():
        cell = CellByHand(machine, START, [PlantParameters(velocity_feedforward=0.8)] * 3).enable()
        move_ = Straight(machine, START, length=250.0, duration=0.25)
        cell.run(move_, margin_at=lambda times, m=margin: np.full(len(times), m))
        cell.to_the_end()
        assert cell.completed is completed
        assert completed or cell.tripped()[0][0] is Condition.FOLLOWING_ERROR


@pytest.mark.parametrize("word", [0x0000, 0xFFFF, 0x1220])
def test_one_statusword_that_cannot_be_is_bridged_and_a_second_is_not(
    cell: CellByHand, word: int
) -> None:
    left = [1]

    def garble(frame: Frame) -> list[Frame]:
        left[0] -= 1
        good, place = WORDS.unpack(frame[1])
        return [(frame[0], WORDS.pack(word if left[0] >= 0 else good, place))]

    cell.to_host = only(0x182, garble)
    cell.cycles(5)
    assert not cell.tripped()
    left[0] = 2
    cell.cycles(5)
    assert cell.tripped()[0][0] in (Condition.UNDEFINED, Condition.NOT_ENABLED)
