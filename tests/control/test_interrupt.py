"""Whoever ends a program stops the machine first, and every stop has one name and one number."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.control.host.background import Background
from duoglide.control.host.interrupt import (
    Ending,
    EndingHandler,
    EndingWatch,
    Ultimatum,
    endings_interrupt,
    interrupting,
    undisturbed,
)
from duoglide.control.host.run.report import require_success
from duoglide.drives.simulation.faults import DeviceFault
from duoglide.storage import EventKind, Topic, read_log

SLOW = dg.CarriageLimits(velocity=100.0, acceleration=2e3, jerk=2e4)
PROGRAM = """\
import sys
import duoglide as dg
with dg.Robot.connect(dg.Machine.default()) as robot:
    robot.enable()
    robot.home()
    here = robot.position
    path = dg.Path.line(here, here + (0.0, 100.0, 0.0)).capped(speed=5.0)
    trajectory = dg.plan(robot.machine, path, brake_safe=False)
    print("ready", flush=True)
    sys.stdin.readline()
    robot.run(trajectory, log="run.mcap")
"""


@pytest.fixture(scope="module")
def trajectory() -> dg.Trajectory:
    path = dg.Path.line((-41.0, 0.0, 302.0), (-41.0, 100.0, 302.0))
    return dg.plan(dg.Machine(limits=SLOW), path)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_program_that_is_ended_stops_on_the_path_and_says_where(
    number: signal.Signals, tmp_path: Path
) -> None:
    before = {n: signal.signal(n, signal.SIG_DFL) for n in (signal.SIGINT, signal.SIGHUP)}
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM], cwd=tmp_path, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    for n, handler in before.items():
        signal.signal(n, handler)
    with process:
        assert process.stdin is not None and process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.stdin.write("\n")
        process.stdin.flush()
        pause = threading.Event()
        while not (tmp_path / "run.mcap").exists() and process.poll() is None:
            pause.wait(0.02)
        for _ in range(3):  # to the whole group, as a terminal does, and impatiently
            os.killpg(process.pid, number)
            pause.wait(0.01)
        _, errors = process.communicate(timeout=600.0)
    assert process.returncode == -signal.SIGINT, "a shell says 130"
    said = re.search(
        r"^KeyboardInterrupt: (stopped on the path at path time \S+ s); log: run.mcap$",
        errors,
        re.M,
    )
    assert said is not None, errors
    log = read_log(tmp_path / "run.mcap")
    assert log.missing == ""
    events = [event for _, event in log.records(Topic.EVENT)]
    assert [event.text for event in events if event.kind is EventKind.STOP][-1] == said.group(1)
    assert not [event for event in events if event.kind is EventKind.FAULT]


def test_a_fault_on_the_approach_is_called_that_with_one_number(
    trajectory: dg.Trajectory, tmp_path: Path
) -> None:
    log = tmp_path / "run.mcap"
    with dg.Robot.connect(trajectory.machine) as robot:
        robot.enable()
        robot.home()
        robot.move_to((-41.0, 60.0, 302.0), override=1.0)
        handle = robot.start(trajectory, log=log, approach=True, override=0.2)
        pause = threading.Event()
        while handle.status.path_time == 0.0 and not handle.done:
            pause.wait(0.01)
        assert robot.simulated is not None
        robot.simulated.inject(DeviceFault(axis=2))
        report = handle.wait(timeout=600.0)
    assert report.approaching and not report.completed
    assert report.path_time > 0.0
    words = f"quick stop on the approach at path time {report.path_time:.4f} s"
    assert report.ending == words
    assert words in repr(report)
    with pytest.raises(dg.DriveFault, match=f"axis 2: .*; {re.escape(words)}; log: "):
        require_success(report)
    events = [event.text for _, event in read_log(log).records(Topic.EVENT)]
    assert words in events
    assert report.to_dict()["approaching"] is True


@pytest.fixture(autouse=True)
def _heard() -> Iterator[None]:
    """Hear Ctrl-C also where these tests run in the background of a shell, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_signals_wait_while_the_machine_is_put_to_rest() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), undisturbed():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        done.append("rest")
    assert done == ["rest"]


def test_another_interrupt_changes_nothing_on_the_way_out_of_one() -> None:
    with pytest.raises(KeyboardInterrupt, match="first"):
        try:
            raise KeyboardInterrupt("first")
        finally:
            with undisturbed():
                signal.raise_signal(signal.SIGINT)


def test_a_programs_own_handler_keeps_its_way() -> None:
    heard = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: heard.append(number))
    try:
        with endings_interrupt():
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert heard == [signal.SIGTERM]
    handler = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), endings_interrupt():
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is handler


