"""The whole way, on the virtual bus: real processes, real time, generous bounds."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.control.channel.events import Condition, RunState
from duoglide.control.channel.orders import Command
from duoglide.control.host.commission import creep, describe_drives
from duoglide.control.host.run.handle import RunHandle
from duoglide.drives.cia402 import State
from duoglide.drives.simulation.faults import Clear, DeviceFault, Reboot, Sto
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages
from duoglide.storage import Document, Phase, Topic, read_log

DEFAULT = dg.Machine.default()
MACHINE = replace(  # a busy computer must not be what stops these runs
    DEFAULT,
    limits=DEFAULT.limits.scaled(0.3),
    drives=replace(
        DEFAULT.drives,
        setpoint_timeout=0.25,
        heartbeat_timeout=1.0,
        late_cycles=120,
        following_error_window=30.0,
        following_error_time=0.05,
    ),
)
HOME = (-41.0, 0.0, 302.0)


@pytest.fixture(scope="module")
def there() -> dg.Trajectory:
    return dg.transfer(MACHINE, HOME, (-41.0, 60.0, 310.0))


@pytest.fixture(scope="module")
def back() -> dg.Trajectory:
    return dg.transfer(MACHINE, (-41.0, 60.0, 310.0), HOME)


@pytest.fixture(scope="module")
def robot() -> Iterator[dg.Robot]:
    with dg.Robot.connect(MACHINE) as robot:
        yield robot


@pytest.fixture
def ready(robot: dg.Robot) -> dg.Robot:
    """Return the robot homed, under power and at home."""
    if not robot.enabled or robot.latched:
        robot.reset_fault()
        robot.enable()
    robot.home()
    if np.abs(robot.position - HOME).max() > 0.05:
        robot.move_to(HOME, override=1.0)
    return robot


def test_a_machine_that_is_not_homed_refuses_to_move(robot: dg.Robot, there: dg.Trajectory) -> None:
    with pytest.raises(dg.NotHomedError, match="home the machine"):
        robot.run(there)
    robot.enable()
    assert robot.states == (State.OPERATION_ENABLED,) * 3
    robot.home()
    assert robot.homed
    np.testing.assert_allclose(robot.position, HOME, atol=0.01)


def test_a_run_follows_its_trajectory_and_logs_every_cycle(
    ready: dg.Robot, there: dg.Trajectory, tmp_path: Path
) -> None:
    report = ready.run(there, log=tmp_path / "run.mcap")
    assert report.completed and not report.faults
    assert max(report.following_error) < 5.0
    np.testing.assert_allclose(ready.position, (-41.0, 60.0, 310.0), atol=0.05)
    log = read_log(tmp_path / "run.mcap")
    assert {Document.MACHINE, Document.TRAJECTORY, Document.REPORT} <= set(log.documents)
    records = [record for _, record in log.records(Topic.CYCLE)]
    numbers = [record.cycle for record in records]
    skipped = report.skipped
    assert numbers[-1] - numbers[0] + 1 == len(numbers) + skipped
    program = [r for r in records if r.phase is Phase.PROGRAM]
    assert program[-1].path_time == there.duration
    scale = 1000.0
    for record in program:
        expected = np.rint(there.at(record.path_time).carriages * scale)
        assert np.abs(np.array(record.setpoint) - expected).max() <= 1e-9
    assert dg.Trajectory.from_document(log.documents[Document.TRAJECTORY]).duration


def test_a_run_from_elsewhere_is_refused_unless_an_approach_is_asked_for(
    ready: dg.Robot, back: dg.Trajectory
) -> None:
    with pytest.raises(dg.PathError, match=r"carriage . is .* mm away.*approach"):
        ready.run(back)
    report = ready.run(back, approach=True)
    assert report.completed
    np.testing.assert_allclose(ready.position, HOME, atol=0.05)


@pytest.mark.parametrize("override", [0.0, -0.5, 1.01, float("nan")])
def test_a_run_does_not_begin_at_an_override_that_is_not_above_0_to_1(
    ready: dg.Robot, there: dg.Trajectory, override: float
) -> None:
    for verb in (ready.run, ready.start):
        with pytest.raises(dg.InputError, match="override"):
            verb(there, override=override)
    assert ready.current_run is None


def test_a_log_that_is_no_path_is_refused_before_anything_moves(
    ready: dg.Robot, there: dg.Trajectory
) -> None:
    nowhere: Any = 5
    with pytest.raises(dg.InputError, match="log = 5: must be the path of a file"):
        ready.run(there, log=nowhere, approach=True)
    assert ready.current_run is None


def test_an_override_of_0_holds_a_run_that_has_begun(ready: dg.Robot, there: dg.Trajectory) -> None:
    handle = ready.start(there, override=0.2, approach=True)
    handle.set_override(0.0)
    assert not handle.done
    handle.stop()
    assert not handle.wait(10.0).completed


def test_hold_resume_override_and_stop_work_while_a_run_goes_on(
    ready: dg.Robot, there: dg.Trajectory
) -> None:
    handle = ready.start(there, override=0.2)
    handle.hold()
    _until(lambda: handle.status.state is RunState.HELD)
    assert not handle.done
    held = handle.status.path_time
    handle.set_override(0.5)
    handle.resume()
    _until(lambda: handle.status.path_time > held)
    handle.stop()
    report = handle.wait(10.0)
    assert not report.completed and not report.faults
    assert held < report.path_time < there.duration
    assert ready.enabled


def test_a_fault_of_one_drive_stops_all_is_named_and_needs_a_reset(
    ready: dg.Robot, there: dg.Trajectory, tmp_path: Path
) -> None:
    assert ready.simulated is not None
    handle = ready.start(there, log=tmp_path / "run.mcap", override=0.2)
    ready.simulated.inject(DeviceFault(2))
    report = handle.wait(10.0)
    assert (Condition.FAULT, 2) in [(t.condition, t.axis) for t in report.faults]
    text = " ".join(event.text for _, event in report.events)
    assert "axis 2: emergency 0x2310" in text and "over-current" in text
    assert read_log(tmp_path / "run.mcap").documents[Document.REPORT]["faults"]
    with pytest.raises(dg.DriveError, match="power"):
        ready.run(there, approach=True)
    with pytest.raises(dg.DriveFault, match="axis 2"):
        ready.enable()
    ready.reset_fault()
    ready.enable()
    assert ready.homed
    assert ready.run(there, approach=True).completed


def test_what_is_ordered_during_the_approach_holds_for_the_program_too(
    ready: dg.Robot, back: dg.Trajectory
) -> None:
    handle = ready.start(back, approach=True)
    handle.set_override(0.3)
    handle.hold()
    _until(lambda: handle.status.state is RunState.HELD)
    assert not handle.done and handle.approaching
    handle.resume()
    _until(lambda: not handle.approaching and handle.status.rate > 0.0)
    _until(lambda: handle.done or handle.status.rate > 0.29)
    assert handle.status.rate <= 0.3
    assert handle.wait(20.0).completed


def test_a_run_that_is_held_on_its_approach_can_be_stopped(
    ready: dg.Robot, back: dg.Trajectory
) -> None:
    handle = ready.start(back, approach=True)
    handle.hold()
    _until(lambda: handle.status.state is RunState.HELD)
    handle.stop()
    report = handle.wait(5.0)
    assert not report.completed and report.approaching


def test_a_run_that_is_stopped_before_it_begins_does_not_begin(
    ready: dg.Robot, there: dg.Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = ready._connection.process.load

    def stop_meanwhile(prepared: Any) -> None:
        load(prepared)
        ready.stop()

    monkeypatch.setattr(ready._connection.process, "load", stop_meanwhile)
    with pytest.raises(dg.DriveError, match="stop was commanded"):
        ready.run(there)
    monkeypatch.undo()
    assert ready.current_run is None
    assert ready.run(there, override=1.0).completed


def test_a_stop_while_the_run_is_being_handed_over_ends_it(
    ready: dg.Robot, there: dg.Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped_meanwhile(*parts: Any) -> RunHandle:  # as another thread does
        ready.stop()
        return RunHandle(*parts)

    monkeypatch.setattr("duoglide.control.host.robot.RunHandle", stopped_meanwhile)
    assert not ready.run(there, override=1.0).completed
    monkeypatch.undo()
    assert ready.run(there, approach=True, override=1.0).completed


def test_a_small_move_that_is_stopped_while_it_is_planned_does_not_begin(
    ready: dg.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped_meanwhile(*parts: Any) -> dg.Trajectory:
        ready.stop()
        return dg.transfer(*parts)

    monkeypatch.setattr("duoglide.planning.transfer.transfer.transfer", stopped_meanwhile)
    with pytest.raises(dg.DriveError, match="stop was commanded"):
        ready.jog((0.0, 1.0, 0.0))
    assert ready.current_run is None


def test_what_is_no_trajectory_is_refused(ready: dg.Robot) -> None:
    for wrong in (None, "plan.mcap", dg.Path.line(HOME, (-41.0, 60.0, 310.0))):
        with pytest.raises(dg.InputError, match="Trajectory"):
            ready.run(wrong)  # type: ignore[arg-type]  # on purpose


def test_a_latched_stop_refuses_power_at_once(ready: dg.Robot, there: dg.Trajectory) -> None:
    handle = ready.start(there, override=0.2, approach=True)
    handle.quick_stop()
    handle.wait(10.0)
    began = time.monotonic()
    with pytest.raises(dg.DriveError, match="a stop is latched"):
        ready.enable()
    assert time.monotonic() - began < 3.0
    ready.reset_fault()
    ready.enable()


def test_run_raises_what_made_it_stop(ready: dg.Robot, there: dg.Trajectory) -> None:
    simulated = ready.simulated
    assert simulated is not None

    def fail_once_it_moves() -> None:
        _until(lambda: ready.current_run is not None and ready.current_run.status.path_time > 0.0)
        simulated.inject(DeviceFault(1, 0x4210))

    failing = threading.Thread(target=fail_once_it_moves)
    failing.start()
    with pytest.raises(dg.DriveFault, match="axis 1") as caught:
        ready.run(there, override=0.1)
    failing.join()
    assert caught.value.axis == 1


def test_safe_torque_off_is_a_state_of_its_own(ready: dg.Robot) -> None:
    assert ready.simulated is not None
    ready.simulated.inject(Sto(3))
    _until(lambda: not ready.enabled)
    with pytest.raises(dg.DriveError, match="safe torque off"):
        ready.enable()
    ready.simulated.inject(Clear(3))


def test_a_drive_that_reboots_has_lost_its_reference(ready: dg.Robot, there: dg.Trajectory) -> None:
    assert ready.simulated is not None
    ready.simulated.inject(Reboot(1))
    _until(lambda: not ready.homed)
    time.sleep(0.3)
    ready.reset_fault()
    ready.enable()
    with pytest.raises(dg.NotHomedError):
        ready.run(there)


def test_a_creep_shows_what_the_drive_reports_and_returns(ready: dg.Robot) -> None:
    before = ready.carriages
    check = creep(ready, 2, 1.0)
    np.testing.assert_allclose(check.moved, (0.0, 1.0, 0.0), atol=0.05)
    np.testing.assert_allclose(ready.carriages, before, atol=0.05)


def test_out_of_where_it_must_not_stand_it_comes_only_by_recovering() -> None:
    cramped = replace(MACHINE, clearance=54.0)
    low = (-41.0, 0.0, 285.0)
    with dg.Robot.connect(MACHINE) as robot:
        robot.enable()
        robot.home()
        robot.move_to(low, override=1.0)
        robot.machine = cramped
        assert dg.clearance(MACHINE.geometry, robot.position) < cramped.clearance
        with pytest.raises(dg.PathError):
            robot.move_to(HOME)
        assert robot.recover().completed
        left = dg.clearance(MACHINE.geometry, robot.position)
        assert left > cramped.clearance
        stands = robot.carriages
        robot.recover()
        np.testing.assert_allclose(robot.carriages, stands, atol=0.01)


def test_drives_describe_themselves_to_whoever_asks(ready: dg.Robot) -> None:
    reports = describe_drives(MACHINE, ready.bus)
    assert [report.axis for report in reports] == [1, 2, 3]
    assert all(report.homed and not report.safe_torque_off for report in reports)
    assert ready.enabled


def test_a_trajectory_of_another_machine_is_refused(robot: dg.Robot) -> None:
    fast = dg.transfer(DEFAULT, HOME, (-41.0, 80.0, 302.0))
    robot.reset_fault()
    robot.enable()
    robot.home(again=True)
    with pytest.raises(dg.LimitError, match=r"carriage \d would need"):
        robot.run(fast)


@pytest.mark.parametrize("override", [-0.1, 1.5, float("nan")])
def test_an_override_beyond_its_range_is_refused(
    robot: dg.Robot, there: dg.Trajectory, override: float
) -> None:
    with pytest.raises(dg.InputError, match="override"):
        robot.run(there, override=override)


def test_an_unknown_bus_is_refused_with_the_forms_that_exist() -> None:
    with pytest.raises(dg.BusError, match="socketcand:HOST:PORT"):
        dg.Robot.connect(MACHINE, bus="serial:/dev/ttyS0")


def test_the_host_says_so_when_the_streamer_is_gone(there: dg.Trajectory) -> None:
    with dg.Robot.connect(MACHINE) as robot:
        robot.enable()
        robot.home()
        handle = robot.start(there, override=0.1)
        process = robot._connection.process
        process._process.kill()
        with pytest.raises(dg.BusError, match="gone"):
            handle.wait(10.0)
        assert robot.simulated is not None
        _until(
            lambda: all(d.state is not State.OPERATION_ENABLED for d in robot.simulated.snapshot())
        )
        assert max(abs(d.velocity) for d in robot.simulated.snapshot()) < 1.0
        with pytest.raises(dg.BusError):
            process.order(Command.HOLD)
            process.order(Command.HOLD)


def test_a_machine_runs_over_udp_too(there: dg.Trajectory) -> None:
    bus = "udp:239.74.163.2:43211"  # where bursts get lost: only ``virtual`` bridges by itself
    patient = replace(MACHINE.drives, missing_frames=60, sdo_timeout=1.0, sdo_retries=6)
    machine = replace(MACHINE, drives=patient)
    start = home_carriages(machine).tolist()
    with (
        SimulatedDrives(machine.drives, start, bus=bus),
        dg.Robot.connect(machine, bus=bus) as robot,
    ):
        robot.enable()
        robot.home()
        assert robot.run(there).completed


@pytest.mark.slow
def test_a_soak_of_ten_minutes_loses_nothing_and_keeps_its_memory(
    there: dg.Trajectory, back: dg.Trajectory, tmp_path: Path
) -> None:
    minutes = float(os.environ.get("DUOGLIDE_SOAK_MINUTES", "10"))
    with dg.Robot.connect(MACHINE) as robot:
        robot.enable()
        robot.home()
        connection = robot._connection
        memory: list[int] = []
        cycles = 0
        ends = time.monotonic() + 60.0 * minutes
        while time.monotonic() < ends:
            for way in (there, back):
                report = robot.run(way, log=tmp_path / "run.mcap")
                assert report.completed and not report.dropped
                cycles += report.cycles
            memory.append(_resident(connection.process.pid))
        assert connection.process.ring.dropped == 0
        assert memory[-1] < 1.05 * memory[len(memory) // 10] + 1024
        print(f"{cycles} cycles logged, streamer's memory {memory[0]} to {memory[-1]} kB")


def _resident(pid: int) -> int:
    """Return the resident memory of a process [kB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def _until(condition: object, patience: float = 10.0) -> None:
    deadline = time.monotonic() + patience
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline, "did not happen in time"
        time.sleep(0.01)
