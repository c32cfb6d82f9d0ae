"""A whole cell in one thread, by a clock that is a counter: streamer, bus, drives with plants."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from host_by_hand import HostByHand

import duoglide as dg
from duoglide.control.channel.events import Happening
from duoglide.control.channel.orders import Command, Power
from duoglide.control.channel.ring import CycleEntry, EventEntry, Ring
from duoglide.control.channel.setpoints import Fence
from duoglide.control.host.connection import describe_stream
from duoglide.control.host.run.prepare import prepare
from duoglide.control.streamer.cycle import Streamer
from duoglide.drives import pdo
from duoglide.drives.simulation.plant import PlantParameters
from duoglide.drives.simulation.rack import build_rack
from duoglide.motion.led_stops import LedStops
from duoglide.storage.records import Phase

Frame = tuple[int, bytes]
Spoil = Callable[[Frame], list[Frame]]


def _pass_on(frame: Frame) -> list[Frame]:
    return [frame]


class CellByHand(HostByHand):
    """Streamer and simulated drives; ``cycles`` lets time pass.

    Args:
        machine: Its drives and limits.
        carriages: Where they stand [mm].
        plants: What hangs on each drive.

    Attributes:
        to_drives: What becomes of a frame on its way to the drives.
        to_host: Likewise, to the streamer.
        log: Every cycle.
    """

    def __init__(
        self,
        machine: dg.Machine,
        carriages: Sequence[float],
        plants: Sequence[PlantParameters] | None = None,
    ) -> None:
        super().__init__()
        self.machine = machine
        self.rack = build_rack(machine.drives, carriages, plants, standstill=0.0)
        for node, place in zip(self.rack.nodes, carriages, strict=True):
            node._zero = node.plant.position - place  # it counts from the middle, as if homed
        self.to_drives: Spoil = _pass_on
        self.to_host: Spoil = _pass_on
        self.log: list[CycleEntry] = []
        self.strange: list[Frame] = []
        self.signs_of_life = 0
        self.number = 0
        self._period = round(machine.drives.cycle * 1e9)
        self._answers: list[Frame] = []
        self._heard: list[Frame] = []
        descriptor = Ring.allocate()
        self._ring = Ring(descriptor)
        self.streamer = Streamer(self, describe_stream(machine), self, self)
        self.rack.attach(lambda can_id, data: self._answers.append((can_id, data)))
        self._bring_up()

    def _bring_up(self) -> None:
        for now in (0, 1000):
            self.rack.poll(now)
        drives = self.machine.drives
        for node, scale in zip(self.rack.nodes, drives.increments_per_mm, strict=True):
            write = node.objects.write
            write(0x6060, 0, 8)
            write(0x60C2, 1, round(drives.cycle * 1e3))
            write(0x60C2, 2, -3)
            write(0x6085, 0, round(drives.quick_stop_deceleration[0] * scale))
            write(0x6065, 0, round(drives.following_error_window * scale))
            write(0x6066, 0, round(drives.following_error_time * 1e3))
            write(0x1400, 5, round(drives.setpoint_timeout * 1e3))
            write(0x1017, 0, round(drives.heartbeat_period * 1e3))
            write(0x6007, 0, 3)
            write(0x605A, 0, 6)
            write(0x607F, 0, round(1.1 * float(self.machine.limits.velocity[0]) * scale))
        self.rack.receive(pdo.NMT, pdo.pack_nmt(pdo.Nmt.START, 0), 1000)
        self._answers.clear()  # what they said while they booted

    # what tests do

    def enable(self) -> CellByHand:
        self.cycles(5)
        self.order(Command.POWER, Power.ON)
        self.cycles(20)
        assert self.happened(Happening.POWER)[-1].value, "the drives are not enabled"
        return self

    def run(
        self,
        trajectory: Any,
        margin_at: Any = None,
        override: float = 1.0,
        led: LedStops | None = None,
    ) -> None:
        """Begin a run; it goes on as cycles pass."""
        fence = Fence.of(self.machine)
        number = len(self.handed_over) + 1
        prepared = prepare(trajectory, fence, number, Phase.PROGRAM, margin_at)
        prepared = replace(prepared, led=led)
        self.handed_over[number] = prepared
        self.order(Command.RUN, number, override)
        self.order(Command.END, number)

    def cycles(self, count: int, skipped: int = 0) -> None:
        for _ in range(count):
            self.number += 1 + skipped
            now = self.number * self._period
            self._collect()  # what drives have said by themselves since the last SYNC
            self.streamer.cycle(self.number, now, skipped * self._period, skipped)
            self.rack.poll(now // 1000 + 1)
            self._collect()

    def pass_within(self, share: float) -> None:
        """Let the drives come to a share of the cycle that has begun, 0 to 1."""
        self.rack._pass_to((self.number * self._period + int(share * self._period)) // 1000)

    def _collect(self) -> None:
        answers, self._answers = self._answers, []
        self._heard += [kept for frame in answers for kept in self.to_host(frame)]

    def to_the_end(self, most: int = 5000) -> None:
        """Let cycles pass until the run is over, and all stands."""
        begun = len(self.events)
        for _ in range(most):
            self.cycles(1)
            if any(
                event.kind in (Happening.FINISHED, Happening.STOPPED)
                for event in self.events[begun:]
            ):
                break
        else:
            raise AssertionError(f"the run is not over after {most} cycles")
        self.cycles(100)

    @property
    def events_of_loss(self) -> list[EventEntry]:
        return self.happened(Happening.LOST)

    @property
    def completed(self) -> bool:
        return bool(self.happened(Happening.FINISHED))

    @property
    def carriages(self) -> np.ndarray:
        """Where the carriages really are [mm]."""
        return np.array([node.plant.position for node in self.rack.nodes])

    # what the streamer sees

    def send(self, frames: Sequence[Frame]) -> None:
        now = self.number * self._period // 1000
        for frame in frames:
            for can_id, data in self.to_drives(frame):
                self.rack.receive(can_id, data, now)

    def receive(self) -> list[Frame]:
        frames = self._heard + self.strange
        self._heard, self.strange = [], []
        return frames

    def put_cycle(self, entry: CycleEntry) -> None:
        self._ring.put_cycle(entry)
        self._drain()

    def put_event(self, entry: EventEntry) -> None:
        self._ring.put_event(entry)
        self._drain()

    def _drain(self) -> None:
        """Take records out of a real ring, so that one that does not fit in fails here too."""
        self.signs_of_life += 1
        for entry in self._ring.drain():
            if isinstance(entry, CycleEntry):
                self.log.append(entry)
            else:
                self.events.append(entry)
