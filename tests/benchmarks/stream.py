"""A million cycles in virtual time: ``python tests/benchmarks/stream.py [CYCLES]``.

The streamer's own code, on a bus that answers at once and a clock that is a counter. Every
setpoint of every run is looked for in what was sent: once each, in order, none else between.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Sequence

import duoglide as dg
from duoglide.control.channel.events import Happening
from duoglide.control.channel.orders import Command, Order, Power
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.channel.setpoints import Fence, PreparedSetpoints
from duoglide.control.host.connection import describe_stream
from duoglide.control.host.run.prepare import prepare
from duoglide.control.streamer.cycle import Streamer
from duoglide.drives import pdo
from duoglide.storage.records import Phase

OFF = 0x0250
ANSWERS = {0x06: 0x0231, 0x07: 0x0233, 0x0F: 0x1237}  # ready, switched on, following setpoints


class World:
    """Bus, drives, host and records of a streamer, in one object."""

    def __init__(self, start: tuple[int, int, int]) -> None:
        self.targets: list[list[int]] = [[], [], []]
        self.actual = list(start)
        self.latched = list(start)
        self.words = [OFF] * 3
        self.queue: list[tuple[int, bytes]] = []
        self.waiting: list[Order] = []
        self.handed_over: dict[int, PreparedSetpoints] = {}
        self.events: list[EventEntry] = []
        self.cycles = 0
        self.host_gone, self.host_waited = False, 0
        self.signs_of_life = 0

    def send(self, frames: Sequence[tuple[int, bytes]]) -> None:
        for identifier, data in frames:
            if identifier == pdo.SYNC:
                self.answer()
            elif pdo.RPDO1 < identifier <= pdo.RPDO1 + 3:
                axis = identifier - pdo.RPDO1 - 1
                word, target = pdo.SETPOINT.unpack(data)
                self.words[axis] = ANSWERS.get(word, OFF)
                self.targets[axis].append(target)

    def answer(self) -> None:
        """Answer SYNC: where the drives are, and that they are alive."""
        self.cycles += 1
        beat = self.cycles % 20 == 0
        for axis in range(3):
            data = pdo.FEEDBACK.pack(self.words[axis], self.actual[axis])
            self.queue.append((pdo.TPDO1 + axis + 1, data))
            if beat:
                self.queue.append((pdo.HEARTBEAT + axis + 1, b"\5"))
            self.actual[axis] = self.latched[axis]
            if self.targets[axis]:
                self.latched[axis] = self.targets[axis][-1]

    echoes = False

    def receive(self) -> list[tuple[int, bytes]]:
        frames, self.queue = self.queue, []
        return frames

    def close(self) -> None:
        pass

    def orders(self) -> list[Order]:
        orders, self.waiting = self.waiting, []
        return orders

    def prepared(self, number: int) -> PreparedSetpoints | None:
        return self.handed_over.get(number)

    def following(self, number: int) -> PreparedSetpoints | None:
        return None

    def put_cycle(self, entry: CycleEntry) -> None:
        self.signs_of_life += 1

    def put_event(self, entry: EventEntry) -> None:
        self.events.append(entry)


def main(cycles: int = 1_000_000) -> int:
    """Run, check, print; 1 if a setpoint was lost or out of order."""
    machine = dg.Machine.default()
    ends = (-41.0, -100.0, 300.0), (-41.0, 100.0, 300.0)
    ways = [dg.transfer(machine, *ends), dg.transfer(machine, *ends[::-1])]
    fence = Fence.of(machine)
    prepared_ways = [prepare(way, fence, i + 1, Phase.PROGRAM) for i, way in enumerate(ways)]
    world = World(prepared_ways[0].first)
    world.handed_over = {prepared.number: prepared for prepared in prepared_ways}
    streamer = Streamer(world, describe_stream(machine), world, world)
    world.waiting = [Order(Command.POWER, Power.ON)]
    period = round(machine.drives.cycle * 1e9)
    number, runs, wrong, sent = 0, 0, 0, 0
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.perf_counter()
    while number < cycles:
        number += 1
        streamer.cycle(number, number * period, 0, 0)
        if any(event.kind == Happening.FINISHED for event in world.events) or number == 20:
            prepared = prepared_ways[runs % 2]
            if runs:
                grid = prepared_ways[(runs - 1) % 2].stretches[0].grid[1:]
                for axis in range(3):
                    expected = [row[axis] for row in grid]
                    wrong += world.targets[axis][-len(grid) :] != expected
                    sent += len(grid)
            for targets in world.targets:
                del targets[:-1]
            assert not any(event.kind == Happening.TRIP for event in world.events), world.events
            world.events.clear()
            number_of = prepared.number
            world.waiting = [Order(Command.RUN, number_of, 1.0), Order(Command.END, number_of)]
            runs += 1
    took = time.perf_counter() - began
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory
    print(
        f"{number} cycles, {runs} runs, {sent} setpoints: {wrong} rows lost or out of order;"
        f" {1e6 * took / number:.1f} us a cycle without a bus, memory grown by {grown} kB"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:2])))
