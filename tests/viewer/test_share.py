from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import duoglide as dg
from duoglide.control.channel.events import Condition, Reaction, RunState, Trip
from duoglide.control.host.run.handle import RunStatus
from duoglide.control.host.trace import Trace
from duoglide.drives.cia402 import State
from duoglide.viewer.join import JoinedRobot, find
from duoglide.viewer.share import meeting_place, share

CARRIAGES = dg.inverse(dg.Geometry(), (-41.0, 0.0, 302.0))
FAULT = Trip(Condition.FOLLOWING_ERROR, Reaction.QUICK_STOP, axis=2)
STATUS = RunStatus(RunState.HELD, 0.25, 0.5, (1.0, 2.0, 3.0), (0.1, -0.2, 0.3), 45.0, 0.6)


class Run:
    """A run that remembers its orders."""

    status = STATUS

    def __init__(self) -> None:
        self.orders: list[Any] = []

    def hold(self) -> None:
        self.orders.append("hold")

    def resume(self) -> None:
        self.orders.append("resume")

    def set_override(self, override: float) -> None:
        if not 0.0 <= override <= 1.0:
            raise dg.InputError(f"override = {override}")
        self.orders.append(override)


@pytest.fixture(autouse=True)
def runtime(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A place for sockets of our own; their names must be short."""
    with tempfile.TemporaryDirectory(prefix="dg") as folder:
        monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
        yield Path(folder)


@pytest.fixture
def robot() -> Any:
    stops: list[str] = []
    return SimpleNamespace(
        machine=dg.Machine(clearance=3.0), bus="virtual", homed=True,
        states=(State.OPERATION_ENABLED,) * 3, carriages=CARRIAGES, current_run=Run(),
        enabled=True, latched=(FAULT,), why_not_homed="", trace=Trace(dg.DriveSettings()),
        stops=stops, stop=lambda: stops.append("stop"),
    )  # fmt: skip


def test_a_joined_machine_shows_what_its_owner_sees(robot: Any) -> None:
    with share(robot):
        joined = JoinedRobot(find())
        assert joined.machine.to_dict() == robot.machine.to_dict()
        look = joined.look()
        assert (joined.bus, look.states, look.homed) == (robot.bus, robot.states, True)
        assert (look.enabled, look.latched) == (True, ("axis 2: following error",))
        assert look.carriages.tolist() == CARRIAGES.tolist()
        assert look.position is not None
        assert look.position.tolist() == pytest.approx([-41.0, 0.0, 302.0])
        run = joined.current_run
        assert run is not None
        assert run.status.state is RunState.HELD
        assert (run.status.lateness, run.status.override) == (STATUS.lateness, STATUS.override)
        robot.current_run = None
        assert joined.current_run is None


def test_orders_arrive_and_refusals_come_back(robot: Any) -> None:
    with share(robot) as path:
        joined = JoinedRobot(path)
        run = joined.current_run
        assert run is not None
        run.hold()
        run.set_override(0.3)
        run.resume()
        joined.stop()
        with pytest.raises(dg.BusError, match=r"override = 2\.0"):
            run.set_override(2.0)
    assert robot.current_run.orders == ["hold", 0.3, "resume"]
    assert robot.stops == ["stop"]
    with pytest.raises(dg.BusError, match="has ended"):
        joined.stop()


def test_a_stop_waits_behind_nobody(robot: Any) -> None:
    strangers = (socket.socket(socket.AF_UNIX), socket.socket(socket.AF_UNIX))
    with share(robot) as path, strangers[0] as silent, strangers[1] as rude:
        silent.connect(str(path))
        rude.connect(str(path))
        with socket.socket(socket.AF_UNIX) as gone:
            gone.connect(str(path))
            gone.sendall(b'{"do": "look"}\n')
        rude.sendall(b"[1, 2\n")
        assert b"not understood" in rude.recv(1000)
        JoinedRobot(path).stop()
    assert robot.stops == ["stop"]


def test_what_a_killed_program_leaves_behind_is_nobody() -> None:
    folder = meeting_place()
    code = "import socket, sys; s = socket.socket(socket.AF_UNIX); s.bind(sys.argv[1]); s.listen()"
    subprocess.run([sys.executable, "-c", code, str(folder / "7.sock")], check=True, timeout=600)
    with pytest.raises(
        dg.BusError, match=r"no process shares a machine; a duoglide stream, replay"
    ):
        find()
    assert not list(folder.iterdir())


def test_of_several_one_must_be_named(robot: Any) -> None:
    with share(robot) as path, socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path.with_name("7.sock")))
        other.listen()
        with pytest.raises(dg.BusError, match=r"say which: --pid .*7"):
            find()
        assert find(7).stem == "7"
        with pytest.raises(dg.BusError, match=r"process 8 shares none; these do: .*7"):
            find(8)


def test_without_a_runtime_folder_they_meet_among_temporary_files(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(runtime))
    for missing in ("", str(runtime / "none")):
        monkeypatch.setenv("XDG_RUNTIME_DIR", missing)
        assert meeting_place() == runtime / f"duoglide-{os.getuid()}"


def test_a_folder_that_others_can_enter_is_refused(runtime: Path, robot: Any) -> None:
    (runtime / "duoglide").mkdir(mode=0o755)
    with pytest.raises(dg.BusError, match="a folder of yours alone"), share(robot):
        pass
