"""The operator's part of the page: connect, home, run, hold, override, jog, and always Stop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.control.host.robot import Robot
from duoglide.control.host.run.handle import RunHandle, RunStatus
from duoglide.errors import InputError
from duoglide.storage.paths import inside, numbered
from duoglide.viewer.join import JoinedRobot, JoinedRun
from duoglide.viewer.motion_panel import MotionPanel
from duoglide.viewer.owner import Owner

if TYPE_CHECKING:
    from duoglide.machine import Machine

_IDLE = "Nothing runs."
_REFRESH = 0.1  # [s] between two looks at the machine
_UNTOUCHED = 1.0  # [s] after which the override follows what others make of it
_JOGS = {"-x": (0, -1.0), "+x": (0, 1.0), "-y": (1, -1.0), "+y": (1, 1.0), "-z": (2, -1.0)}
_JOGS["+z"] = (2, 1.0)


class MachinePanel:
    """A connected machine and its operator.

    Every button answers on a thread of its own; one command at a time moves the machine, and Stop
    waits for none of them. The cycle runs in another process, which nothing here can slow down.

    Args:
        server: The viser server.
        machine: The machine.
        drives: Name of the bus to offer; or a robot that somebody else has connected and runs, in
            this process or in another.
        motion: Where the trajectory to run comes from, what shows where the machine is, and below
            which folder runs are recorded.
        owner: Which page gives the orders.
    """

    def __init__(
        self,
        server: Any,
        machine: Machine,
        drives: str | Robot | JoinedRobot,
        motion: MotionPanel,
        owner: Owner,
    ) -> None:
        self._gui = server.gui
        self._machine, self._motion, self._pose = machine, motion, motion.pose
        self._owner, self._folder = owner, motion.folder
        self._own = isinstance(drives, str)
        self._robot: Robot | JoinedRobot | None = None if isinstance(drives, str) else drives
        bus = drives if isinstance(drives, str) else drives.bus
        self._one_command = threading.Lock()
        self._closed = threading.Event()
        self._touched = -_UNTOUCHED  # when the override was last moved here [s], monotonic
        self._creeping = False  # a small move of this page is under way, at a pace of its own
        self._add_operator()
        self._bus = self._gui.add_text("Bus", bus)
        self._button("Connect", self._connect)
        hint = "Needed where the drives do not know where they are; simulated ones need nobody"
        self._home_here = self._gui.add_checkbox("It stands in its home pose", False, hint=hint)
        self._button("Enable and home", self._bring_up)
        self._button("Reset fault", lambda robot: robot.reset_fault())
        self._button("Disable", lambda robot: robot.disable())
        with self._gui.add_folder("Run the loaded plan"):
            hint = f"Below {motion.folder}; under a number if that is there; empty: nowhere"
            self._log = self._gui.add_text("Log", "", hint=hint)
            self._button("Run", self._run)
        with self._gui.add_folder("Jog", expand_by_default=False):
            self._step = self._gui.add_number("Step [mm]", 5.0, min=0.01, step=0.5)
            jog = self._gui.add_button_group("Direction", tuple(_JOGS))
            jog.on_click(lambda _: self._command(lambda robot: self._jog(robot, jog.value)))
            self._button("Park", self._park)
        self._watching = threading.Thread(target=self._watch, name="page-watch", daemon=True)
        self._watching.start()

    def _add_operator(self) -> None:
        """Put what an operator must find at once into a window that does not scroll."""
        window = self._gui.add_panel()
        with window.add_tab("Operator"):
            hold = self._gui.add_button("Hold")
            hold.on_click(lambda _: self._to_run(lambda run: run.hold(), _IDLE))
            self._gui.add_button("Resume").on_click(
                lambda _: self._to_run(lambda run: run.resume(), _IDLE)
            )
            take = self._gui.add_button("Take over", hint="Give the orders from this page")
            take.on_click(self._take_over)
            self._owner.allow_all(hold, take)
            self._override = self._gui.add_slider("Override [%]", 0, 100, 1, 100)
            self._words = self._gui.add_markdown("Not connected." if self._own else "Live.")
            self._state = self._gui.add_markdown("")
        window.float(x=90.0, y=-15.0, width=330.0)
        self._override.on_update(self._overridden)

    def stop(self) -> None:
        """Stop whatever moves, along its path. Waits for nothing and needs nothing.

        Raises:
            DuoglideError: The order could not be given; the words say so too.
        """
        robot = self._robot
        if robot is None:
            return
        try:
            robot.stop()
        except Exception as error:
            self._say_error(error)
            raise
        self._words.content = "**Stopped by the operator.** Run again to go on."

    def close(self) -> None:
        """Stop and let go of the machine."""
        self._closed.set()
        self._watching.join()  # it must not write to a page that is served no more
        robot, self._robot = self._robot, None
        if self._own and isinstance(robot, Robot):
            robot.stop()
            with self._one_command:
                robot.close()

    # Commands

    def _button(self, label: str, work: Callable[[Robot], object]) -> None:
        self._gui.add_button(label).on_click(lambda _: self._command(work))

    def _command(self, work: Callable[[Any], object]) -> None:
        """Do one thing with the machine, and say how it went."""
        if isinstance(self._robot, JoinedRobot):
            self._words.content = "**Another process owns the machine.** Stop works all the same."
            return
        if not self._one_command.acquire(blocking=False):
            self._words.content = "The machine is busy; Stop works all the same."
            return
        try:
            if self._robot is None and work != self._connect:
                self._words.content = "**Not connected.** Connect first."
                return
            answer = work(self._robot)
            self._words.content = str(answer) if answer is not None else "Done."
        except Exception as error:  # whatever it is: an operator must see it
            self._say_error(error)
        finally:
            self._one_command.release()

    def _connect(self, robot: Robot | None) -> str:
        if robot is not None:
            return f"Connected to {robot.bus} already."
        self._words.content = "Connecting ..."
        self._robot = Robot.connect(self._machine, bus=self._bus.value)
        return f"Connected to {self._robot.bus}; the drives have no power yet."

    def _bring_up(self, robot: Robot) -> str:
        seen = bool(self._home_here.value)
        self._home_here.value = False  # what somebody saw once is not true for ever
        robot.require_reference(confirm=seen)
        robot.enable()
        robot.home(confirm=seen)
        return "Under power and homed."

    def _run(self, robot: Robot) -> str:
        trajectory = self._motion.trajectory
        if trajectory is None:
            return "**Nothing to run.** Plan a pick or open a plan in the Motion tab first."
        log = self._log_file()
        rate = max(self._override.value, 1) / 100.0
        self._pose.set_draggable(False)
        try:
            handle = robot.start(trajectory, log=log, approach=True, override=rate)
            self._words.content = "Running."
            report = handle.wait()
            return f"{report!r}" + (f"; log: {log}" if log is not None else "")
        finally:
            self._pose.set_draggable(True)

    def _log_file(self) -> Path | None:
        """Return where to record: below the folder, and never in the place of anything."""
        if not (name := self._log.value.strip()):
            return None
        file = inside(self._folder, name)
        if file.suffix != ".mcap":
            raise InputError(f"{name:.80}: a run is recorded in a file that ends in .mcap")
        return numbered(file)

    def _jog(self, robot: Robot, direction: str) -> str:
        axis, sign = _JOGS[direction]
        step = np.zeros(3)
        step[axis] = sign * self._step.value
        return self._creep(robot, lambda: robot.jog(step))

    def _park(self, robot: Robot) -> str:
        return self._creep(robot, robot.park)

    def _creep(self, robot: Robot, move: Callable[[], object]) -> str:
        """Make a small move, whose pace is not that of the next run."""
        self._creeping = True
        try:
            move()
        finally:
            self._creeping = False
        x, y, z = robot.position
        return f"At ({x:.2f}, {y:.2f}, {z:.2f}) mm."

    def _to_run(self, order: Callable[[RunHandle | JoinedRun], None], idle: str = "") -> None:
        """Give a run an order; say ``idle`` where nothing runs."""
        try:
            run = self._robot.current_run if self._robot is not None else None
            if run is not None:
                order(run)
            elif idle:
                self._words.content = idle
        except Exception as error:
            self._say_error(error)

    def _take_over(self, event: Any) -> None:
        self._owner.take_over(event.client_id)
        self._words.content = "Another page gives the orders now."

    def _say_error(self, error: Exception) -> None:
        self._words.content = f"**{type(error).__name__}.** {error}"

    def _overridden(self, event: Any) -> None:
        if event.client is not None:
            self._touched = time.monotonic()
            self._to_run(lambda handle: handle.set_override(self._override.value / 100.0))

    # Looking

    def _watch(self) -> None:
        """Show where the machine is, a few times a second; runs on a thread of its own."""
        while not self._closed.wait(_REFRESH):
            robot = self._robot
            if robot is None:
                continue
            try:
                status = run.status if (run := robot.current_run) is not None else None
                self._state.content = _describe(robot, status)
                if status is not None and not self._creeping:
                    self._follow_override(status.override)
                if robot.homed:
                    self._pose.follow(robot.position)
            except (
                Exception
            ) as error:  # whatever it is: a page must not show the past as the present
                self._state.content = f"**{type(error).__name__}.** {error}"

    def _follow_override(self, override: float) -> None:
        """Show the override that another page or process has chosen, not under a moving hand."""
        percent = round(100.0 * override)
        untouched = time.monotonic() - self._touched > _UNTOUCHED
        if untouched and round(self._override.value) != percent:
            self._override.value = percent


def _describe(robot: Robot | JoinedRobot, status: RunStatus | None) -> str:
    """Return the machine's state in Markdown."""
    rows = [
        f"| {number} | {state.name.replace('_', ' ').lower()} | {place:.3f} |"
        for number, (state, place) in enumerate(
            zip(robot.states, robot.carriages, strict=True), start=1
        )
    ]
    table = "| axis | drive | mm |\n|---|---|---|\n" + "\n".join(rows)
    if status is None:
        return table
    worst = max(abs(error) for error in status.following_error)
    return (
        f"**{status.state.name.lower()}** at {status.path_time:.3f} s, rate {status.rate:.2f}, "
        f"following error {worst:.3f} mm, lateness {status.lateness:.0f} us\n\n{table}"
    )
