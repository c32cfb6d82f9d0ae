"""The fault matrix, printed: ``python tests/benchmarks/fault_matrix.py [WORD ...]``.

Each fault is injected in the middle of a logged run at full speed along a path of five lines and
four rounded corners, mostly by a proxy between the host and the hub that knows nothing of either
(``tests/support/bus_proxy.py``). The host takes the simulated drives for real ones: it does not
wait for them when the computer stands still. *Cycles*: from the news in the log to the first frame
that differs. *Off path*: how far the platform was from the planned path at the worst, until
everything stood, by what the simulated carriages really did; ``apart`` where they were where the
links cannot close. With words on the command line, only faults whose names have one of them.


Where the host itself is killed, frozen or told to end it is a process of its own
(``tests/support/host_process.py``). With ``--write FILE`` the tables of a page in Markdown become
those of this run: the first one gets the faults of a moving machine, the second those of files.

The exit code is 1 where a reaction is not the one that is expected.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import file_attacks
import page_attacks
from bus_proxy import Act, BusProxy, Frame, Spoiler, Way
from host_process import HostProcess
from page_attacks import Target

import duoglide as dg
from duoglide.control.host.run.handle import RunHandle
from duoglide.drives.cia402 import State
from duoglide.drives.simulation import faults
from duoglide.drives.simulation.faults import Injection
from duoglide.drives.simulation.rack import DriveSnapshot
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages
from duoglide.storage import CycleRecord, EventKind, Log, LogWarning, Phase, Topic, read_log
from duoglide.viewer.page import Page

MACHINE = dg.Machine.default()
MM = round(MACHINE.drives.increments_per_mm[0])
CORNERS = (
    (0.0, -120.0, 300.0),
    (60.0, -60.0, 330.0),
    (-60.0, -10.0, 320.0),
    (-41.0, 60.0, 280.0),
    (50.0, 110.0, 340.0),
    (0.0, 150.0, 300.0),
)
PATH = dg.Path.polyline(CORNERS, tolerance=5.0)
WHEN = 0.4  # share of the run at which a fault comes
QUICK_STOP, ENABLED = 0x0002, 0x000F
NEWS = (EventKind.FAULT, EventKind.EMERGENCY, EventKind.BUS, EventKind.QUICK_STOP, EventKind.STOP)

COMPLETED, STOPPED, QUICK = "completed", "stop on the path", "quick stop"
FOLLOWED = "follows the drive"
WATCHDOGS = "drives' watchdogs"
REFUSED, HARMLESS = "refused", "derived again"
ANY_STOP = frozenset({STOPPED, QUICK, FOLLOWED})
BRAKING = (State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE, State.FAULT)
HEAD = "| fault | reaction | cycles | off path [mm] | log whole |"
FILES_HEAD = "| what is given | what follows |"
OFF_WITHIN = 2.0  # [s] that a machine gets to stand without power, once its host is gone
PATIENCE = 20.0  # [s] for a busy computer to end a process that is on its way out


@dataclass(frozen=True, slots=True)
class Scene:
    """All that a fault can get hold of."""

    drives: SimulatedDrives
    proxy: BusProxy
    robot: dg.Robot
    handle: RunHandle
    target: Target | None = None


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault, how it is injected, and how it may end.

    Attributes:
        name: In the table.
        inject: Does it; what it returns, in words, is reported.
        expected: Reactions.
        override: Speed of the run.
        page: Whether the live page is served meanwhile.
    """

    name: str
    inject: Callable[[Scene], object]
    expected: frozenset[str]
    override: float = 1.0
    page: bool = False


def spoil(name: str, expected: frozenset[str] | str, *spoilers: Spoiler) -> Fault:
    """Return a fault of the bus."""
    return Fault(name, lambda scene: scene.proxy.spoil(*spoilers), _set(expected))


def send(name: str, expected: frozenset[str] | str, way: Way, *frames: Frame) -> Fault:
    """Return a fault that is a frame too many."""
    return Fault(name, lambda scene: scene.proxy.send(way, *frames), _set(expected))


def raw(name: str, expected: frozenset[str] | str, data: bytes) -> Fault:
    """Return a fault that is no frame at all."""
    return Fault(name, lambda scene: scene.proxy.send_raw("host", data), _set(expected))


def drive(
    name: str, expected: frozenset[str] | str, injection: Injection, override: float = 1.0
) -> Fault:
    """Return a fault of a simulated drive."""
    return Fault(name, lambda scene: scene.drives.inject(injection), _set(expected), override)