def test_signals_that_follow_closely_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    handle = interrupting()
    with pytest.raises(KeyboardInterrupt):
        handle(signal.SIGINT, None)
    handle(signal.SIGINT, None)
    now += 2.0
    with pytest.raises(KeyboardInterrupt):
        handle(signal.SIGTERM, None)


@pytest.mark.parametrize(
    ("firm", "orders", "moving", "powered", "over"),
    [
        (True, 0, True, True, True),
        (True, 1, False, True, True),  # an order is not yet the end ...
        (True, 1, False, False, False),  # ... but without power there is nothing to insist on
        (False, 0, True, True, True),
        (False, 1, True, True, False),  # Ctrl-C has stopped the run, and the prompt is back
        (False, 0, False, True, False),  # Ctrl-C at a prompt, while the machine stands
    ],
)
def test_a_program_that_was_told_to_end_gets_so_long_and_no_longer(
    firm: bool, orders: int, moving: bool, powered: bool, over: bool
) -> None:
    ultimatum = Ultimatum()
    assert not ultimatum.is_over(0.0, 0, True)
    ending = Ending(signal.SIGINT, interrupting() if firm else signal.default_int_handler)
    ultimatum.begin(ending, 10.0, 0, moving=moving, powered=powered)
    # whoever repeats it puts nothing off
    ultimatum.begin(ending, 10.7, orders, moving=moving, powered=powered)
    assert not ultimatum.is_over(10.7, orders, powered)
    assert ultimatum.is_over(10.9, orders, powered) == over
    assert not ultimatum.is_over(11.9, orders, powered)


@pytest.mark.parametrize("heard", [False, True])
def test_a_program_that_does_not_hear_its_signal_is_ended_and_no_other(
    monkeypatch: pytest.MonkeyPatch, heard: bool
) -> None:
    now, ultimatum, handler = 10.0, Ultimatum(), EndingHandler(lambda number, frame: None)
    monkeypatch.setattr(time, "monotonic", lambda: now)
    monkeypatch.setattr(EndingHandler, "last_call", 0.0)
    ending = Ending(signal.SIGTERM, handler)
    ultimatum.begin(ending, now, 0, moving=False, powered=False)
    assert not ultimatum.unheard(12.0), "without power nobody insists"
    ultimatum.begin(ending, now, 0, moving=True, powered=True)
    ultimatum.begin(ending, 11.0, 0, moving=True, powered=True)
    assert not ultimatum.unheard(11.6), "it has its time"
    if heard:
        handler(signal.SIGTERM, None)
    assert ultimatum.unheard(11.8) == (0 if heard else signal.SIGTERM)


def test_signals_are_heard_beside_their_handlers_unless_they_are_the_programs_own() -> None:
    handler = interrupting()
    before = signal.signal(signal.SIGTERM, handler)
    watch = EndingWatch()
    try:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        assert watch.take() == [Ending(signal.SIGTERM, handler)]
        assert watch.fatal >> signal.SIGTERM & 1
        signal.signal(signal.SIGTERM, lambda number, frame: None)
        signal.raise_signal(signal.SIGTERM)
        assert watch.take() == []
        assert not watch.fatal >> signal.SIGTERM & 1
    finally:
        watch.close()
        signal.signal(signal.SIGTERM, before)
    assert signal.set_wakeup_fd(-1) == -1


def test_a_file_for_signals_that_is_somebody_elses_is_left_to_them() -> None:
    read, write = os.pipe2(os.O_NONBLOCK)
    signal.set_wakeup_fd(write)
    try:
        EndingWatch().close()
    finally:
        assert signal.set_wakeup_fd(-1) == write
        os.close(read)
        os.close(write)


def test_work_in_the_background_has_less_priority_and_its_errors_reach_who_waits() -> None:
    background = Background()
    try:
        mine = os.getpriority(os.PRIO_PROCESS, 0)
        theirs = background.do(lambda: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
        assert theirs >= min(mine + 1, 10)
        with pytest.raises(dg.InputError, match="no such thing"):
            background.do(lambda: _fail("no such thing"))
    finally:
        background.close()


def test_who_waits_for_work_in_the_background_hears_a_signal_at_once() -> None:
    background, end = Background(), threading.Event()
    main = threading.get_ident()

    def work() -> None:
        signal.pthread_kill(main, signal.SIGINT)
        end.wait()

    try:
        with pytest.raises(KeyboardInterrupt):
            background.do(work)
    finally:
        end.set()
        background.close()


def _fail(why: str) -> None:
    raise dg.InputError(why)
