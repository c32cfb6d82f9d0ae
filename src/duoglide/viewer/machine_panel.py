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
from duoglide.control.host.run.report import RunReport
from duoglide.errors import DuoglideError, InputError
from duoglide.storage.paths import inside, numbered
from duoglide.viewer.door import News
from duoglide.viewer.join import JoinedRobot, JoinedRun
from duoglide.viewer.live_panel import LivePanel
from duoglide.viewer.look import Look
from duoglide.viewer.motion_panel import MotionPanel
from duoglide.viewer.owner import Owner
from duoglide.viewer.situation import Allowed, Situation

if TYPE_CHECKING:
    from duoglide.machine import Machine

_IDLE = "Nothing runs."
_REFRESH = 0.1  # [s] between two looks at the machine
_UNTOUCHED = 1.0  # [s] after which the override follows what others make of it
_STEPS = ("0.1", "1", "10")  # [mm]
_LET_GO = 1.0  # [s] without a step after which the next one is another press of the button


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
        live: What shows what the machine does.
        owner: Which page gives the orders.
        news: What the banner above the page says.
    """

    def __init__(
        self,
        server: Any,
        machine: Machine,
        drives: str | Robot | JoinedRobot,
        *,
        motion: MotionPanel,
        live: LivePanel,
        owner: Owner,
        news: News,
    ) -> None:
        self._gui = server.gui
        self._machine, self._motion, self._pose = machine, motion, motion.pose
        self._owner, self._folder, self._news = owner, motion.folder, news
        self._live = live
        self._own = isinstance(drives, str)
        self._robot: Robot | JoinedRobot | None = None if isinstance(drives, str) else drives
        bus = drives if isinstance(drives, str) else drives.bus
        self._one_command = threading.Lock()
        self._closed = threading.Event()
        self._touched = -_UNTOUCHED  # when the override was last moved here [s], monotonic
        self._creeping = False  # a small move of this page is under way, at a pace of its own
        self._busy, self._ended = "", ""  # see Situation
        self._stepped, self._refuses_steps = -_LET_GO, False
        self._buttons: dict[str, list[Any]] = {name: [] for name in Allowed._fields}
        self._add_operator()
        self._bus = self._gui.add_text("Bus", bus)
        self._button("connect", "Connect", self._connect, "Connecting")
        hint = "Needed where the drives do not know where they are; simulated ones need nobody"
        self._home_here = self._gui.add_checkbox("It stands in its home pose", False, hint=hint)
        self._button("bring_up", "Enable and home", self._bring_up, "Homing")
        with self._gui.add_folder("Run the loaded plan"):
            hint = f"Below {motion.folder}; under a number if that is there; empty: nowhere"
            self._log = self._gui.add_text("Log", "", hint=hint)
            self._button("run", "Run", self._run, "Getting ready", color="green")
        self._button("small_moves", "Park", self._park, "Parking")
        self._button("reset", "Reset fault", Robot.reset_fault, "Resetting", color="orange")
        self._button("disable", "Disable", Robot.disable, "Switching off", color="gray")
        self._state = self._gui.add_markdown("")
        self._allow(self._situation(None))
        self._watching = threading.Thread(target=self._watch, name="page-watch", daemon=True)
        self._watching.start()

    def _add_operator(self) -> None:
        """Put what an operator must find at once into a window that does not scroll."""
        window = self._gui.add_panel()
        with window.add_tab("Operator"):
            hold = self._order("hold", "Hold", "yellow", lambda run: run.hold())
            self._order("resume", "Resume", "green", lambda run: run.resume())
            self._take = self._gui.add_button("Take over", hint="Give the orders from this page")
            self._take.on_click(self._take_over)
            self._owner.allow_all(hold, self._take)
            self._override = self._gui.add_slider("Override [%]", 0, 100, 1, 100)
            self._words = self._gui.add_markdown("Not connected." if self._own else "Live.")
            self._course = self._gui.add_markdown("")
        with window.add_tab("Jog"):
            self._add_jog()
        window.float(x=15.0, y=-15.0, width=330.0)
        self._override.on_update(self._overridden)

    def _add_jog(self) -> None:
        self._where = self._gui.add_markdown("Not connected.")
        self._pairs: list[Any] = []
        self._step = 1.0
        step = self._gui.add_button_group("Step: 1 mm", _STEPS)

        def choose(_: Any) -> None:
            self._step = float(step.value)
            step.label = f"Step: {step.value} mm"

        step.on_click(choose)
        for axis, name in enumerate("xyz"):
            pair = self._gui.add_button_group(name, (f"-{name}", f"+{name}"))
            pair.on_click(lambda event, axis=axis: self._pressed(axis, event.target.value))
            self._pairs.append(pair)
        self._gui.add_markdown("Hold a button to go on; arrow keys: y and x, page keys: z.")

    def stop(self) -> None:
        """Stop whatever moves, along its path. Waits for nothing and needs nothing.

        Raises:
            DuoglideError: The order could not be given; the words say so too.
        """
        self._refuses_steps = True
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

    def _button(
        self,
        name: str,
        label: str,
        work: Callable[[Robot], object],
        doing: str,
        color: str | None = None,
    ) -> None:
        button = self._gui.add_button(label, color=color)
        button.on_click(lambda _: self._command(work, doing))
        self._buttons[name].append(button)

    def _order(
        self, name: str, label: str, color: str, order: Callable[[RunHandle | JoinedRun], None]
    ) -> Any:
        button = self._gui.add_button(label, color=color)
        button.on_click(lambda _: self._to_run(order, _IDLE))
        self._buttons[name].append(button)
        return button

    def _command(self, work: Callable[[Any], object], doing: str = "Busy") -> None:
        """Do one thing with the machine, and say how it went.

        Args:
            work: What to do.
            doing: What the banner says meanwhile.
        """
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
            self._busy = doing
            answer = work(self._robot)
            self._words.content = str(answer) if answer is not None else "Done."
        except Exception as error:  # whatever it is: an operator must see it
            self._say_error(error)
        finally:
            self._busy = ""
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
        self._ended = ""
        self._pose.set_draggable(False)
        try:
            handle = robot.start(trajectory, log=log, approach=True, override=rate)
            self._words.content = "Running."
            report = handle.wait()
        finally:
            self._pose.set_draggable(True)
        self._ended = "" if report.completed else report.ending
        return _describe_report(report)

    def _log_file(self) -> Path | None:
        """Return where to record: below the folder, and never in the place of anything."""
        if not (name := self._log.value.strip()):
            return None
        file = inside(self._folder, name)
        if file.suffix != ".mcap":
            raise InputError(f"{name:.80}: a run is recorded in a file that ends in .mcap")
        return numbered(file)

    def _pressed(self, axis: int, label: str) -> None:
        """Make a step; pages ask for one after the other while a button is held.

        What was held when the machine was stopped moves it no more until it is pressed again.
        """
        now = time.monotonic()
        if now - self._stepped > _LET_GO:
            self._refuses_steps = False
        self._stepped = now
        if self._refuses_steps or self._busy:
            return
        step = np.zeros(3)
        step[axis] = self._step if label.startswith("+") else -self._step
        self._command(lambda robot: self._creep(robot, lambda: robot.jog(step)), "Moving")

    def _park(self, robot: Robot) -> str:
        return self._creep(robot, robot.park)

    def _creep(self, robot: Robot, move: Callable[[], object]) -> str:
        """Make a small move, whose pace is not that of the next run."""
        self._creeping, self._ended = True, ""
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
        self._words.content = _words_of(error)

    def _overridden(self, event: Any) -> None:
        if event.client is not None:
            self._touched = time.monotonic()
            self._to_run(lambda handle: handle.set_override(self._override.value / 100.0))

    # Looking

    def _watch(self) -> None:
        """Show where the machine is, a few times a second; runs on a thread of its own."""
        while not self._closed.wait(_REFRESH):
            try:
                look, blind = self._look(), ""
                if self._robot is not None:
                    self._live.follow(self._robot)
            except (
                Exception
            ) as error:  # whatever it is: a page must not show the past as the present
                look, blind = None, _words_of(error)
                self._state.content = blind
            self._allow(self._situation(look, blind))
            if look is not None:
                self._show(look)

    def _look(self) -> Look | None:
        robot = self._robot
        if robot is None:
            return None
        return robot.look() if isinstance(robot, JoinedRobot) else Look.at(robot)

    def _situation(self, look: Look | None, blind: str = "") -> Situation:
        return Situation(
            own=not isinstance(self._robot, JoinedRobot),
            look=look,
            blind=blind.replace("**", ""),
            busy=self._busy,
            loaded=self._motion.trajectory is not None,
            ended=self._ended,
        )

    def _allow(self, situation: Situation) -> None:
        """Say in the banner how it is, and switch off the buttons that cannot act."""
        self._news.tell(situation.banner._asdict())
        for name, allowed in situation.allowed._asdict().items():
            for button in self._buttons[name]:
                if button.disabled == allowed:
                    button.disabled = not allowed
        _set_visible(self._take, not self._owner.is_alone)
        for pair in self._pairs:  # viser does not switch such buttons off; a held one must stay
            _set_visible(pair, situation.allowed.small_moves or self._creeping)

    def _show(self, look: Look) -> None:
        status, position = look.run, look.position
        _write(self._state, _describe(look))
        _write(self._course, _describe_run(status) if status is not None else "")
        _write(self._where, _describe_place(look))
        if status is not None and not self._creeping:
            self._follow_override(status.override)
        if position is not None:
            self._pose.follow(position)

    def _follow_override(self, override: float) -> None:
        """Show the override that another page or process has chosen, not under a moving hand."""
        percent = round(100.0 * override)
        untouched = time.monotonic() - self._touched > _UNTOUCHED
        if untouched and round(self._override.value) != percent:
            self._override.value = percent


def _set_visible(element: Any, visible: bool) -> None:
    if element.visible != visible:
        element.visible = visible


def _write(place: Any, words: str) -> None:
    """Change a text, where it is another one: what does not change need not be sent."""
    if place.content != words:
        place.content = words


def _words_of(error: Exception) -> str:
    """Say what went wrong; the name of its class only where a programmer has to look."""
    name = "Not done" if isinstance(error, DuoglideError) else type(error).__name__
    return f"**{name}.** {error}"


def _describe(look: Look) -> str:
    """Return the machine's state in Markdown."""
    rows = [
        f"| {number} | {state.words} | {place:.3f} |"
        for number, (state, place) in enumerate(
            zip(look.states, look.carriages.tolist(), strict=True), start=1
        )
    ]
    return "| carriage | drive | mm |\n|---|---|---|\n" + "\n".join(rows)


