"""Drives of other makers, simulated: probing, profiles, homing and streams on each kind of gap."""

from __future__ import annotations

import json
import re
import threading
import time
import tomllib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import duoglide as dg
from duoglide.cli.main import run
from duoglide.control.host.commission import probe_drives
from duoglide.control.host.connection import open_axes
from duoglide.drives import pdo
from duoglide.drives.bus.buses import open_bus
from duoglide.drives.cia402 import Mode, State
from duoglide.drives.onboarding.probe_text import tables
from duoglide.drives.simulation.faults import DeviceFault, Reboot, Sto
from duoglide.drives.simulation.makers.imitation import Imitation
from duoglide.drives.simulation.makers.makes import MAKES
from duoglide.drives.simulation.simulated import SimulatedDrives
from duoglide.kinematics.home import home_carriages
from duoglide.machine.drive_quirks import Interlock

PATIENT = {  # a busy computer must not be what stops these runs
    "setpoint_timeout": 0.25,
    "heartbeat_timeout": 1.0,
    "late_cycles": 120,
    "following_error_window": 30.0,
    "following_error_time": 0.05,
}
HOME_CARRIAGES = home_carriages(dg.Machine.default()).tolist()
EPOS4, GOLD, TMCM = "maxon-epos4", "elmo-gold", "trinamic-tmcm"
STEP = np.array((0.0, 10.0, 0.0))  # [mm]
ONE_RPM = 1.0  # [mm/s], by the 60 000 increments of a revolution that the imitation has


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@contextmanager
def imitated(*imitations: Imitation) -> Iterator[SimulatedDrives]:
    settings = dg.Machine.default().drives
    with SimulatedDrives(settings, HOME_CARRIAGES, imitations=imitations) as drives:
        yield drives


def machine_of(table: dict[str, Any]) -> dg.Machine:
    """Return a machine with these drives, slow and patient."""
    limits = {"velocity": 100.0, "acceleration": 2000.0, "jerk": 100e3}
    drives = {**table.get("drives", {}), **PATIENT}
    return dg.Machine.from_dict({"limits": limits, "drives": drives})


def pasted(drives: SimulatedDrives, machine: dg.Machine | None = None) -> dg.Machine:
    """Probe, and read what is printed as a machine file."""
    asked = machine or machine_of({})
    found = probe_drives(asked, drives.address)
    assert not any(one.refusals for one in found), [one.refusals for one in found]
    return machine_of(tomllib.loads(tables(found, asked.drives, "a test")))


@contextmanager
def homed(machine: dg.Machine, drives: SimulatedDrives) -> Iterator[dg.Robot]:
    with dg.Robot.connect(machine, bus=drives.address) as robot:
        robot.enable()
        robot.home(confirm=True)
        yield robot


def really(drives: SimulatedDrives) -> np.ndarray:
    return np.array([drive.position for drive in drives.snapshot()])


def require_at(drives: SimulatedDrives, carriages: Sequence[float] | np.ndarray) -> None:
    assert np.abs(really(drives) - carriages).max() < 0.1, (really(drives), carriages)


def test_three_streams_on_three_makes_end_where_they_should() -> None:
    machine = machine_of(
        {"drives": {"profile": [EPOS4, GOLD, TMCM], "quirks": [{"velocity_unit": ONE_RPM}, {}, {}]}}
    )
    motion = dg.transfer(machine, (-41.0, 0.0, 302.0), (-41.0, 40.0, 306.0))
    with imitated(*(MAKES[name] for name in machine.drives.profile)) as drives:
        for _ in range(3):
            with dg.Robot.connect(machine, bus=drives.address) as robot:
                robot.enable()
                robot.home(confirm=not robot.homed)  # once is enough: the place is remembered
                assert robot.run(motion, approach=True).completed
            require_at(drives, motion.end)


@pytest.mark.parametrize("name", [EPOS4, GOLD, TMCM])
def test_probing_a_make_finds_its_profile_and_nothing_beside_it(name: str) -> None:
    given = [{"velocity_unit": ONE_RPM}] if name == EPOS4 else [{}]
    profile = machine_of({"drives": {"profile": name, "quirks": given}})
    with imitated(MAKES[name], MAKES[name], MAKES[name]) as drives:
        found = pasted(drives, machine_of({"drives": {"quirks": given}}))
    assert found.drives.profile == profile.drives.profile
    assert found.drives.homing.method == profile.drives.homing.method
    for probed, known in zip(found.drives.quirks, profile.drives.quirks, strict=True):
        # a profile is for all products of the maker
        absent = set(probed.absent)
        assert absent <= set(known.absent) | {0x605A}, [f"0x{i:04X}" for i in absent]
        for key in ("setpoint_timer", "interlock", "home_object", "quick_stop_option"):
            assert getattr(probed, key) == getattr(known, key), key


