"""The part of the page that plans, opens plans and runs, and scrubs through them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.errors import DuoglideError
from duoglide.planning.plan import plan
from duoglide.planning.programs.pick_and_place import pick_and_place
from duoglide.storage.paths import inside
from duoglide.viewer.mechanism import METRES
from duoglide.viewer.planner import Planner
from duoglide.viewer.pose_panel import PosePanel
from duoglide.viewer.recording import Recording, load_recording, recording_of
from duoglide.viewer.strip import Strip

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from duoglide.machine import Machine
    from duoglide.planning.trajectory import Trajectory

_FRAME = 1.0 / 30.0  # [s] between two pictures while playing
_NEAR, _FAR = np.array([213, 30, 60]), np.array([0, 130, 200])  # at a bound, at ease
_EASE = 40.0  # [mm] above the machine's clearance
_LOOSE = 10.0  # [mm] above the machine's carriage margin


Loaded: TypeAlias = "tuple[Recording, Trajectory | None]"


def plan_pick(
    machine: Machine, pick: ArrayLike, place: ArrayLike, lift: float, tolerance: float
) -> Loaded:
    """Plan a pick; what the page has done in another process."""
    trajectory = plan(machine, pick_and_place(pick, place, lift=lift, tolerance=tolerance))
    return recording_of(trajectory), trajectory


class MotionPanel:
    """Plan a pick, open a file, scrub its timeline, see the carriages against their limits.

    Args:
        server: The viser server.
        machine: The machine that is shown.
        pose: What shows a position.
        folder: Where the files are that may be opened.
    """

    def __init__(self, server: Any, machine: Machine, pose: PosePanel, folder: Path) -> None:
        self.folder, self._planner = folder, Planner()
        self._server, self._gui = server, server.gui
        self._machine = machine
        self.pose = pose
        self._recording: Recording | None = None
        self._plots: list[Strip] = []
        self._path: Any = None
        self._closed = threading.Event()
        self._one = threading.Lock()
        self.trajectory: Trajectory | None = None
        with self._gui.add_folder("Plan a pick"):
            self._pick = self._gui.add_vector3("Pick [mm]", (-41.0, -152.5, 295.0), step=0.5)
            self._place = self._gui.add_vector3("Place [mm]", (-41.0, 152.5, 295.0), step=0.5)
            self._lift = self._gui.add_number("Lift [mm]", 25.0, step=0.5)
            self._tolerance = self._gui.add_number("Corner tolerance [mm]", 2.0, step=0.1)
            self._gui.add_button("Plan").on_click(lambda _: self._plan())
        with self._gui.add_folder("Open a plan or a run", expand_by_default=False):
            self._file = self._gui.add_text("File", "run.mcap", hint=f"Below {folder}")
            self._gui.add_button("Open").on_click(lambda _: self._open_named())
        self._words = self._gui.add_markdown("Nothing is loaded.")
        self._key = self._gui.add_html(_colour_key(machine), visible=False)
        self._time = self._gui.add_slider("Time [s]", 0.0, 1.0, 0.001, 0.0, disabled=True)
        self._play = self._gui.add_checkbox("Play", False, disabled=True)
        self._graphs = self._gui.add_folder("Over time")
        self._time.on_update(self._scrubbed)
        threading.Thread(target=self._play_along, name="page-play", daemon=True).start()

    def close(self) -> None:
        """End the playing and the planning."""
        self._closed.set()
        self._planner.close()

    def open(self, file: Path) -> None:
        """Open a plan or a run; what is wrong with it is said on the page."""
        self._attempt(f"Opening {file.name} ...", lambda: load_recording(file))

    def _open_named(self) -> None:
        """Open what the page asks for; in another process, which a large file keeps busy."""
        name = self._file.value
        self._attempt(
            "Opening ...", lambda: self._planner.do(load_recording, inside(self.folder, name))
        )

    def _plan(self) -> None:
        shape = self._pick.value, self._place.value, self._lift.value, self._tolerance.value
        self._attempt("Planning ...", lambda: self._planner.do(plan_pick, self._machine, *shape))

    def _attempt(self, doing: str, work: Callable[[], Loaded]) -> None:
        """Do ``work`` and show what comes out, or say why nothing does; one at a time."""
        if not self._one.acquire(blocking=False):
            return  # the words say what is being done
        try:
            self._words.content = doing
            recording, trajectory = work()
            self._show(recording)
            self.trajectory = trajectory
        except DuoglideError as error:
            self._words.content = f"**Refused.** {error}"
        except Exception as error:  # a page that cannot say what went wrong says nothing at all
            self._words.content = f"**{type(error).__name__}.** {error}"
        finally:
            self._one.release()

    def _show(self, recording: Recording) -> None:
        self._recording = recording
        end = float(recording.times[-1])
        self._time.max, self._time.step = max(end, 1e-3), max(end / 2000.0, 1e-4)
        self._time.value = 0.0
        self._time.disabled = self._play.disabled = False
        self._words.content = recording.words
        self._key.visible = True
        self._draw_path(recording)
        self._draw_plots(recording)
        self.pose.follow(recording.positions[0])

    def _draw_path(self, recording: Recording) -> None:
        if self._path is not None:
            self._path.remove()
            self._path = None
        points, machine = recording.positions, self._machine
        if len(points) < 2:
            return
        room = (recording.clearances - machine.clearance) / _EASE
        loose = (recording.margins - machine.carriage_margin) / _LOOSE
        ease = np.clip(np.minimum(room, loose), 0.0, 1.0)[:, None]
        colours = (_NEAR + ease * (_FAR - _NEAR)).astype(np.uint8)
        self._path = self._server.scene.add_line_segments(
            "/path",
            points=np.stack([points[:-1], points[1:]], axis=1) * METRES,
            colors=np.stack([colours[:-1], colours[1:]], axis=1),
            thickness=4.0,
            thickness_units="screen",
        )

    def _draw_plots(self, recording: Recording) -> None:
        for plot in self._plots:
            plot.remove()
        times, machine = recording.times, self._machine
        bound = float(machine.limits.velocity.max()) * 1e-3
        clearances, margins = recording.clearances[:, None], recording.margins[:, None]
        with self._graphs:
            self._plots = [
                self._plot("Carriages [mm]", times, recording.carriages),
                self._plot("Velocity [m/s]", times, recording.velocities * 1e-3, (bound, -bound)),
                self._plot("Clearance [mm]", times, clearances, (machine.clearance,)),
                self._plot("Carriage margin [mm]", times, margins, (machine.carriage_margin,)),
            ]

    def _plot(
        self, title: str, times: FloatArray, values: FloatArray, bounds: tuple[float, ...] = ()
    ) -> Strip:
        many = values.shape[1] > 1
        data = times, values
        return Strip(self._gui, title, carriages=many, bounds=bounds, data=data, sync="plan")

    def _scrubbed(self, event: Any) -> None:
        if event.client is not None:
            self._show_time(float(self._time.value))

    def _show_time(self, t: float) -> None:
        recording = self._recording
        if recording is not None:
            self.pose.follow(recording.position_at(t))

    def _play_along(self) -> None:
        """Move the timeline on while Play is ticked; runs on a thread of its own."""
        while not self._closed.wait(_FRAME):
            recording = self._recording
            if recording is None or not self._play.value:
                continue
            end = float(recording.times[-1])
            begun = time.monotonic() - (self._time.value if self._time.value < end else 0.0)
            while self._play.value and not self._closed.wait(_FRAME):
                now = min(time.monotonic() - begun, end)
                self._time.value = now
                self._show_time(now)
                if now >= end:
                    self._play.value = False


def _colour_key(machine: Machine) -> str:
    """Return the scale of the path's colours in HTML: the worse of clearance and margin counts."""
    near, far = (f"rgb({', '.join(map(str, colour))})" for colour in (_NEAR, _FAR))
    bounds = machine.clearance, machine.carriage_margin
    names, eases = ("clearance", "carriage margin"), (_EASE, _LOOSE)
    at_bound = "<br>".join(f"{name} {b:g} mm" for name, b in zip(names, bounds, strict=True))
    at_ease = "<br>".join(f"{b + e:g} mm and more" for b, e in zip(bounds, eases, strict=True))
    return (
        f'<div id="duoglide-key"><div style="background: linear-gradient(90deg, {near}, {far})">'
        f"</div><p>{at_bound}</p><p>{at_ease}</p></div>"
    )
