"""The frames of conformance.json, run on a simulated node with the Python and with the C axis."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from duoglide.drives import pdo
from duoglide.drives.linear_axis import object_dictionary
from duoglide.drives.simulation.firmware.homing import HomingAxis
from duoglide.drives.simulation.node.application import AxisApplication
from duoglide.drives.simulation.node.node import DriveNode
from duoglide.drives.simulation.plant import Plant

NODE = 5
VECTORS = json.loads(
    (Path(__file__).parents[2] / "firmware_interface" / "conformance.json").read_text()
)
CASES = [pytest.param(case, id=case["name"]) for case in VECTORS["frames"]]
_HEAD = struct.Struct("<BHB")


def number(text: int | str) -> int:
    return int(text, 0) if isinstance(text, str) else text


class Run:
    """One case: a drive that was just switched on, and the host at the other end."""

    def __init__(self, make_axis: Callable[[], AxisApplication]) -> None:
        self.dictionary = object_dictionary(NODE)
        self.heard: list[tuple[int, bytes]] = []
        self.answers: list[bytes] = []
        self.node = DriveNode(NODE, make_axis, Plant(), 1000.0)
        self.node.send = self.hear
        self.node.advance(1000)

    def hear(self, can_id: int, data: bytes) -> None:
        if can_id == pdo.SDO_REPLY + NODE:
            self.answers.append(data)
        else:
            self.heard.append((can_id, data))

    def step(self, kind: str, *values: Any) -> None:
        getattr(self, "do_" + kind.replace(" ", "_"))(*values)

    def ask(self, command: int, target: str, data: bytes = b"") -> bytes:
        """Send a request; return the four bytes of its answer, or of the abort code."""
        index, sub = target.split(":")
        request = _HEAD.pack(command, int(index, 16), int(sub)) + data.ljust(4, b"\0")
        self.node.receive(pdo.SDO_REQUEST + NODE, request)
        (answer,) = self.answers
        self.answers.clear()
        assert answer[1:4] == request[1:4]
        self.aborted = answer[0] == 0x80
        return answer[4:]

    def size(self, target: str) -> int:
        index, sub = target.split(":")
        entry = self.dictionary[int(index, 16)]
        return len(entry if hasattr(entry, "data_type") else entry[int(sub)]) // 8

    def download(self, target: str, value: int | str) -> int:
        """Write an object; return the abort code, 0 for success."""
        size = self.size(target)
        data = number(value).to_bytes(size, "little", signed=number(value) < 0)
        return int.from_bytes(self.ask(0x23 | (4 - size) << 2, target, data), "little")

    def do_write(self, target: str, value: int | str) -> None:
        assert f"{self.download(target, value):#010x}" == f"{0:#010x}"

    def do_refused(self, target: str, value: int | str, abort: str) -> None:
        assert f"{self.download(target, value):#010x}" == abort.lower()

    def do_read(self, target: str, value: int | str) -> None:
        data = self.ask(0x40, target)
        assert not self.aborted, data.hex()
        assert int.from_bytes(data[: self.size(target)], "little") == number(value)

    def do_unreadable(self, target: str, abort: str) -> None:
        data = self.ask(0x40, target)
        assert self.aborted
        assert int.from_bytes(data, "little") == number(abort)

    def do_send(self, can_id: str, data: str) -> None:
        self.node.receive(int(can_id, 16), bytes.fromhex(data))

    def do_pass(self, microseconds: int, times: int) -> None:
        for _ in range(times):
            self.node.advance(microseconds)

    def do_power_cycle(self) -> None:
        self.node.reboot()
        self.node.advance(1000)

    def do_hear(self, wanted: list[list[str]]) -> None:
        heard, self.heard = self.heard, []
        assert heard == [(int(can_id, 16), bytes.fromhex(data)) for can_id, data in wanted]


@pytest.mark.parametrize("case", CASES)
def test_the_simulated_drive_conforms_on_the_bus(case: dict[str, Any]) -> None:
    run = Run(HomingAxis)
    for step in case["steps"]:
        run.step(*step)


@pytest.mark.parametrize("case", CASES)
def test_the_c_axis_conforms_on_the_bus(
    case: dict[str, Any], make_c_axis: Callable[[], AxisApplication]
) -> None:
    run = Run(make_c_axis)
    for step in case["steps"]:
        run.step(*step)
