"""conformance.json, run on the simulated Python axis and on the C reference axis."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from duoglide.drives.cia402 import decode
from duoglide.drives.simulation.firmware.homing import HomingAxis
from duoglide.drives.simulation.firmware.objects import RefusalError
from duoglide.drives.simulation.node.application import AxisApplication

VECTORS = json.loads(
    (Path(__file__).parents[2] / "firmware_interface" / "conformance.json").read_text()
)
CASES = [pytest.param(case, id=case["name"]) for case in VECTORS["cases"]]


def number(text: int | str) -> int:
    return int(text, 0) if isinstance(text, str) else text


def key(text: str) -> tuple[int, int]:
    index, sub = text.split(":")
    return int(index, 16), int(sub)


class Run:
    """One case on one axis."""

    def __init__(self, axis: AxisApplication) -> None:
        self.axis = axis
        self.encoder: int | None = None  # None: it follows the demand
        self.reading = 0

    def step(self, kind: str, *values: Any) -> None:
        getattr(self, f"do_{kind}")(*values)

    def do_write(self, target: str, value: int | str) -> None:
        self.axis.write(*key(target), number(value))

    def do_refused(self, target: str, value: int | str, abort: str) -> None:
        with pytest.raises(RefusalError) as refusal:
            self.axis.write(*key(target), number(value))
        assert refusal.value.code == number(abort)

    def do_setpoint(self, controlword: str, target: int) -> None:
        self.axis.setpoint(number(controlword), target)

    def do_sync(self) -> None:
        self.axis.sync()

    def do_heartbeat(self) -> None:
        self.axis.heartbeat()

    def do_operational(self, state: bool) -> None:
        self.axis.communication(state)

    def do_fault(self, code: str) -> None:
        self.axis.fault(number(code))

    def do_sto(self, active: bool) -> None:
        self.axis.set_sto(active)

    def do_inputs(self, word: str) -> None:
        self.axis.set_inputs(number(word))

    def do_encoder(self, reading: int | str) -> None:
        self.encoder = None if reading == "follows" else int(reading)

    def do_tick(self, dt: int, times: int) -> None:
        for _ in range(times):
            demand = self.axis.servo_demand // 256
            self.reading = demand if self.encoder is None else self.encoder
            self.axis.tick(dt, self.reading)

    def do_expect(self, wanted: dict[str, Any]) -> None:
        assert {name: self.observe(name) for name in wanted} == {
            name: self.wanted(value) for name, value in wanted.items()
        }

    def observe(self, name: str) -> Any:
        if name == "state":
            return decode(self.axis.statusword).name
        if name == "emergencies":
            return self.axis.take_emergencies()
        if name in ("demand", "demand_256"):
            origin = self.reading - self.axis.read(0x6064, 0)
            demand = self.axis.servo_demand - 256 * origin
            return demand if name == "demand_256" else demand // 256
        if ":" in name:
            return self.axis.read(*key(name))
        return getattr(self.axis, name)

    def wanted(self, value: Any) -> Any:
        if isinstance(value, list):
            return [number(item) for item in value]
        return number(value) if isinstance(value, str) and value.startswith("0x") else value


def replay(case: dict[str, Any], axis: AxisApplication) -> None:
    run = Run(axis)
    for step in VECTORS["setups"][case["setup"]] + case["steps"]:
        run.step(*step)


@pytest.mark.parametrize("case", CASES)
def test_the_simulated_axis_conforms(case: dict[str, Any]) -> None:
    replay(case, HomingAxis())


@pytest.mark.parametrize("case", CASES)
def test_the_c_axis_conforms(
    case: dict[str, Any], make_c_axis: Callable[[], AxisApplication]
) -> None:
    replay(case, make_c_axis())