def _describe_run(status: RunStatus) -> str:
    worst = max(abs(error) for error in status.following_error)
    word = status.state.name.capitalize()
    return (
        f"**{word}** at {status.path_time:.2f} s, speed {100.0 * status.rate:.0f} %, following"
        f" error {worst:.3f} mm, lateness {status.lateness:.0f} µs"
    )


def _describe_place(look: Look) -> str:
    """Say whether the platform's place is known, and where it is."""
    if look.position is None:
        return f"**Not homed**: {look.why_not_homed}."
    x, y, z = look.position.tolist()
    power = "" if look.enabled else " **No power.**"
    return f"**Homed.** At x {x:.2f}, y {y:.2f}, z {z:.2f} mm.{power}"


def _describe_report(report: RunReport) -> str:
    """Say how a run went."""
    late = report.lateness
    words = (
        f"**{report.ending[:1].upper()}{report.ending[1:]}**, {report.duration:.2f} s;"
        f" worst following error {max(report.following_error):.3f} mm,"
        f" worst lateness {late.worst:.0f} µs"
    )
    faults = "".join(f"\n\n**{trip.words}**" for trip in report.faults)
    remarks = "".join(f"\n\n{remark}" for remark in report.remarks)
    log = f"\n\nLog: {report.log}" if report.log is not None else ""
    return words + faults + remarks + log
