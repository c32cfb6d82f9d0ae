"""What the machine is doing, as strips over the last ten seconds, and what has happened to it."""

from __future__ import annotations

import html
import time
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import FloatArray
from duoglide.control.host.trace import KEPT, ROW, TraceEvent, TraceRow
from duoglide.kinematics.carriage_margin import carriage_margin
from duoglide.kinematics.headroom.room import locate
from duoglide.viewer.mechanism import METRES
from duoglide.viewer.strip import Strip

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.machine import Machine
    from duoglide.viewer.join import JoinedRobot

_JOINED = 4  # rows that are put together in a strip, so that a page is sent 250 points of each
_REDRAW = 0.3  # [s] between two pictures of the strips
_SETTLING = 0.5  # [s] of rest that is shown after a run
_EVENTS = 300
_DONE = 4000  # points of the path done, at most
_LOUD = ("fault", "emergency", "timeout", "bus", "quick_stop", "lost", "late")


class LivePanel:
    """The strips, the events and the path done; fed by whoever watches the machine.

    They stand still where nothing runs, so that a run can be looked at after it.

    Args:
        server: The viser server.
        machine: The machine that is shown.
    """

    def __init__(self, server: Any, machine: Machine) -> None:
        self._machine, self._scene = machine, server.scene
        self._rows: deque[TraceRow] = deque(maxlen=round(KEPT / ROW))
        self._margins: deque[float] = deque(maxlen=round(KEPT / ROW))
        self._places: list[FloatArray] = []
        self._events: deque[TraceEvent] = deque(maxlen=_EVENTS)
        self._row = self._event = 0  # the newest that has been seen
        self._began = self._rested = 0.0
        self._drawn, self._stale = 0.0, False
        self._done: Any = None
        gui = server.gui
        self._words = gui.add_markdown("The strips move while something runs.")
        needed = machine.carriage_margin
        self._strips = [
            Strip(gui, "Following error [mm]", carriages=True, least=(-0.01, 0.01)),
            Strip(gui, "Velocity [% of its limit]", carriages=True, bounds=(-100.0, 100.0)),
            Strip(gui, f"Carriage margin [mm], {needed:g} needed", bounds=(needed,)),
            Strip(gui, "Lateness of cycles [µs], the worst", least=(0.0, 100.0)),
        ]
        gui.add_markdown("**Events**, the newest first")
        self._list = gui.add_html(_table(self._events))

    def follow(self, robot: Robot | JoinedRobot) -> None:
        """Take what is new of a machine, and draw it now and then.

        Raises:
            DuoglideError: The machine's owner has ended.
        """
        trace = robot.trace
        events = trace.events(self._event)
        if events:
            self._event = events[-1].number
            self._events.extend(events)
            self._list.content = _table(self._events)
        rows = trace.rows(self._row)
        if rows:
            self._row = rows[-1].number
            self._take(rows)
        if self._stale and time.monotonic() - self._drawn > _REDRAW:
            self._draw()

    def _take(self, rows: list[TraceRow]) -> None:
        """Keep the rows of a run, with what the kinematics make of them."""
        kept = []
        for row in rows:
            if row.moving:
                if row.time - self._rested > _SETTLING:
                    self._begin(row.time)
                self._rested = row.time
            if row.time - self._rested <= _SETTLING:
                kept.append(row)
        if not kept:
            return
        carriages = np.array([row.carriages for row in kept])
        position, closed = locate(self._machine, carriages)
        margin = np.full(len(kept), np.nan)
        margin[closed] = carriage_margin(self._machine.geometry, position[closed])
        self._rows.extend(kept)
        self._margins.extend(margin.tolist())
        self._places.extend(position[closed])
        if len(self._places) > _DONE:
            del self._places[1::2]
        self._stale = True

    def _begin(self, now: float) -> None:
        """Begin with a new run: what there was before it goes."""
        self._began = now
        self._rows.clear()
        self._margins.clear()
        self._places.clear()

    def _draw(self) -> None:
        self._drawn, self._stale = time.monotonic(), False
        rows = list(self._rows)[len(self._rows) % _JOINED :]
        if len(rows) < 2 * _JOINED:
            return
        times = np.array([row.time for row in rows]) - self._began
        carriages = np.array([row.carriages for row in rows])
        errors = np.array([row.following_error for row in rows])
        late = np.array([row.lateness for row in rows])
        margins = np.array(self._margins)[-len(rows) :]
        use = 100.0 * _slopes(times, carriages) / self._machine.limits.velocity
        joined = times[_JOINED - 1 :: _JOINED]
        following, velocity, margin, lateness = self._strips
        following.draw(joined, _worst(errors))
        velocity.draw(joined, _worst(use))
        margin.draw(joined, -_worst(-margins[:, None], signed=True))
        lateness.draw(joined, _worst(late[:, None]))
        self._words.content = f"Last **{joined[-1] - joined[0]:.1f} s** of a run."
        self._draw_path()

    def _draw_path(self) -> None:
        """Draw where the platform has been."""
        if len(self._places) < 2:
            return
        places = np.array(self._places) * METRES
        points = np.stack([places[:-1], places[1:]], axis=1)
        self._done = self._scene.add_line_segments(
            "/done", points=points, colors=(240, 170, 0), thickness=7.0, thickness_units="screen"
        )


def _slopes(times: FloatArray, values: FloatArray) -> FloatArray:
    """Return how fast values (n, 3) change; between rows, and the first as the second."""
    steps = np.maximum(np.diff(times), 1e-6)[:, None]
    slopes = np.diff(values, axis=0) / steps
    return np.concatenate([slopes[:1], slopes])


def _worst(values: FloatArray, *, signed: bool = False) -> FloatArray:
    """Return of every few rows (n, k) the one that is farthest from 0, or the greatest."""
    groups = values.reshape(-1, _JOINED, values.shape[1])
    by = groups if signed else np.abs(groups)
    with np.errstate(invalid="ignore"):
        rows = np.argmax(np.nan_to_num(by, nan=-np.inf), axis=1)
    return np.take_along_axis(groups, rows[:, None, :], axis=1)[:, 0, :]


def _table(events: deque[TraceEvent]) -> str:
    """Return events as a table that scrolls by itself."""
    offset = time.time() - time.monotonic()
    rows = "".join(_row(event, offset) for event in reversed(events))
    inside = rows or "<tr><td>Nothing yet.</td></tr>"
    return '<div id="duoglide-events"><table><tbody>' + inside + "</tbody></table></div>"


def _row(event: TraceEvent, offset: float) -> str:
    at = event.time + offset
    clock = time.strftime("%H:%M:%S", time.localtime(at)) + f"{at % 1.0:.3f}"[1:]
    loud = ' class="duoglide-loud"' if event.kind in _LOUD else ""
    return f"<tr{loud}><td>{clock}</td><td>{html.escape(event.text)}</td></tr>"
