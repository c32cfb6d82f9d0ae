"""Files that somebody has tampered with: plans, runs, programs, machine files and state files.

Every attack makes a file and gives it to whoever would move a machine with it. It raises the
``DuoglideError`` that refuses it, or returns in words what was made of it instead.
"""

from __future__ import annotations

import copy
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from damaged_logs import a_plan, a_run
from mcap.records import Message
from rewritten_logs import PLAIN, WAYS, rewrite

import duoglide as dg
from duoglide.control.host.run.fitness import require_fit
from duoglide.control.host.state_file import read_memory
from duoglide.planning.programs.read import read_program
from duoglide.playback.replay import prepare
from duoglide.playback.summary import summarise
from duoglide.storage import LogKind, LogWarning, LogWriter, read_log

Document = dict[str, Any]
MACHINE = dg.Machine.default()


class TakenError(AssertionError):
    """A machine would have followed what it must not follow."""


def _stream(file: Path) -> str:
    """Do what ``duoglide stream`` does before it connects, and judge what is left by itself."""
    trajectory, _ = require_fit(dg.Trajectory.load(file), MACHINE)
    step = 1e-4  # [s]
    t = step * np.arange(-3, trajectory.duration / step + 4)
    rows = trajectory.at(np.clip(t, 0.0, trajectory.duration)).carriages
    room = dg.clearance(MACHINE.geometry, dg.forward(MACHINE.geometry, rows)).min()
    if room < MACHINE.clearance - 1e-3:
        raise TakenError(f"clearance {room:.3f} mm")
    for name in ("velocity", "acceleration", "jerk"):
        rows = np.diff(rows, axis=0) / step
        use = (np.abs(rows) / getattr(MACHINE.limits, name)).max()
        if use > 1.002:
            raise TakenError(f"{use:.3f} of limits.{name}")
    return "derived again: within limits and clearance"


def _plan(change: Callable[[Document], object]) -> Callable[[Path], str]:
    """Return an attack by a plan of which something was changed."""

    def attack(folder: Path) -> str:
        plan = dg.plan(MACHINE, dg.Path.line((-41, -15, 300), (-41, 15, 305)))
        document = copy.deepcopy(plan.to_document())
        change(document)
        file = folder / "plan.mcap"
        with LogWriter(file, LogKind.PLAN) as log:
            log.attach("machine", document["checked"]["machine"])
            log.attach("trajectory", document)
        return _stream(file)

    return attack


def _text(change: Callable[[bytes], bytes]) -> Callable[[Path], str]:
    """Return an attack by a plan whose text was changed."""

    def attack(folder: Path) -> str:
        def spoil(name: str, data: bytes) -> bytes:
            if name != "trajectory":
                return data
            changed = change(data)
            assert changed != data
            return changed

        whole = a_plan(folder / "whole.mcap")
        return _stream(rewrite(whole, folder / "plan.mcap", PLAIN, text=spoil))

    return attack


def _knots(make: Callable[[list[list[float]]], object]) -> Callable[[Document], object]:
    def change(document: Document) -> None:
        document["profile"] = make(document["profile"]) or document["profile"]

    return change


def _jump(knots: list[list[float]], seconds: float) -> list[list[float]]:
    """Leave 8 mm of the way to next to no time."""
    k = len(knots) // 2
    j = next(i for i, row in enumerate(knots) if row[1] >= knots[k][1] + 8.0)
    begin = max(knots[k][0] + seconds, float(np.nextafter(knots[k][0], np.inf)))
    return [*knots[: k + 1], *([t - knots[j][0] + begin, *rest] for t, *rest in knots[j:])]


def _quicker(knots: list[list[float]], by: float) -> list[list[float]]:
    return [[t / by, s, v * by, a * by * by] for t, s, v, a in knots]


def _loosen(document: Document) -> None:
    limits = document["checked"]["machine"]["limits"]
    limits |= {"jerk": [1e12] * 3, "acceleration": [1e9] * 3, "velocity": [1e4] * 3}
    document["checked"]["machine"].pop("stop_limits", None)
    document["profile"] = _quicker(document["profile"], 2.0)


def _recorded(document: Document) -> None:
    document["report"]["method"] = "recorded"
    document["profile"] = _quicker(document["profile"], 1.1)


def _promises(document: Document) -> None:
    """Claim that it stops and brakes as no machine does."""
    for table in document["stops"].values():
        if isinstance(table, dict):
            table |= {"slope": [1e6] * len(table["slope"]), "bend": [1e12] * len(table["bend"])}
    document["report"] |= {"brake_safe": True, "braking_clearance": 1e3}


def _shift(document: Document) -> None:
    """Lead the curve to where the links cannot reach."""
    document["checked"]["curve"]["coefficients"][0][0][2] += 200.0


def _machine(key: str, value: object, table: str = "") -> Callable[[Document], object]:
    def change(document: Document) -> None:
        machine = document["checked"]["machine"]
        (machine[table] if table else machine)[key] = value

    return change


def _run(change: Callable[[Document], object]) -> Callable[[Path], str]:
    """Return an attack by a run of which some cycles were changed."""

    def spoil(message: Message, topic: str) -> Message:
        if topic.endswith("cycle"):
            record = json.loads(message.data)
            change(record)
            message.data = json.dumps(record).encode()
        return message

    def attack(folder: Path) -> str:
        whole = a_run(folder / "whole.mcap")
        return _replay(rewrite(whole, folder / "run.mcap", WAYS["zstd"], change=spoil))

    return attack


def _off_by_1_mm(record: Document) -> None:
    record["setpoint"][0] += 1000


