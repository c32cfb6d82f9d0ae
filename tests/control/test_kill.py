"""What happens to the machine when its host dies, is stopped, or loses its streamer.

The drives are this test's own, in a process that survives; the host is a process that is killed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import duoglide as dg
from duoglide.drives.cia402 import State
from duoglide.drives.simulation.rack import DriveSnapshot
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages
from duoglide.storage import LogWarning, Topic, read_log

DEFAULT = dg.Machine.default()
MACHINE = replace(  # a busy computer must not be what stops these runs
    DEFAULT,
    drives=replace(
        DEFAULT.drives, setpoint_timeout=0.1, late_cycles=45, following_error_window=20.0
    ),
)
_ATTEMPTS = 4
GENEROUS = 15.0  # s; what is asserted is that it happens, and what does not happen meanwhile

HOST = """
import ctypes, signal, sys, time
import duoglide as dg
from duoglide.control.host.interrupt import interrupting
plan, bus, log, how = sys.argv[1:]
signal.signal(signal.SIGTERM, interrupting())
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background ignores it
trajectory = dg.Trajectory.load(plan)
with dg.Robot.connect(trajectory.machine, bus=bus) as robot:
    robot.enable()
    robot.home()
    handle = robot.start(trajectory, log=log, override=0.3)
    while handle.status.path_time < 0.06:
        if handle.done:
            sys.exit(handle.wait())
        time.sleep(0.002)
    print(robot._connection.process.pid, flush=True)
    if how != "wait":  # in a library that does not return, and does or does not let Python go on
        library = ctypes.CDLL(None) if how == "stuck" else ctypes.PyDLL(None)
        mutex = ctypes.create_string_buffer(64)
        library.pthread_mutex_lock(mutex)
        library.pthread_mutex_lock(mutex)
    handle.wait()