COB_IDS = tuple((parameters, 1) for parameters in (0x1400, 0x1401, 0x1800, 0x1801))
GAPS = {
    "COB-IDs cannot be written; interlock the other way round": Imitation(
        fixed=COB_IDS, interlock=Interlock.CLEAR, values={(0x1A00, 0): 1}
    ),
    "stops by option 2 alone; loses the host by fault alone": Imitation(
        allowed={(0x605A, 0): (0, 2), (0x6007, 0): (0, 1), (0x6060, 0): (0, 6, 8)}
    ),
    "does not say that it knows CSP; no heartbeat of the host; no text": Imitation(
        values={(0x6502, 0): 0x21}, absent=(0x1016, 0x1008, 0x2010, 0x6007)
    ),
    "homing by 35, no inputs, no second PDOs": Imitation(
        here=35,
        allowed={(0x6098, 0): (17, 35)},
        absent=(0x60FD, 0x60FE, 0x1401, 0x1601, 0x1801, 0x1A01, 0x2010),
    ),
    "period fixed, no event timer, another meaning of 0x2010": Imitation(
        fixed=((0x60C2, 2),), absent_subs=((0x1400, 5),), values={(0x2010, 0): 1}
    ),
    "slow, late, PDOs of its own": Imitation(
        sdo_delay=0.02, boot_delay=1.0, running=(3, 4), absent=(0x2010,)
    ),
}


@pytest.mark.parametrize("first", [0, 3])
def test_what_is_printed_of_gaps_comes_up_homes_and_moves(first: int) -> None:
    with imitated(*list(GAPS.values())[first : first + 3]) as drives:
        machine = pasted(drives)
        with homed(machine, drives) as robot:
            require_at(drives, HOME_CARRIAGES)
            motion = dg.transfer(machine, robot.position, robot.position + STEP)
            assert robot.run(motion).completed
            require_at(drives, motion.end)


def test_what_no_probing_can_find_is_refused_with_the_key_that_says_it() -> None:
    """A sign, a missing bit and a polarity, each on one axis: three refusals, three keys."""
    unknown = {"absent": (0x2010,)}
    gaps = (
        Imitation(home_sign=-1, **unknown),
        Imitation(follows_bit=False, **unknown),
        Imitation(interlock=Interlock.CLEAR, **unknown),
    )
    quirks: list[dict[str, Any]] = [{"absent": [0x2010]} for _ in gaps]
    answers = (
        (3, {"interlock": "clear"}, 'axis 3.*is set.*interlock = "clear"'),
        (2, {"follows_bit": False}, "axis 2.*follows_bit = false"),
        (1, {"home_offset_sign": -1}, "axis 1.*home_offset_sign = -1"),
    )
    with imitated(*gaps) as drives:
        for axis, answer, words in answers:
            machine = machine_of({"drives": {"quirks": quirks}})
            with pytest.raises(dg.DriveError, match=words), homed(machine, drives):
                pass
            quirks[axis - 1] |= answer
        machine = machine_of({"drives": {"quirks": quirks}})
        with homed(machine, drives) as robot:
            assert np.abs(robot.carriages - HOME_CARRIAGES).max() < 0.1
            assert robot.jog(STEP).completed
            robot.disable()
            drives.inject(Sto(3, True))
            with pytest.raises(dg.DriveError, match=r"axis 3.*safe torque off is active"):
                robot.enable()


def test_a_drive_that_cannot_be_homed_or_clocked_as_told_is_refused_before_power() -> None:
    own = {"absent": (0x2010,)}
    slow = {(0x60C2, 1): 10, (0x60C2, 2): -3}
    gaps = (
        Imitation(here=35, allowed={(0x6098, 0): (17, 35)}, **own),
        Imitation(absent=(0x2010, 0x607C)),
        Imitation(values=slow, fixed=tuple(slow), **own),
    )
    machine = machine_of({"drives": {"quirks": [{"absent": [0x2010]} for _ in gaps]}})
    with imitated(*gaps) as drives, pytest.raises(dg.DriveError) as refused:
        dg.Robot.connect(machine, bus=drives.address)
    for words in ("older CiA 402 end at 35", "home_object = ", "drives.cycle = 0.01 would do"):
        assert words in str(refused.value)


def test_a_drive_that_counts_itself_outside_is_limited_once_it_is_homed() -> None:
    table = {"drives": {"quirks": [{"absent": [0x2010]}] * 3}}
    coarse = machine_of({"drives": table["drives"] | {"increments_per_mm": 100}})
    gap = Imitation(absent=(0x2010,))
    with imitated(gap, gap, gap) as drives:
        with homed(machine_of(table), drives):
            pass  # now each says ten times as much as the other machine file can mean
        with dg.Robot.connect(coarse, bus=drives.address) as robot:
            assert limits_of(drives, coarse) == [(-(1 << 31), (1 << 31) - 1)] * 3
            robot.enable()
            robot.home(again=True, confirm=True)
            assert limits_of(drives, coarse) == [(-36_000, 36_000)] * 3