def _replay(file: Path) -> str:
    again = prepare(file, MACHINE)
    summarise(read_log(file))
    return f"{again.trajectory!r}"


def _cut(share: float) -> Callable[[Path], str]:
    def attack(folder: Path) -> str:
        data = a_run(folder / "whole.mcap").read_bytes()
        file = folder / "run.mcap"
        file.write_bytes(data[: int(share * len(data))])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LogWarning)
            return _replay(file)

    return attack


def _flip(folder: Path) -> str:
    data = bytearray(a_plan(folder / "plan.mcap").read_bytes())
    data[len(data) // 2] ^= 0x10
    (folder / "plan.mcap").write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        return _stream(folder / "plan.mcap")


def _bomb(folder: Path) -> str:
    """Unpack to 200 MB."""

    def swell(message: Message, topic: str) -> Message:
        message.data = bytes(200_000_000) if topic.endswith("motion") else message.data
        return message

    first = [True]

    def keep(message: Message, topic: str) -> bool:
        return topic.endswith("motion") and bool(first and first.pop())

    whole = a_plan(folder / "whole.mcap")
    file = rewrite(whole, folder / "plan.mcap", WAYS["zstd"], keep, change=swell, last=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)
        return _stream(file)


def _program(name: str, text: str) -> Callable[[Path], str]:
    def attack(folder: Path) -> str:
        file = folder / name
        file.write_text(text)
        return f"{dg.plan(MACHINE, read_program(file))!r}"

    return attack


def _machine_file(text: str) -> Callable[[Path], str]:
    def attack(folder: Path) -> str:
        file = folder / "machine.toml"
        file.write_text(text)
        return f"{dg.Machine.load(file)!r}"

    return attack


def _state(text: str) -> Callable[[Path], str]:
    def attack(folder: Path) -> str:
        file = folder / "reference.json"
        file.write_text(text)
        return f"{read_memory(file)!r}"

    return attack


_INF = "start = [0, 0, 300]\n[[moves]]\ntype = 'line'\nto = [inf, 0, 3]\n"
_DRIVE = '{"vendor": 1, "product": 1, "serial": 1, "mark": 1, "position": %s}'
_STATE = '{"version": 1, "homed": %s, "why": "", "standing": true, "drives": [%s, %s, %s]}'
_GOOD = _DRIVE % "0"

REFUSED: dict[str, Callable[[Path], str]] = {
    "plan: 8 mm in 1 us": _plan(_knots(lambda k: _jump(k, 1e-6))),
    "plan: 8 mm between two numbers": _plan(_knots(lambda k: _jump(k, 0.0))),
    "plan: 2 % quicker": _plan(_knots(lambda k: _quicker(k, 1.02))),
    "plan: backwards": _plan(_knots(lambda k: [*k[:40], *k[30:]])),
    "plan: begins at speed": _plan(_knots(lambda k: [[t - k[9][0], *r] for t, *r in k[9:]])),
    "plan: no knots": _plan(_knots(lambda k: k.clear())),
    "plan: limits of its own, twice as fast": _plan(_loosen),
    "plan: recorded, to use the stop limits": _plan(_recorded),
    "plan: out of reach": _plan(_shift),
    "plan: another geometry": _plan(_machine("strut_length", 320.0, "geometry")),
    "plan: another mode": _plan(_machine("mode", [1, 1, 1, 1])),
    "plan: words for numbers": _plan(_knots(lambda k: k.__setitem__(3, ["0", "1", "2", "3"]))),
    "plan: 10^400": _text(lambda data: data.replace(b"[[0.0,", b"[[1e400,", 1)),
    "plan: NaN": _text(lambda data: data.replace(b"[[0.0,", b"[[NaN,", 1)),
    "plan: 100 000 brackets": _text(lambda data: b"[" * 100_000),
    "plan: one bit of its data": _flip,
    "run: a setpoint 1 mm off": _run(_off_by_1_mm),
    "run: path times twice as quick": _run(lambda r: r.update(path_time=2.0 * r["path_time"])),
    "run: a path time of NaN": _run(lambda r: r.update(path_time=float("nan"))),
    "run: setpoints of 2^40": _run(lambda r: r.update(setpoint=[2**40] * 3)),
    "run: cut in its head": _cut(0.002),
    "run: cut in the middle of its motion": _cut(0.6),
    "program: NaN in points": _program("a.csv", "x,y,z\n-41,0,300\n-41,nan,300\n"),
    "program: inf in a move": _program("a.toml", _INF),
    "program: 1e999 in G-code": _program("a.nc", "G21 G90\nG0 X-41 Y0 Z300\nG1 X1e999 F100\n"),
    "program: out of reach": _program("b.csv", "x,y,z\n-41,0,300\n-41,0,900\n"),
    "machine: NaN": _machine_file("clearance = nan\n"),
    "machine: a key that is none": _machine_file("[limits]\nvelocty = 1\n"),
    "machine: stop limits below the limits": _machine_file("[stop_limits]\njerk = 1.0\n"),
    "machine: increments beyond 32 bits": _machine_file("[drives]\nincrements_per_mm = 1e9\n"),
    "state: homed is a word": _state(_STATE % ('"yes"', _GOOD, _GOOD, _GOOD)),
    "state: a position of 2^31": _state(_STATE % ("true", _GOOD, _GOOD, _DRIVE % 2**31)),
    "state: 10 000 brackets": _state("[" * 10_000),
}  # fmt: skip
HARMLESS: dict[str, Callable[[Path], str]] = {
    "plan: promises of stops and brakes": _plan(_promises),
    "plan: samples that unpack to 200 MB": _bomb,
    "plan: its machine has less clearance": _plan(_machine("clearance", 0.0)),
}
