"""Imitations of makers' drives, served by programs that share nothing with the package."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parents[3] / "shared" / "tools" / "foreign-drives"
_FRAME = re.compile(r"\((\d+\.\d+)\) can0 ([0-9A-F]{3})#([0-9A-F]*) ([HD])")


@dataclass(frozen=True, slots=True)
class LoggedFrame:
    """One frame of an imitation's log.

    Attributes:
        time: When it was on the bus [s].
        can_id: Its identifier.
        data: Its content.
        by_host: Whether the host sent it, not a drive.
    """

    time: float
    can_id: int
    data: bytes
    by_host: bool


@dataclass(frozen=True, slots=True)
class ForeignDrives:
    """Three imitated drives on a bus.

    Attributes:
        bus: Its name.
        port: Of their control.
        log: The file with every frame.
    """

    bus: str
    port: int
    log: Path

    def order(self, *words: object) -> str:
        """Send a command of ``ctl.py`` and return what it answers."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
            channel.settimeout(10.0)
            channel.sendto(" ".join(map(str, words)).encode(), ("127.0.0.1", self.port))
            return channel.recv(65536).decode()

    def encoders(self) -> list[float]:
        """Return where the encoders really stand [increments]."""
        return [float(drive["enc"]) for drive in self.state()]

    def state(self) -> list[dict[str, Any]]:
        """Return what the drives say of themselves past the bus."""
        drives: list[dict[str, Any]] = json.loads(self.order("state"))
        return drives

    def frames(self) -> list[LoggedFrame]:
        """Return every frame since the drives were started."""
        self.order("flush")
        found = _FRAME.finditer(self.log.read_text("ascii"))
        return [
            LoggedFrame(float(t), int(i, 16), bytes.fromhex(data), by == "H")
            for t, i, data, by in (match.groups() for match in found)
        ]

    def notes(self) -> list[str]:
        """Return what the imitation has noted: aborts, homing, targets far away."""
        self.order("flush")
        lines = self.log.read_text("ascii").splitlines()
        return [line.split(maxsplit=2)[2] for line in lines if line.startswith("#")]


@contextmanager
def foreign_drives(name: str, port: int, folder: Path) -> Iterator[ForeignDrives]:
    """Serve an imitation; skips, and says why, where there is none.

    Args:
        name: As ``run.py`` has it.
        port: Of its bus; the next one is its control.
        folder: For its log.
    """
    if not FOLDER.is_dir():
        pytest.skip(f"no imitations of makers' drives here: {FOLDER} is missing")
    log = folder / f"{name}.log"
    command = [sys.executable, "-B", str(FOLDER / "run.py"), name, "--port", str(port)]
    with subprocess.Popen(
        [*command, "--log", str(log)], stdout=subprocess.PIPE, text=True
    ) as served:
        assert served.stdout is not None
        try:
            with suppress(PermissionError):  # they go by the wall clock, of a busy computer
                os.sched_setscheduler(served.pid, os.SCHED_FIFO, os.sched_param(10))
            yield ForeignDrives(served.stdout.readline().split()[1], port + 1, log)
        finally:
            served.kill()
