"""SocketCAN as a user has it: drives in one shell, stream and then replay in another."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import duoglide as dg

INTERFACE = "vcan0"
DEFAULT = dg.Machine.default()
MACHINE = replace(
    DEFAULT,
    limits=DEFAULT.limits.scaled(0.02),
    drives=replace(
        DEFAULT.drives,
        cycle=0.01,
        setpoint_timeout=4.0,
        heartbeat_period=0.2,
        heartbeat_timeout=5.0,
        missing_frames=400,
        late_cycles=400,
        sdo_timeout=4.0,
    ),
)

pytestmark = pytest.mark.skipif(
    not Path(f"/sys/class/net/{INTERFACE}").exists(), reason=f"no {INTERFACE} on this machine"
)


def duoglide(*words: object) -> list[str]:
    return [sys.executable, "-m", "duoglide", *map(str, words), "--bus", f"socketcan:{INTERFACE}"]


def test_a_stream_and_then_its_replay_come_to_their_ends(tmp_path: Path) -> None:
    plan, cell, log = (tmp_path / name for name in ("plan.mcap", "cell.toml", "run.mcap"))
    MACHINE.save(cell)
    dg.plan(MACHINE, dg.Path.line((-41, -30, 302), (-41, 30, 302)), brake_safe=False).save(plan)
    shared = ("--machine", cell, "--approach", "--home-here")
    drives = subprocess.Popen(
        duoglide("drives", "--machine", cell), stdout=subprocess.PIPE, text=True
    )
    with drives:
        assert drives.stdout is not None
        assert "three drives" in drives.stdout.readline()
        for words in (("stream", plan, "--log", log), ("replay", log)):
            done = subprocess.run(
                duoglide(*words, *shared), capture_output=True, text=True, timeout=600, check=False
            )
            assert done.returncode == 0, done.stderr
        drives.send_signal(signal.SIGINT)