def limits_of(drives: SimulatedDrives, machine: dg.Machine) -> list[tuple[int, int]]:
    with open_axes(machine, drives.address) as axes:
        return [(axis.read(0x607D, 1), axis.read(0x607D, 2)) for axis in axes]


def test_nothing_homes_before_all_is_set_and_no_statusword_is_hammered() -> None:
    """Drives that begin on the level of bit 4 find mode, method and place in theirs."""
    gap = Imitation(homes_on_level=True, absent=(0x2010,), sdo_delay=0.005)
    machine = machine_of({"drives": {"quirks": [{"absent": [0x2010]}]}})
    with imitated(gap, gap, gap) as drives, open_bus(drives.address) as listener:
        frames: list[tuple[int, bytes]] = []
        over = threading.Event()

        def listen() -> None:  # all the time: a bus drops what nobody takes
            while not over.is_set():
                if (message := listener.recv(0.1)) is not None:
                    frames.append((message.arbitration_id, bytes(message.data)))

        with ThreadPoolExecutor(1) as pool:
            listening = pool.submit(listen)
            try:
                with homed(machine, drives):
                    require_at(drives, HOME_CARRIAGES)
            finally:
                over.set()
            listening.result(10.0)
    for node in machine.drives.node_ids:
        requests = [i for i, f in enumerate(frames) if f[0] == pdo.SDO_REQUEST + node]
        written = {key: i for i in requests if (key := _written(frames[i][1])) is not None}
        starts = [
            i
            for i, (can_id, data) in enumerate(frames)
            if can_id == pdo.RPDO1 + node and pdo.SETPOINT.unpack(data)[0] & 0x10
        ]
        assert starts, "homing never began"
        for key in ((0x6098, 0), (0x607C, 0)):
            assert written[key] < starts[0], key
        before = [i for i in requests if i < starts[0]]
        mode_at = max(i for i in before if _written(frames[i][1]) == (0x6060, 0))
        assert frames[mode_at][1][4] == Mode.HOMING
        read_back = [i for i in requests if frames[i][1][:4] == bytes((0x40, 0x61, 0x60, 0))]
        asked = sum(frames[i][1][:4] == bytes((0x40, 0x41, 0x60, 0)) for i in requests)
        assert 0 < asked < 20, f"the statusword of node {node} was asked for {asked} times"
        assert any(mode_at < i < starts[0] for i in read_back), "its mode was not read back"


def _written(data: bytes) -> tuple[int, int] | None:
    """Return the object that an SDO request writes."""
    return (data[1] | data[2] << 8, data[3]) if data[0] >> 5 == 1 else None


def test_the_reference_outlives_a_fault_and_a_reconnect_and_ends_with_a_restart() -> None:
    gap = Imitation(absent=(0x2010,))
    machine = machine_of({"drives": {"quirks": [{"absent": [0x2010]}]}})
    with imitated(gap, gap, gap) as drives:
        with homed(machine, drives) as robot:
            drives.inject(DeviceFault(2))
            _until(lambda: bool(robot.latched))
            robot.reset_fault()
            assert robot.homed, robot.why_not_homed
            robot.enable()
            assert robot.recover().completed  # a machine that stopped can always back out
        with dg.Robot.connect(machine, bus=drives.address) as robot:
            assert robot.homed, robot.why_not_homed
            drives.inject(Reboot(3))
            _until(lambda: not robot.homed)
            assert "axis 3 has restarted" in robot.why_not_homed


def _until(true: Any, patience: float = 5.0) -> None:
    deadline = time.monotonic() + patience
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_a_slow_move_shows_whether_a_drive_brakes_in_the_unit_that_it_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gaps = [Imitation(acceleration_unit=unit, absent=(0x2010, 0x608F)) for unit in (1.0, 9.0, 50.0)]
    quirks: list[dict[str, Any]] = [{"absent": [0x2010]} for _ in gaps]
    quirks[2]["acceleration_unit"] = 0.05  # [mm/s^2]: 50 of its increments/s^2
    cell = tmp_path / "cell.toml"
    machine_of({"drives": {"quirks": quirks}}).save(cell)
    with imitated(*gaps) as drives:
        where = ["--bus", drives.address, "--machine", str(cell)]
        assert run(["drives", "units", *where, "--home-here", "--json"]) == 1
        assert not any(drive.state is State.OPERATION_ENABLED for drive in drives.snapshot())
    said = json.loads(capsys.readouterr().out)
    assert not said["ok"]
    for check in (said["drives"][0], said["drives"][2]):
        assert check["braked"] == pytest.approx(check["told"], rel=0.5)
        assert not check["refusal"]
    wrong = said["drives"][1]["refusal"]
    assert re.match(r"carriage 2: told to brake .* acceleration_unit .* 0\.0\d+ mm/s", wrong)
