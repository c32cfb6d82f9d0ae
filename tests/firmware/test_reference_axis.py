"""The C reference axis under sanitizers says, word for word, what the Python axis says."""

from __future__ import annotations

import random
import re
import subprocess
from pathlib import Path

import pytest

from duoglide.drives.cia402 import State
from duoglide.drives.simulation.firmware.axis import FirmwareAxis
from duoglide.drives.simulation.firmware.objects import ALLOWED, DEFAULTS, RefusalError

REFERENCE = Path(__file__).parents[2] / "firmware_interface" / "reference_axis"
EXTREMES = (-(1 << 31), -1, 0, 1, (1 << 31) - 1)
LIVE = (0x2010, 0x603F, 0x6041, 0x6061, 0x6064, 0x606C, 0x60F4, 0x60FD)

Stimulus = tuple[str, int, int, int]


class Traced:
    """A Python axis that writes down what it says, as replay.c prints it."""

    def __init__(self) -> None:
        self.axis = FirmwareAxis()
        self.lines: list[str] = []

    def take(self, stimulus: Stimulus) -> None:
        kind, a, b, c = stimulus
        axis = self.axis
        head = ""
        if kind == "w":
            head = f"{self.attempt(a, b, c):08x} "
        elif kind == "r":
            head = f"00000000 {axis.read(a, b)} "
        elif kind == "s":
            axis.setpoint(a, b)
        elif kind == "o":
            axis.communication(bool(a))
        elif kind == "f":
            axis.fault(a)
        elif kind == "t":
            axis.set_sto(bool(a))
        elif kind == "i":
            axis.set_inputs(a)
        elif kind == "k":
            axis.tick(a, b)
        else:
            {"y": axis.sync, "h": axis.heartbeat}[kind]()
        says = (axis.servo_demand, axis.servo_velocity, axis.actual)
        line = f"{axis.statusword:04x} {says[0]} {says[1]} {says[2]} {axis.powered:d}"
        line += f" {axis.brake_released:d} {axis.error_register:02x}"
        self.lines.append(head + line + "".join(f" {c:04x}" for c in axis.take_emergencies()))

    def attempt(self, index: int, sub: int, value: int) -> int:
        try:
            self.axis.write(index, sub, value)
        except RefusalError as refusal:
            return refusal.code
        return 0


def random_write(rng: random.Random) -> Stimulus:
    index, sub = rng.choice(list(DEFAULTS))
    if (index, sub) in ALLOWED:
        return "w", index, sub, rng.choice([*ALLOWED[index, sub], 5])
    value = {
        0x1016: rng.choice([0, 127 << 16 | 30]),
        0x1400: rng.choice([0, 10]),
        0x6007: rng.randrange(4),
        0x6040: rng.choice([0, 2, 6, 7, 15, 15, 31, 0x80, 0x10F]),
        0x605B: rng.randrange(2),
        0x605C: rng.randrange(2),
        0x605D: 2,
        0x6065: rng.choice([0, 100, 5000, 0xFFFFFFFF]),
        0x6066: rng.choice([0, 10]),
        0x607A: rng.choice([*EXTREMES, 5000]),
        0x607C: rng.choice([*EXTREMES, 5000]),
        0x607D: rng.choice([*EXTREMES, -9000, 9000]),
        0x607F: rng.choice([1, 1000, 10**6, (1 << 31) - 1]),
        0x6085: rng.choice([1, 10**6, 10**8, (1 << 32) - 1]),
        0x6098: rng.choice([37, 37, 37, 1]),
        0x6099: 1000,
        0x609A: 1000,
    }.get(index)
    if value is None:
        value = {
            (0x60C2, 1): rng.choice([1, 2, 255]),
            (0x60C2, 2): rng.choice([-5, -4, -3, -2]),
            (0x60FE, 1): rng.choice([0, 1, 1 << 16]),
            (0x60FE, 2): rng.choice([0, 1, 0xFFFFFFFF]),
        }[index, sub]
    return "w", index, sub, value


def random_stimulus(rng: random.Random, traced: Traced) -> Stimulus:
    """One stimulus; mostly ordinary life, or the axis would never leave its first states."""
    here = traced.axis.servo_demand // 256
    draw = rng.random()
    if draw < 0.4:
        error = rng.choice([0, 0, 0, 0, 3, -70, 20000])
        return "k", rng.choice([0, 1, 250, 1000, 1000, 12345, 100000]), here + error, 0
    if draw < 0.65:
        near = traced.axis.demand.position // 256 + rng.randrange(-3000, 3000)
        target = rng.choice([near] * 9 + list(EXTREMES))
        target = min(max(target, EXTREMES[0]), EXTREMES[-1])
        return "s", rng.choice([6, 7, 15, 15, 15, 15, 15, 15, 2, 0, 0x80, 0x10F]), target, 0
    if draw < 0.85:
        return random_write(rng)
    if draw < 0.9:
        return "r", *rng.choice([*DEFAULTS, *((index, 0) for index in LIVE)]), 0
    kind = rng.choice("yyhoofti")
    values = {"o": rng.choice([0, 1, 1]), "f": 0x2310, "t": rng.choice([0, 0, 0, 1])}
    return kind, values.get(kind, rng.randrange(1 << 16)), 0, 0


@pytest.mark.parametrize("seed", range(8))
def test_both_axes_say_the_same_to_any_stimulus(seed: int, sanitized: Path) -> None:
    rng = random.Random(seed)
    traced = Traced()
    stimuli = []
    for _ in range(3000):
        stimuli.append(random_stimulus(rng, traced))
        traced.take(stimuli[-1])
    text = "".join(f"{kind} {a} {b} {c}\n" for kind, a, b, c in stimuli)
    run = subprocess.run(
        [sanitized], input=text, capture_output=True, text=True, timeout=600, check=False
    )
    assert run.returncode == 0, run.stderr
    for stimulus, python, c in zip(stimuli, traced.lines, run.stdout.splitlines(), strict=True):
        assert c == python, stimulus


def test_the_stimuli_reach_every_state() -> None:
    rng = random.Random(0)
    traced = Traced()
    seen = set()
    for _ in range(8000):
        traced.take(random_stimulus(rng, traced))
        seen.add(traced.axis.state)
    assert seen == set(State)


def test_the_reference_axis_needs_no_heap_no_library_and_no_globals(tmp_path: Path) -> None:
    for source in REFERENCE.glob("*.c"):
        text = source.read_text()
        assert set(re.findall(r"#include <(\w+)\.h>", text)) <= {"stdbool", "stdint"}
        target = tmp_path / f"{source.stem}.o"
        subprocess.run(["cc", "-std=c99", "-ffreestanding", "-c", source, "-o", target], check=True)
        symbols = subprocess.run(["nm", target], capture_output=True, text=True, check=True).stdout
        kinds = {line.split()[-2] for line in symbols.splitlines()}
        assert kinds <= set("TtRrU"), symbols  # no data, no common, no zeroed data
        unknown = re.findall(r" U (\w+)", symbols)
        assert all(name.startswith("lax_") or name == "memset" for name in unknown), unknown
