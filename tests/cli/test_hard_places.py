"""The commands where a computer is short of memory, or has one processor for all of it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

import duoglide as dg
from duoglide.drives.cia402 import State
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages

DEFAULT = dg.Machine.default()
MACHINE = replace(
    DEFAULT,
    limits=DEFAULT.limits.scaled(0.1),
    drives=replace(
        DEFAULT.drives,
        cycle=0.01,  # 100 Hz
        sdo_timeout=5.0,
        setpoint_timeout=2.0,
        heartbeat_timeout=5.0,
        late_cycles=200,
        missing_frames=200,
    ),
)
LONGEST = 240.0  # s; only a command that hangs takes so long


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("hard") / "plan.mcap"
    dg.plan(MACHINE, dg.Path.line((-41, -30, 302), (-41, 30, 302)), brake_safe=False).save(path)
    return path


ON_ONE_PROCESSOR = (
    sys.executable,
    "-c",
    "import os, sys; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))});"
    " os.execv(sys.argv[1], sys.argv[1:])",
)
SHORT_OF_MEMORY = ("sh", "-c", 'ulimit -v 600000; exec "$0" "$@"')


def duoglide(*words: object) -> list[str]:
    return [sys.executable, "-m", "duoglide", *map(str, words)]


def to_its_end(command: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, which has to come."""
    return subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)


def test_on_one_processor_a_stream_and_then_its_replay_come_to_their_ends(
    plan_file: Path, tmp_path: Path
) -> None:
    """As a user does it: drives in one shell, ``stream`` and then ``replay`` in another."""
    cell, log = tmp_path / "cell.toml", tmp_path / "run.mcap"
    MACHINE.save(cell)
    drives = [*ON_ONE_PROCESSOR, *duoglide("drives", "--machine", cell)]
    with subprocess.Popen(drives, stdout=subprocess.PIPE, text=True) as shell:
        assert shell.stdout is not None
        bus = shell.stdout.readline().split("--bus ")[1].split(",")[0]
        shared = ["--bus", bus, "--machine", cell, "--approach", "--home-here"]
        stream, replay = ("stream", plan_file, "--log", log), ("replay", log)
        try:
            once = to_its_end([*ON_ONE_PROCESSOR, *duoglide(*stream, *shared)])
            again = to_its_end([*ON_ONE_PROCESSOR, *duoglide(*replay, *shared)])
        finally:
            shell.kill()
    assert once.returncode == 0, once.stderr
    assert again.returncode == 0, again.stderr


def test_short_of_memory_a_command_ends_and_leaves_no_drive_under_power(plan_file: Path) -> None:
    start = home_carriages(MACHINE).tolist()
    with SimulatedDrives(MACHINE.drives, start) as drives:
        words = ["stream", plan_file, "--approach", "--home-here", "--bus", drives.address]
        done = to_its_end([*SHORT_OF_MEMORY, *duoglide(*words)])
        states = {drive.state for drive in drives.snapshot()}
    assert done.returncode in (0, 1), done.stderr
    assert "Traceback" not in done.stderr
    assert State.OPERATION_ENABLED not in states
