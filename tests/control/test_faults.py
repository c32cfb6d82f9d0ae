"""Every row of the fault table, injected on the bus; reactions are counted in cycles."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from duoglide.control.channel.events import Condition, Happening
from duoglide.control.channel.orders import Command, Power
from duoglide.drives import pdo
from duoglide.drives.cia402 import State

Inject = Callable[[Any], None]


def emergency_only(bench: Any) -> None:
    bench._queue.append((pdo.EMCY + 2, pdo.pack_emergency(0x4210, 8)))


def drive_fault(bench: Any) -> None:
    bench.drives[1].axis.fault(0x2310)


def following_error(bench: Any) -> None:
    bench.drives[1].axis._following_error = True


def silent(bench: Any) -> None:
    bench.drives[1].mute = True


def no_heartbeat(bench: Any) -> None:
    bench.drives[1].beats = False


def boot_up(bench: Any) -> None:
    bench._queue.append((pdo.HEARTBEAT + 2, b"\0"))


def left_operational(bench: Any) -> None:
    bench._queue.append((pdo.HEARTBEAT + 2, bytes((pdo.NmtState.PRE_OPERATIONAL,))))


def sto(bench: Any) -> None:
    bench.drives[1].axis.set_sto(True)


def cannot_send(bench: Any) -> None:
    bench.broken = True


def dead_bus(bench: Any) -> None:
    bench.deaf = True


def bus_off(bench: Any) -> None:
    bench._queue.append((-1, bytes((0x40,)) + bytes(8)))


def error_passive(bench: Any) -> None:
    bench._queue.append((-1, bytes((0x04, 0, 0x20)) + bytes(6)))


def host_gone(bench: Any) -> None:
    bench.host_gone = True


def host_silent(bench: Any) -> None:
    bench.reading = False


def pressed(bench: Any) -> None:
    bench.order(Command.QUICK_STOP)


FAULTS = [
    (emergency_only, Condition.EMERGENCY, 2, Happening.STOPPED, 2),
    (drive_fault, Condition.FAULT, 2, None, 3),
    (following_error, Condition.FOLLOWING_ERROR, 2, Happening.STOPPED, 3),
    (silent, Condition.SILENT, 2, Happening.STOPPED, 6),
    (no_heartbeat, Condition.HEARTBEAT, 2, Happening.STOPPED, 60),
    (boot_up, Condition.BOOT_UP, 2, None, 2),
    (left_operational, Condition.NMT, 2, None, 2),
    (sto, Condition.FAULT, 2, None, 3),
    (cannot_send, Condition.UNSENT, 0, Happening.STOPPED, 5),
    (dead_bus, Condition.BUS, 0, None, 2),
    (bus_off, Condition.BUS, 0, None, 2),
    (error_passive, Condition.BUS, 0, None, 2),
    (host_gone, Condition.HOST_GONE, 0, Happening.STOPPED, 2),
    (host_silent, Condition.HOST_SILENT, 0, Happening.STOPPED, 60),
    (pressed, Condition.PRESSED, 0, None, 2),
]


@pytest.fixture
def running(make_bench: Callable[..., Any]) -> Any:
    """Return a bench in the middle of a run, at full speed."""
    bench = make_bench(heartbeat=50, host=50).enable()
    bench.run(bench.straight())
    bench.step(240)
    return bench


@pytest.mark.parametrize("fault", FAULTS, ids=[fault[0].__name__ for fault in FAULTS])
def test_each_fault_is_named_latched_and_stops_all_three(
    running: Any, fault: tuple[Inject, Condition, int, Any, int]
) -> None:
    inject, condition, axis, _, within = fault
    began = running.number
    inject(running)
    running.step(120)
    assert (condition, axis) in running.tripped()
    assert running.tripped().count((condition, axis)) == 1
    trip = running.happened(Happening.TRIP)[0]
    assert trip.cycle - began <= within
    assert running.happened(Happening.STOPPED)
    stands = running.setpoints()[-3:]
    assert np.all(stands == stands[0])
    running.host_gone = False
    running.order(Command.RESUME)
    running.order(Command.RUN, 1, 1.0)
    running.step(5)
    assert len(running.happened(Happening.STARTED)) == 1


@pytest.mark.parametrize(
    "inject", [f[0] for f in FAULTS if f[3]], ids=[f[0].__name__ for f in FAULTS if f[3]]
)
def test_a_stop_on_the_path_leaves_it_by_less_than_a_tenth_of_a_millimetre(
    running: Any, inject: Inject
) -> None:
    inject(running)
    places = []
    for _ in range(120):
        running.step()
        places.append([drive.axis.actual for drive in running.drives])
    way = np.array(places) - np.array([-200_000, 100_000, -100_000])
    if inject is cannot_send:  # then each drive brakes by itself, all from the same speed
        assert np.ptp(way[-1]) < 100
    else:
        assert np.max(np.ptp(way, axis=1)) < 100


@pytest.mark.parametrize("inject", [drive_fault, sto, boot_up, pressed])
def test_where_a_drive_does_not_follow_the_others_brake_by_themselves(
    running: Any, inject: Inject
) -> None:
    inject(running)
    running.step(3)
    others = [running.drives[i].axis.state for i in (0, 2)]
    assert others == [State.QUICK_STOP_ACTIVE] * 2


def test_a_lost_feedback_frame_is_counted_and_bridged(running: Any) -> None:
    running.lose = lambda identifier: identifier == pdo.TPDO1 + 3
    running.step()
    running.lose = lambda identifier: False
    running.step(300)
    assert not running.tripped()
    assert sum(bool(e.missing) for e in running.log) == 1
    assert running.happened(Happening.FINISHED)


def test_a_lost_feedback_frame_at_full_speed_is_no_following_error(make_bench: Any) -> None:
    bench = make_bench().enable()
    bench.run(bench.straight(length=250.0, duration=0.2))  # 2.5 m/s: 5 mm a cycle
    bench.step(48)
    bench.lose = lambda identifier: identifier == pdo.TPDO1 + 3
    bench.step(2)
    bench.lose = lambda identifier: False
    bench.step(100)
    assert not bench.tripped()
    assert bench.happened(Happening.FINISHED)


def test_that_all_drives_are_silent_is_borne_for_longer_where_they_are_simulated(
    make_bench: Callable[..., Any],
) -> None:
    bench = make_bench(silence=50).enable()
    bench.run(bench.straight())
    bench.step(100)
    for drive in bench.drives:
        drive.mute = True
    bench.step(49)
    assert not bench.tripped()
    for drive in bench.drives[:2]:
        drive.mute = False
    bench.step(4)
    assert bench.tripped() == [(Condition.SILENT, 3)]


def test_a_lost_setpoint_is_bridged_by_the_drive(running: Any) -> None:
    running.lose = lambda identifier: identifier == pdo.RPDO1 + 3
    running.step()
    running.lose = lambda identifier: False
    running.step(300)
    assert not running.tripped()
    assert running.happened(Happening.FINISHED)


def test_a_row_of_late_cycles_stops_the_run(running: Any) -> None:
    running.step(3, skipped=1)
    running.step(100)
    assert (Condition.LATE, 0) in running.tripped()
    assert running.happened(Happening.STOPPED)


@pytest.mark.parametrize("identifier", [pdo.SYNC, pdo.RPDO1 + 2, pdo.HEARTBEAT + 127])
def test_another_host_that_commands_the_drives_stops_everything(
    running: Any, identifier: int
) -> None:
    running.interfere(identifier, b"\x05")
    running.step(100)
    assert (Condition.FOREIGN, 0) in running.tripped()
    assert not any(drive.axis.velocity for drive in running.drives)
    assert all(drive.axis.state is not State.OPERATION_ENABLED for drive in running.drives)


def test_another_program_may_read_the_drives_objects(running: Any) -> None:
    running.interfere(pdo.SDO_REQUEST + 1, bytes(8))
    running.interfere(pdo.SDO_REPLY + 1, bytes(8))
    running.step(100)
    assert not running.tripped()


def test_drives_are_left_disabled_in_order_when_the_host_is_gone(running: Any) -> None:
    running.host_gone = True
    states = set()
    for _ in range(150):
        running.step()
        states.add(running.drives[0].axis.state)
    assert running.streamer.done
    assert all(drive.axis.state is State.SWITCH_ON_DISABLED for drive in running.drives)
    assert {State.SWITCHED_ON, State.READY_TO_SWITCH_ON} <= states


def test_drives_stop_by_themselves_when_the_streamer_falls_silent(running: Any) -> None:
    for _ in range(100):
        for drive in running.drives:
            drive.pass_time(2000)
    speeds = [drive.axis.velocity for drive in running.drives]
    assert speeds == [0, 0, 0]
    assert all(drive.axis.state is State.QUICK_STOP_ACTIVE for drive in running.drives)


def test_a_setpoint_outside_the_fence_is_never_sent(running: Any) -> None:
    (prepared,) = running.handed_over.values()
    sent_before = len(running.sent)
    running.streamer._follower.advance = lambda cycles: (10**6, 0, 0)
    running.step(5)
    assert (Condition.REFUSED, 1) in running.tripped()
    targets = [pdo.SETPOINT.unpack(d)[1] for i, d in running.sent[sent_before:] if i == 0x201]
    assert max(targets) <= prepared.fence.high[0]


def test_a_fault_is_reset_by_an_edge_and_only_on_purpose(running: Any) -> None:
    drive_fault(running)
    running.step(150)
    assert running.drives[1].axis.state is State.FAULT
    running.order(Command.FORGET)
    running.order(Command.POWER, Power.RESET)
    running.step(40)
    assert all(drive.axis.state is State.SWITCH_ON_DISABLED for drive in running.drives)
    running.order(Command.POWER, Power.ON)
    running.step(20)
    assert all(drive.axis.state is State.OPERATION_ENABLED for drive in running.drives)
