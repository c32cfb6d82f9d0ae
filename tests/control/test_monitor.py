"""What threads of host and streamer say when they fail: nobody waits for a dead thread."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import duoglide as dg
from duoglide.control.channel.orders import pack_object, receive_object
from duoglide.control.channel.ring import CycleEntry, EventEntry, Ring
from duoglide.control.host.interrupt import EndingWatch
from duoglide.control.host.monitor import Monitor
from duoglide.control.host.run.report import Tally
from duoglide.control.streamer.__main__ import receive_setpoints
from duoglide.storage import Topic, read_log

PATIENCE = 20.0  # [s]; what is wrong is said at once
SLOW = dg.CarriageLimits(velocity=100.0, acceleration=2e3, jerk=2e4)


@pytest.fixture
def process() -> Iterator[Any]:
    descriptor = Ring.allocate()
    ring = Ring(descriptor)
    os.close(descriptor)
    endings = EndingWatch()
    yield SimpleNamespace(ring=ring, alive=True, pid=1, endings=endings)
    endings.close()
    ring.close()


class Broken:
    """A listener with a mistake in it."""

    def add_cycle(self, entry: CycleEntry) -> None:
        """Take no cycle."""

    def add_event(self, event: EventEntry) -> None:
        """Fail as a mistake in a program does."""
        raise KeyError("no such kind")


def test_a_listener_that_fails_in_any_way_is_named_to_whoever_waits(process: Any) -> None:
    monitor = Monitor(process)
    monitor.attach(Broken())
    process.ring.put_event(EventEntry(1, 0, 9, 0, 0, 0, 0.0))
    with pytest.raises(dg.DuoglideError, match="Broken could not take a record: KeyError") as told:
        monitor.wait_until(lambda: False, PATIENCE)
    assert isinstance(told.value.__cause__, KeyError)
    assert monitor.failed
    monitor.detach()
    process.ring.put_event(EventEntry(2, 0, 9, 0, 0, 0, 0.0))
    assert monitor.wait_until(lambda: monitor.mark == 2, PATIENCE), "it reads on"
    monitor.close()


def test_a_reader_that_cannot_go_on_says_so(process: Any) -> None:
    def drain() -> Iterator[EventEntry]:
        raise ValueError("a record of a kind that nobody has written")

    process.ring.drain = drain
    monitor = Monitor(process)
    with pytest.raises(dg.DuoglideError, match="cannot be read on: ValueError: a record"):
        monitor.wait_until(lambda: False, PATIENCE)
    assert monitor.failed
    monitor.close()


def test_a_run_whose_host_makes_a_mistake_is_stopped_and_its_log_opens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    count, machine = Tally.add_cycle, dg.Machine(limits=SLOW)

    def fail(tally: Tally, entry: CycleEntry) -> None:
        count(tally, entry)
        if tally.path_time > 0.2:
            raise ZeroDivisionError("a mistake")

    path = dg.Path.line((-41.0, 0.0, 302.0), (-41.0, 100.0, 302.0))
    trajectory = dg.plan(machine, path)
    with dg.Robot.connect(machine) as robot:
        robot.enable()
        robot.home()
        with monkeypatch.context() as patch:
            patch.setattr(Tally, "add_cycle", fail)
            handle = robot.start(trajectory, log=tmp_path / "run.mcap", approach=True)
            with pytest.raises(dg.DuoglideError, match=r"Tally could not .* ZeroDivisionError"):
                handle.wait(PATIENCE)
        assert robot.park().completed, "the machine is there for the next run"
    cycles = list(read_log(tmp_path / "run.mcap").records(Topic.CYCLE))
    assert 0.2 <= cycles[-1][1].path_time < trajectory.duration


def test_setpoints_that_the_streamer_cannot_take_over_are_answered_and_the_next_are_taken() -> None:
    ours, theirs = socket.socketpair()
    ours.settimeout(PATIENCE)
    reader = threading.Thread(target=receive_setpoints, args=(theirs, None), daemon=True)
    reader.start()
    broken = b"no pickle at all"
    packed = pack_object(broken)
    ours.sendall(packed.replace(packed[8:], broken.ljust(len(packed) - 8)))
    ours.sendall(pack_object("no setpoints"))
    refused, taken = receive_object(ours), receive_object(ours)
    ours.close()
    reader.join(PATIENCE)
    theirs.close()
    assert isinstance(refused, dg.DuoglideError)
    assert "cannot take the setpoints over: UnpicklingError" in str(refused)
    assert taken is None
