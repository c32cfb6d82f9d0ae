"""The live 3D page: the mechanism, plans and logs, and the running machine, in a browser.

Hold, resume and override stand in one window of their own. Stop is above everything, and on the
space bar (``door``).
"""

from __future__ import annotations

import importlib
import io
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from duoglide.errors import BusError, ConfigError
from duoglide.viewer.address import require_address, require_port
from duoglide.viewer.door import Door, Gate, News
from duoglide.viewer.live_panel import LivePanel
from duoglide.viewer.machine_panel import MachinePanel
from duoglide.viewer.mechanism import Mechanism
from duoglide.viewer.motion_panel import MotionPanel
from duoglide.viewer.owner import Owner
from duoglide.viewer.pose_panel import PosePanel
from duoglide.viewer.stage import set_stage
from duoglide.viewer.surfaces import Surfaces

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.machine import Machine
    from duoglide.viewer.join import JoinedRobot

LOOPBACK = "127.0.0.1"


class Page:
    """A page that is served until it is closed.

    Args:
        machine: The machine to show.
        file: A plan or a run to open with.
        drives: Name of the bus where Connect finds the drives; or a connected robot, of this
            process or of another one, which the page then shows and can hold and stop, and which
            stays its owner's to close.
        host: Address to serve on; only this machine by default.
        port: TCP port; 0 takes any that is free.
        folder: What the page may open and record is below that; None: where the process runs.

    Raises:
        ConfigError: viser is not installed.
        BusError: The address is not this computer's, or the port is taken.
        LogError: The file cannot be read.
    """

    def __init__(
        self,
        machine: Machine,
        *,
        file: Path | None = None,
        drives: str | Robot | JoinedRobot = "virtual",
        host: str = LOOPBACK,
        port: int = 8080,
        folder: Path | None = None,
    ) -> None:
        viser = _viser()
        below = folder or Path.cwd()
        require_address(host, port)
        self._host = host
        news = News()
        self._door = Door(Gate(host), self.stop, news)
        try:
            with _unannounced(), self._door.before_viser():
                self._server = viser.ViserServer(
                    host=host, port=port, label="Duoglide", verbose=False
                )
        except OSError as error:
            raise BusError(f"cannot serve the page on {host}:{port}: {error}") from error
        try:
            require_port(host, port, self._server.get_port())
        except BusError:
            self._server.stop()
            raise
        owner = Owner(self._refuse)
        owner.guard(self._server)
        set_stage(self._server, machine.geometry)
        gui = self._server.gui
        gui.configure_theme(show_share_button=False)
        tabs = gui.add_tab_group()
        mechanism = Mechanism(self._server.scene, machine.geometry, machine.carriage_width)
        with tabs.add_tab("Pose"):
            self._pose = PosePanel(self._server, machine, mechanism)
            self._surfaces = Surfaces(self._server, machine)
        with tabs.add_tab("Motion"):
            self._motion = MotionPanel(self._server, machine, self._pose, below)
        machine_tab = tabs.add_tab("Machine")
        with tabs.add_tab("Live"):
            live = LivePanel(self._server, machine)
        with machine_tab:
            self._machine = MachinePanel(
                self._server,
                machine,
                drives,
                motion=self._motion,
                live=live,
                owner=owner,
                news=news,
            )
        if file is not None:
            self._motion.open(file)

    @property
    def address(self) -> str:
        """Where a browser finds the page; whoever has all of it is let in."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"http://{host}:{self._server.get_port()}/{self._door.gate.token}/"

    def stop(self) -> None:
        """Do what the Stop button does."""
        self._machine.stop()

    def close(self) -> None:
        """Stop the machine if it moves, and stop serving."""
        self._door.close()
        self._motion.close()
        self._machine.close()
        with _unannounced():
            self._server.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _refuse(self, page: int, reason: str) -> None:
        """Tell one page why it was not listened to."""
        client = self._server.get_clients().get(page)
        if client is not None:
            client.add_notification("Not done", reason, auto_close_seconds=6.0)


def _unannounced() -> redirect_stdout[io.StringIO]:
    """Keep what viser prints from the standard output, where results are."""
    return redirect_stdout(io.StringIO())


def _viser() -> Any:
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        raise ConfigError(
            "the page needs viser, which is not installed: pip install 'duoglide[view]'"
        ) from error