def _set(expected: frozenset[str] | str) -> frozenset[str]:
    return frozenset({expected}) if isinstance(expected, str) else expected


def to_drives(act: Act, by: int = 0, times: int | None = 1, axis: int = 1) -> Spoiler:
    """Return what happens to an axis's setpoints."""
    return Spoiler("drives", act, 0x200 + axis, by, times)


def to_host(act: Act, by: int = 0, times: int | None = 1, axis: int = 1) -> Spoiler:
    """Return what happens to an axis's feedback."""
    return Spoiler("host", act, 0x180 + axis, by, times)


def _pause(seconds: float) -> Callable[[Scene], None]:
    """Return a streamer that stands still for a while."""

    def pause(scene: Scene) -> None:
        pid = scene.robot._connection.process.pid
        os.kill(pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(pid, signal.SIGCONT)

    return pause


def _random_frames(scene: Scene) -> None:
    chance = np.random.default_rng(7)
    for _ in range(20):
        frames = [
            (int(chance.integers(1, 0x800)), chance.bytes(int(chance.integers(0, 9))))
            for _ in range(50)
        ]
        # What a drive obeys or believes is tried one by one above; here it is the rest.
        known = (0x080, 0x600, 0x580, 0x180, 0x200, 0x280, 0x300, 0x700)
        scene.proxy.send("host", *[f for f in frames if f[0] & 0x780 not in known])
        time.sleep(0.005)


def _bus() -> Iterator[Fault]:
    """Yield what can happen to frames."""
    yield spoil("one setpoint lost", COMPLETED, to_drives("drop"))
    # Where the speed hardly changes the drive goes on by itself: then they are counted.
    yield spoil("5 setpoints of axis 1 lost", ANY_STOP | {COMPLETED}, to_drives("drop", times=5))
    yield spoil(
        "setpoints of axis 2 lost for good", ANY_STOP, to_drives("drop", times=None, axis=2)
    )
    yield spoil(
        "all setpoints lost for good",
        ANY_STOP,
        *(to_drives("drop", times=None, axis=a) for a in (1, 2, 3)),
    )
    yield spoil("one setpoint one cycle late", COMPLETED, to_drives("late"))
    yield spoil("two setpoints change places", COMPLETED, to_drives("swap"))
    yield spoil(
        "setpoints one cycle late for good", ANY_STOP | {COMPLETED}, to_drives("hold", 1, None)
    )
    yield spoil("setpoints +10 mm for good", ANY_STOP, to_drives("shift", 10 * MM, None))
    yield spoil("setpoints +1 mm for good", ANY_STOP, to_drives("shift", MM, None))
    yield spoil("one setpoint +10 mm", ANY_STOP | {COMPLETED}, to_drives("shift", 10 * MM))
    yield spoil("setpoints creep 0.02 mm a cycle", ANY_STOP, to_drives("creep", MM // 50, None))
    yield spoil("setpoints of axis 3 freeze", ANY_STOP, to_drives("freeze", 0, None, 3))
    yield spoil("one setpoint twice", COMPLETED, to_drives("copy", 2))
    # The drive says so by an emergency message, 0x8210, and whatever that is for, it stops a run.
    yield spoil("one setpoint cut to 3 bytes", ANY_STOP, to_drives("cut", 3))
    yield spoil("one setpoint of 8 bytes", COMPLETED, to_drives("pad"))
    yield spoil("one setpoint scrambled", ANY_STOP | {COMPLETED}, to_drives("scramble"))
    yield spoil("controlword without enable, once", ANY_STOP, to_drives("clear", 0x8))
    yield spoil("one SYNC lost", COMPLETED, Spoiler("drives", "drop", 0x80))
    yield spoil("5 SYNCs lost", ANY_STOP | {COMPLETED}, Spoiler("drives", "drop", 0x80, times=5))
    yield spoil("SYNC lost for good", ANY_STOP, Spoiler("drives", "drop", 0x80, times=None))
    yield spoil("one feedback lost", COMPLETED, to_host("drop"))
    yield spoil("5 feedbacks of axis 2 lost", ANY_STOP, to_host("drop", times=5, axis=2))
    yield spoil("feedback lost for good", ANY_STOP, to_host("drop", times=None))
    yield spoil(
        "feedback two cycles late for good", ANY_STOP | {COMPLETED}, to_host("hold", 2, None)
    )
    yield spoil("feedback +10 mm for good", ANY_STOP, to_host("shift", 10 * MM, None))
    yield spoil("feedback +1 mm for good", ANY_STOP, to_host("shift", MM, None))
    yield spoil("one feedback +10 mm", ANY_STOP | {COMPLETED}, to_host("shift", 10 * MM))
    yield spoil(
        "feedback with 2 mm of noise", ANY_STOP | {COMPLETED}, to_host("shake", 2 * MM, None)
    )
    yield spoil("feedback frozen", ANY_STOP, to_host("freeze", 0, None))
    yield spoil("one feedback at 2^31 - 1", ANY_STOP | {COMPLETED}, to_host("place", 2**31 - 1))
    yield spoil("feedback at -2^31 for good", ANY_STOP, to_host("place", -(2**31), None))
    yield spoil("one feedback cut to 1 byte", COMPLETED, to_host("cut", 1))
    yield spoil("feedback cut to 0 bytes for good", ANY_STOP, to_host("cut", 0, None))
    yield spoil("one feedback of 8 bytes", COMPLETED, to_host("pad"))
    yield spoil("one feedback scrambled", ANY_STOP | {COMPLETED}, to_host("scramble"))
    yield spoil("one statusword with the fault bit", ANY_STOP | {COMPLETED}, to_host("set", 0x8))
    yield spoil("one statusword of no state", ANY_STOP | {COMPLETED}, to_host("clear", 0x6F))
    yield spoil("statusword of no state for good", ANY_STOP, to_host("clear", 0x6F, None))
    yield spoil(
        "heartbeat of axis 2 lost for good",
        ANY_STOP | {COMPLETED},
        Spoiler("host", "drop", 0x702, times=None),
    )
    yield send(
        "emergency message of axis 1", ANY_STOP, "host", (0x081, bytes.fromhex("1023010000000000"))
    )
    yield send(
        "emergency message of 3 bytes", ANY_STOP | {COMPLETED}, "host", (0x081, b"\x10\x23\x01")
    )
    yield send("boot-up of axis 3", ANY_STOP, "host", (0x703, b"\0"))
    yield send("heartbeat in pre-operational", ANY_STOP, "host", (0x701, b"\x7f"))
    yield send("SYNC of another host", ANY_STOP, "host", (0x080, b""))
    yield send("setpoint of another host", ANY_STOP, "host", (0x201, bytes(6)))
    yield send("NMT reset of another host", ANY_STOP, "drives", (0x000, b"\x81\x00"))
    yield send("NMT pre-operational of another host", ANY_STOP, "drives", (0x000, b"\x80\x02"))
    yield Fault("1000 frames of strangers", _random_frames, _set(COMPLETED))
    yield raw("a message of one word", COMPLETED, b"< oh >")
    yield raw("a frame that is none", COMPLETED, b"< frame xyz 1.0 zz >")
    yield raw("10 kB without a bracket", COMPLETED, bytes(10_000))
    yield raw("an error frame, bus off", ANY_STOP, b"< error 040 1.0 0000000000000000 >")
    yield Fault("connection cut", lambda scene: scene.proxy.cut(), ANY_STOP)


def _drives() -> Iterator[Fault]:
    """Yield what can happen to drives."""
    for axis in (1, 2, 3):
        yield drive(f"device fault, axis {axis}", ANY_STOP, faults.DeviceFault(axis))
    yield drive("jam, axis 1", ANY_STOP, faults.Jam(1))
    yield drive("safe torque off, axis 3", QUICK, faults.Sto(3))
    yield drive("no feedback, axis 2", ANY_STOP, faults.Silence(2, heartbeat=False))
    yield drive("no heartbeat, axis 2", ANY_STOP, faults.Silence(2, tpdo=False), 0.1)
    yield drive("reboot, axis 1", ANY_STOP, faults.Reboot(1))


def _host() -> Iterator[Fault]:
    """Yield what can happen to the host and its streamer."""
    yield Fault("stop", lambda scene: scene.handle.stop(), _set(STOPPED))
    yield Fault("quick stop", lambda scene: scene.handle.quick_stop(), _set(QUICK))
    yield Fault("hold, then stop", _hold_and_stop, _set(STOPPED))
    yield Fault("streamer paused 5 ms", _pause(0.005), ANY_STOP | {COMPLETED})
    yield Fault("streamer paused 15 ms", _pause(0.015), ANY_STOP)
    yield Fault("streamer paused 60 ms", _pause(0.06), ANY_STOP)
    yield Fault("streamer killed", _signal_streamer(signal.SIGKILL), _set(WATCHDOGS))
    yield Fault("streamer frozen for good", _signal_streamer(signal.SIGSTOP), _set(WATCHDOGS))
    yield Fault("200 orders at once", _hammer, _set(COMPLETED))


def _signal_streamer(number: signal.Signals) -> Callable[[Scene], None]:
    return lambda scene: os.kill(scene.robot._connection.process.pid, number)


def _hold_and_stop(scene: Scene) -> None:
    scene.handle.hold()
    time.sleep(0.05)
    scene.handle.stop()


def _hammer(scene: Scene) -> None:
    for i in range(200):
        scene.handle.set_override(0.5 + 0.5 * (i % 2))


def _page() -> Iterator[Fault]:
    """Yield what others can do to the live page, while a machine runs."""
    for name, attack in page_attacks.REFUSED.items():
        yield Fault(name, _of_the_page(attack), _set(COMPLETED), 0.1, page=True)
    for name, attack in page_attacks.STOPS.items():
        yield Fault(name, _of_the_page(attack), _set(STOPPED), 0.1, page=True)


@dataclass(frozen=True, slots=True)
class HostFault:
    """A signal to a host in a process of its own, or to its streamer.

    Attributes:
        name: In the table.
        number: The signal.
        how: What the host does; see ``host_process``.
        ends: Exit codes that its end may have; None: it is frozen, and lives on.
        streamer: Whether it is the streamer that gets the signal.
    """

    name: str
    number: signal.Signals
    ends: frozenset[int | None]
    how: str = "run"
    streamer: bool = False


HOST_FAULTS = (
    HostFault("host killed (SIGKILL)", signal.SIGKILL, frozenset({-9})),
    HostFault("host frozen (SIGSTOP)", signal.SIGSTOP, frozenset({None})),
    HostFault("host told to end (SIGTERM)", signal.SIGTERM, frozenset({-2})),
    HostFault("host told to end (SIGHUP)", signal.SIGHUP, frozenset({-2})),
    HostFault("host told to end (Ctrl-C)", signal.SIGINT, frozenset({-2})),
    HostFault("host stuck, then SIGTERM", signal.SIGTERM, frozenset({143}), "stuck"),
    HostFault("host stuck in C, then SIGTERM", signal.SIGTERM, frozenset({-9}), "locked"),
    HostFault("host's streamer killed", signal.SIGKILL, frozenset({1}), streamer=True),
    HostFault("host's streamer frozen", signal.SIGSTOP, frozenset({1}), streamer=True),
)


def _of_the_page(attack: Callable[[Target], str]) -> Callable[[Scene], str]:
    def inject(scene: Scene) -> str:
        assert scene.target is not None
        scene.handle.set_override(0.01)  # so that the run lasts as long as the attack
        words = attack(scene.target)
        scene.handle.set_override(1.0)
        return words

    return inject


FAULTS = (*_bus(), *_drives(), *_host(), *_page())


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the table.

    Attributes:
        good: Whether the reaction is one that is expected.
        name: Of the fault.
        reaction: What followed.
        cycles: From the news to the first frame that differs.
        off: How far off the path the platform was [mm]; None where nothing moved.
        log: Whether it is whole.
        said: What was reported.
    """

    good: bool
    name: str
    reaction: str
    cycles: str = "-"
    off: float | None = None
    log: str = "-"
    said: str = ""

    @property
    def words(self) -> tuple[str, str, str, str, str]:
        """What is said of each column that both tables have."""
        off = "-" if self.off is None else "apart" if np.isinf(self.off) else f"{self.off:.3f}"
        return self.name, self.reaction, self.cycles, off, self.log

    def __str__(self) -> str:
        """Return the line for a terminal."""
        name, reaction, cycles, off, log = self.words
        head = f"{' ' if self.good else '!'} {name:<40}{reaction:<18}{cycles:>6}{off:>10}"
        return f"{head}   {log:<5}{self.said}"


def measure_file(name: str, attack: Callable[[Path], str], folder: Path) -> Row:
    """Give a file to whoever would move a machine with it."""
    try:
        words, reaction = attack(folder), HARMLESS
    except dg.DuoglideError as error:
        words, reaction = str(error).replace(f"{folder}/", ""), REFUSED
    expected = REFUSED if name in file_attacks.REFUSED else HARMLESS
    return Row(reaction == expected, name, reaction, said=f"{words:.110}")


def measure(fault: Fault, folder: Path) -> Row:
    """Run and inject."""
    path = folder / "run.mcap"
    start = home_carriages(MACHINE).tolist()
    trajectory = dg.plan(MACHINE, PATH)
    with (
        SimulatedDrives(MACHINE.drives, start, standstill=0.0) as drives,
        BusProxy(drives.address) as proxy,
        dg.Robot.connect(MACHINE, bus=proxy.address) as robot,
        _served(robot, trajectory, folder, fault.page) as target,
    ):
        robot.enable()
        robot.home()
        robot.run(dg.transfer(MACHINE, dg.forward(MACHINE.geometry, robot.held), CORNERS[0]))
        handle = robot.start(trajectory, log=path, override=fault.override)
        while handle.status.path_time < WHEN * trajectory.duration and not handle.done:
            time.sleep(0.0005)
        with Watch(drives) as seen:
            told = fault.inject(Scene(drives, proxy, robot, handle, target))
            said = [told] if isinstance(told, str) else []
            try:
                report = handle.wait(20.0)
                said += [trip.words for trip in report.faults]
                completed = report.completed
            except dg.DuoglideError as error:
                said, completed = [*said, str(error)], False
            time.sleep(0.2)  # until drives that brake by themselves stand
        proxy.spoil()
        for axis in (1, 2, 3):
            drives.inject(faults.Clear(axis))
    log = read_log(path)
    rows = _cycles(log)
    reaction = COMPLETED if completed else _reaction(rows, seen)
    return Row(
        reaction in fault.expected,
        fault.name,
        reaction,
        _delay(log, rows),
        _deviation(trajectory, seen),
        "no" if log.missing else "yes",
        "; ".join(said),
    )


def measure_host(fault: HostFault, folder: Path) -> Row:
    """Run in a process of its own, and send it, or its streamer, a signal."""
    log_file, plan = folder / "run.mcap", folder / "plan.mcap"
    start = home_carriages(MACHINE).tolist()
    trajectory = dg.plan(MACHINE, PATH)
    trajectory.save(plan)
    when = WHEN * trajectory.duration
    with (
        SimulatedDrives(MACHINE.drives, start, standstill=0.0) as drives,
        HostProcess(drives.address, plan, log_file, when, fault.how) as host,
        Watch(drives) as seen,
    ):
        begun = time.monotonic()
        if fault.streamer:
            os.kill(host.streamer, fault.number)
        else:
            host.send(fault.number)
        off = _until_off(drives, {State.SWITCH_ON_DISABLED, *(BRAKING if fault.streamer else ())})
        code = host.wait(OFF_WITHIN if None in fault.ends else PATIENCE)
        lasted = time.monotonic() - begun
    said = f"drives stand and are off {off:.1f} s later; "
    said += "the host lives on" if code is None else f"host ended {lasted:.1f} s later: {code}"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # the log of a host that is killed has no end
        log = read_log(log_file)
    rows = _cycles(log)
    reaction = _reaction(rows, seen)
    good = reaction == (WATCHDOGS if fault.streamer else STOPPED) and code in fault.ends
    return Row(
        good and off < OFF_WITHIN,
        fault.name,
        reaction,
        _delay(log, rows),
        _deviation(trajectory, seen),
        "cut" if log.missing else "yes",
        said,
    )


def _until_off(drives: SimulatedDrives, states: set[State]) -> float:
    """Wait until all drives stand in one of some states; return how long it took [s]."""
    begun = time.monotonic()
    while time.monotonic() - begun < PATIENCE:
        now = drives.snapshot()
        if all(abs(drive.velocity) < 0.5 and drive.state in states for drive in now):
            return time.monotonic() - begun
        time.sleep(0.01)
    return PATIENCE


def _cycles(log: Log) -> list[tuple[float, CycleRecord]]:
    return [(t, r) for t, r in log.records(Topic.CYCLE) if isinstance(r, CycleRecord)]


@contextmanager
def _served(
    robot: dg.Robot, trajectory: dg.Trajectory, folder: Path, wanted: bool
) -> Iterator[Target | None]:
    """Serve the page of a robot, if it is wanted, with a plan that is loaded."""
    if not wanted:
        yield None
        return
    files = folder / "page"
    files.mkdir()
    with Page(MACHINE, drives=robot, port=0, folder=files) as page:
        page._motion.trajectory = trajectory
        yield Target(page, files)


class Watch:
    """What the drives really do, as often as they can be asked; a context manager."""

    def __init__(self, drives: SimulatedDrives) -> None:
        self._drives, self._over = drives, threading.Event()
        self._seen: list[tuple[DriveSnapshot, ...]] = []
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> list[tuple[DriveSnapshot, ...]]:
        self._thread.start()
        return self._seen

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._over.is_set():
            self._seen.append(self._drives.snapshot())


def _reaction(
    rows: list[tuple[float, CycleRecord]], seen: Sequence[tuple[DriveSnapshot, ...]]
) -> str:
    """Tell how a run was stopped.

    Where a drive is followed, the two others are enabled until all stand; else they get a quick
    stop at once, or as soon as it is seen that the drive does not brake. Where nobody told them to,
    and they have braked, it was their watchdogs.
    """
    words = [record.controlword for _, record in rows if record.phase is Phase.STOP]
    if sum(sorted(map(ENABLED.__eq__, three)) == [False, True, True] for three in words) > 3:
        return QUICK if any(three.count(QUICK_STOP) > 1 for three in words) else FOLLOWED
    if any(QUICK_STOP in record.controlword for _, record in rows):
        return QUICK
    braked = any(sum(drive.state in BRAKING for drive in drives) > 1 for drives in seen)
    return WATCHDOGS if braked else STOPPED


def _delay(log: Log, rows: list[tuple[float, CycleRecord]]) -> str:
    """Cycles from the news to the first frame that differs."""
    told = [t for t, record in log.records(Topic.EVENT) if getattr(record, "kind", "") in NEWS]
    changed = [t for t, r in rows if r.phase is Phase.STOP or QUICK_STOP in r.controlword]
    if not told or not changed:
        return "-"
    return str(max(0, round((changed[0] - told[0]) / MACHINE.drives.cycle)))


def _deviation(trajectory: dg.Trajectory, seen: Sequence[tuple[DriveSnapshot, ...]]) -> float:
    """Worst distance of the platform from the path [mm]; infinite where links are apart."""
    carriages = np.unique([[drive.position for drive in drives] for drives in seen], axis=0)
    path = trajectory.position_at(np.linspace(0.0, trajectory.duration, 20_000))
    try:
        places = dg.forward(MACHINE.geometry, carriages)
    except dg.UnreachableError:
        return float("inf")
    return float(max(np.linalg.norm(path - place, axis=1).min() for place in places))


def _rows() -> Iterator[tuple[str, Callable[[Path], Row]]]:
    """Yield the name of each row, and what makes it in a folder."""
    for fault in FAULTS:
        yield fault.name, partial(measure, fault)
    for host_fault in HOST_FAULTS:
        yield host_fault.name, partial(measure_host, host_fault)
    for name, attack in {**file_attacks.REFUSED, **file_attacks.HARMLESS}.items():
        yield name, partial(measure_file, name, attack)


def write_tables(page: Path, rows: Sequence[Row]) -> None:
    """Put the rows of a run into the two tables of a page, in the place of those that are there."""
    moving = [f"| {' | '.join(row.words)} |" for row in rows if row.off is not None]
    files = [f"| {row.name} | {row.reaction} |" for row in rows if row.off is None]
    text = page.read_text(encoding="utf-8")
    for head, lines in ((HEAD, moving), (FILES_HEAD, files)):
        rule = "|---" * (head.count("|") - 1) + "|"
        table = "\n".join([head, rule, *lines]) + "\n"
        text, found = re.subn(re.escape(head) + r"\n(\|.*\n)*", lambda _, t=table: t, text)
        assert found == 1, f"{page} has {found} tables with the head {head}"
    page.write_text(text, encoding="utf-8")


def main() -> int:
    """Print the matrix."""
    parser = argparse.ArgumentParser()
    parser.add_argument("words", nargs="*")
    parser.add_argument("--write", type=Path)
    options = parser.parse_args()
    print(f"  {'fault':<40}{'reaction':<18}{'cycles':>6}{'off path':>10}   log  what is reported")
    made = []
    for name, run in _rows():
        if options.words and not any(word in name for word in options.words):
            continue
        with tempfile.TemporaryDirectory() as folder:
            made.append(run(Path(folder)))
        print(made[-1], flush=True)
    wrong = [row.name for row in made if not row.good]
    print(
        f"{len(made)} rows, {len(wrong)} not as expected{': ' if wrong else ''}{', '.join(wrong)}"
    )
    if options.write is not None:
        write_tables(options.write, made)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
