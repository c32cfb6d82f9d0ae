"""A bench for the streamer: three drives' firmware on a bus made of lists, and a clock by hand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from host_by_hand import HostByHand
from straight import Straight

import duoglide as dg
from duoglide.control.channel.orders import Command, Policy, Power, StreamSettings
from duoglide.control.channel.ring import CycleEntry
from duoglide.control.channel.setpoints import Fence, PreparedSetpoints
from duoglide.control.host.run.prepare import prepare
from duoglide.control.streamer.cycle import Streamer
from duoglide.drives import pdo
from duoglide.drives.cia402 import Mode
from duoglide.drives.simulation.firmware.axis import FirmwareAxis
from duoglide.errors import BusError
from duoglide.storage.records import Phase

CYCLE = 2_000_000  # ns
TICK = 100  # us


@dataclass
class Drive:
    """One drive's firmware behind its frames; the carriage is where the demand is."""

    node: int
    axis: FirmwareAxis = field(default_factory=FirmwareAxis)
    latched: tuple[int, int] | None = None
    mute: bool = False
    beats: bool = True
    on: bool = True

    def on_sync(self) -> list[tuple[int, bytes]]:
        self.axis.sync()
        if self.latched is not None:
            self.axis.setpoint(*self.latched)
            self.latched = None
        if self.mute or not self.on:
            return []
        word = pdo.FEEDBACK.pack(self.axis.statusword, self.axis.actual)
        return [(pdo.TPDO1 + self.node, word)]

    def pass_time(self, microseconds: int) -> list[tuple[int, bytes]]:
        for _ in range(microseconds // TICK):
            self.axis.tick(TICK, self.axis.servo_demand // 256)
        frames = [
            (pdo.EMCY + self.node, pdo.pack_emergency(code, 1))
            for code in self.axis.take_emergencies()
        ]
        return frames if self.on else []


class Bench(HostByHand):
    """A streamer, its bus, its drives and its host, all in one thread."""

    def __init__(self, machine: dg.Machine, **policy: int) -> None:
        super().__init__()
        self.machine = machine
        self.drives = [Drive(node) for node in machine.drives.node_ids]
        self.log: list[CycleEntry] = []
        self.sent: list[tuple[int, bytes]] = []
        self.reading = True
        self.broken = False
        self.deaf = False
        self.lose: Callable[[int], bool] = lambda identifier: False
        self._queue: list[tuple[int, bytes]] = []
        self._answers: list[tuple[int, bytes]] = []
        self._life = 0
        self.number = 0
        values = {"heartbeat": 125, "host": 500, **policy}
        settings = StreamSettings(machine.drives.node_ids, CYCLE, 127, 25, Policy(**values))
        self.streamer = Streamer(self, settings, self, self)
        for drive in self.drives:
            drive.axis.communication(True)
            drive.axis.write(0x6060, 0, Mode.CYCLIC_SYNCHRONOUS_POSITION)
            drive.axis.write(0x1400, 5, 20)
            drive.axis.write(0x6007, 0, 3)
            drive.axis.write(0x605A, 0, 6)

    # what the tests do

    def step(self, cycles: int = 1, skipped: int = 0) -> None:
        """Let cycles pass; ``skipped`` cycles are left out before each."""
        for _ in range(cycles):
            if self.streamer.done:
                return
            self._pass_time(skipped * CYCLE // 1000)
            self.number += 1 + skipped
            late = skipped * CYCLE
            self.streamer.cycle(self.number, self.number * CYCLE, late, skipped)
            self._queue, self._answers = self._queue + self._answers, []
            self._pass_time(CYCLE // 1000)

    def _pass_time(self, microseconds: int) -> None:
        for drive in self.drives:
            self._queue += drive.pass_time(microseconds)
            if drive.beats and self.number % 25 == 0:
                self._queue.append((pdo.HEARTBEAT + drive.node, bytes((5,))))

    def interfere(self, identifier: int, data: bytes = b"") -> None:
        """Let somebody else send a frame."""
        self._queue.append((identifier, data))

    def enable(self) -> Bench:
        self.step(3)
        self.order(Command.POWER, Power.ON)
        self.step(12)
        return self

    def run(self, trajectory: Any, override: float = 1.0) -> PreparedSetpoints:
        prepared = prepare(
            trajectory, Fence.of(self.machine), len(self.handed_over) + 1, Phase.PROGRAM
        )
        self.handed_over[prepared.number] = prepared
        self.order(Command.RUN, prepared.number, override)
        self.order(Command.END, prepared.number)
        return prepared

    def straight(self, **options: Any) -> Straight:
        """A trajectory that starts where the drives stand."""
        scale = np.array(self.machine.drives.increments_per_mm)
        start = np.array([drive.axis.actual for drive in self.drives]) / scale
        return Straight(self.machine, start, **options)

    def place(self, *carriages: float) -> Bench:
        for drive, mm in zip(self.drives, carriages, strict=True):
            drive.axis.origin = -round(mm * 1000.0)
            drive.axis.tick(TICK, 0)
        return self

    def setpoints(self) -> np.ndarray:
        return np.array([e.setpoint for e in self.log])

    # what the streamer sees of its bus, its host and its ring

    def send(self, frames: Sequence[tuple[int, bytes]]) -> None:
        if self.broken:
            raise BusError("no buffer space")
        for identifier, data in frames:
            self.sent.append((identifier, data))
            if not self.lose(identifier):
                self._hear(identifier, data)

    def _hear(self, identifier: int, data: bytes) -> None:
        for drive in self.drives:
            if identifier == pdo.SYNC:
                self._answers += drive.on_sync()
            elif identifier == pdo.RPDO1 + drive.node:
                drive.latched = pdo.SETPOINT.unpack(data)
            elif identifier == pdo.RPDO2 + drive.node:
                drive.axis.write(0x60FE, 1, pdo.OUTPUTS.unpack(data)[0])

    def receive(self) -> list[tuple[int, bytes]]:
        if self.deaf:
            raise BusError("the bus is dead")
        frames, self._queue = self._queue, []
        return [frame for frame in frames if not self.lose(frame[0])]

    def put_cycle(self, entry: CycleEntry) -> None:
        self.log.append(entry)

    @property
    def signs_of_life(self) -> int:
        self._life += self.reading
        return self._life


@pytest.fixture
def make_bench(machine: dg.Machine) -> Callable[..., Bench]:
    """Return a maker of benches; the carriages stand well apart."""

    def make(**policy: int) -> Bench:
        return Bench(machine, **policy).place(-200.0, 100.0, -100.0)

    return make


@pytest.fixture
def bench(make_bench: Callable[..., Bench]) -> Bench:
    return make_bench()