"""


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plan") / "plan.mcap"
    corners = [(-41.0, 0.0, 302.0), (-41.0, -140.0, 310.0), (-41.0, 140.0, 300.0)]
    dg.plan(MACHINE, dg.Path.polyline(corners, tolerance=4.0)).save(path)
    return path


class Scene:
    """Drives, a host that streams to them, and its streamer."""

    def __init__(
        self, drives: SimulatedDrives, host: subprocess.Popen[str], streamer: int, log: Path
    ) -> None:
        self.drives, self.host, self.log = drives, host, log
        self.streamer = streamer
        self.seen: list[tuple[DriveSnapshot, ...]] = []

    def watch_until(self, states: set[State]) -> float:
        """Look at the drives until all stand in one of ``states``; return how long it took."""
        began = time.monotonic()
        while True:
            drives = self.drives.snapshot()
            self.seen.append(drives)
            standing = all(abs(drive.velocity) < 0.5 for drive in drives)
            if standing and all(drive.state in states for drive in drives):
                return time.monotonic() - began
            assert time.monotonic() < began + GENEROUS, drives

    def least_clearance(self) -> float:
        """Least clearance of every pose that was seen [mm]."""
        carriages = np.array([[drive.position for drive in drives] for drives in self.seen])
        positions = dg.forward(MACHINE.geometry, carriages)
        return float(dg.clearance(MACHINE.geometry, positions).min())


@pytest.fixture
def scene(plan_file: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Scene]:
    how = getattr(request, "param", "wait")
    for attempt in range(_ATTEMPTS):
        with _scene(plan_file, tmp_path / f"run{attempt}.mcap", how) as scene:
            if scene is not None:
                yield scene
                return
    pytest.fail("this computer is too busy: no host got to its run")


@contextmanager
def _scene(plan: Path, log: Path, how: str) -> Iterator[Scene | None]:
    """Set a scene; None where the host was stopped before its time, by late cycles."""
    start = home_carriages(MACHINE).tolist()
    with SimulatedDrives(MACHINE.drives, start) as drives:
        host = subprocess.Popen(
            [sys.executable, "-c", HOST, str(plan), drives.address, str(log), how],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert host.stdout is not None
        streamer = 0
        try:
            line = host.stdout.readline()
            streamer = int(line or 0)
            yield Scene(drives, host, streamer, log) if line else None
        finally:
            host.kill()
            if streamer:
                _kill(streamer)
            host.wait()
            host.stdout.close()


def _kill(pid: int) -> None:
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        return


def _alive(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_killed_host_leaves_the_drives_off_and_its_log_whole(scene: Scene) -> None:
    scene.host.kill()
    killed = time.monotonic()
    scene.watch_until({State.SWITCH_ON_DISABLED})
    assert scene.least_clearance() > 0.0
    _until_gone(scene.streamer)
    with pytest.warns(LogWarning):
        log = read_log(scene.log)
    times = [t for t, _ in log.records(Topic.CYCLE)]
    assert killed - times[-1] < 1.0
    cycles = [record.cycle for _, record in log.records(Topic.CYCLE)]
    assert cycles == sorted(set(cycles))


def test_a_killed_streamer_is_answered_by_the_drives_watchdogs(scene: Scene) -> None:
    _kill(scene.streamer)
    scene.watch_until({State.QUICK_STOP_ACTIVE, State.FAULT, State.SWITCH_ON_DISABLED})
    assert scene.least_clearance() > MACHINE.clearance - 0.1
    scene.host.wait(GENEROUS)
    assert scene.host.returncode != 0
    assert list(read_log(scene.log).records(Topic.CYCLE))


def test_a_stopped_streamer_falls_silent_and_does_not_resume_by_itself(scene: Scene) -> None:
    os.kill(scene.streamer, signal.SIGSTOP)
    scene.watch_until({State.QUICK_STOP_ACTIVE, State.FAULT, State.SWITCH_ON_DISABLED})
    assert scene.least_clearance() > MACHINE.clearance - 0.1
    os.kill(scene.streamer, signal.SIGCONT)
    time.sleep(0.3)
    drives = scene.drives.snapshot()
    assert all(drive.state is not State.OPERATION_ENABLED for drive in drives)
    assert all(abs(drive.velocity) < 0.5 for drive in drives)


def test_a_stopped_host_is_noticed_and_the_machine_comes_to_rest(scene: Scene) -> None:
    os.kill(scene.host.pid, signal.SIGSTOP)
    try:
        scene.watch_until({State.SWITCH_ON_DISABLED})
        assert scene.least_clearance() > 0.0
    finally:
        os.kill(scene.host.pid, signal.SIGCONT)


def test_an_interrupted_host_stops_on_the_path_and_switches_off(scene: Scene) -> None:
    for pid in (scene.streamer, scene.drives.pid):  # a supervisor ends all processes of a service
        os.kill(pid, signal.SIGTERM)
    scene.host.send_signal(signal.SIGINT)
    scene.host.wait(GENEROUS)
    scene.watch_until({State.SWITCH_ON_DISABLED})
    assert scene.least_clearance() > 0.0
    assert not _alive(scene.streamer)
    assert read_log(scene.log).documents


@pytest.mark.parametrize(
    ("scene", "number", "code"),
    [
        ("stuck", signal.SIGTERM, 128 + signal.SIGTERM),
        ("locked", signal.SIGTERM, -signal.SIGKILL),
        ("locked", signal.SIGINT, None),  # at a prompt Ctrl-C does not mean the end
    ],
    indirect=["scene"],
)
def test_a_signal_to_a_host_that_is_stuck_switches_the_machine_off_and_ends_the_host(
    scene: Scene, number: signal.Signals, code: int | None
) -> None:
    scene.host.send_signal(number)
    scene.watch_until({State.SWITCH_ON_DISABLED})
    assert scene.least_clearance() > 0.0
    if code is None:
        assert scene.host.poll() is None, "it was not the host that did it"
    else:
        assert scene.host.wait(GENEROUS) == code


def _until_gone(pid: int) -> None:
    deadline = time.monotonic() + GENEROUS
    while _alive(pid):
        assert time.monotonic() < deadline, "the streamer outlives its host"
        time.sleep(0.01)
