"""Two hosts on one bus: whenever the second one begins, never both get power."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

import duoglide as dg
from duoglide.control.channel.events import Happening
from duoglide.control.channel.ring import CycleEntry, EventEntry
from duoglide.control.host.connection import describe_stream
from duoglide.control.streamer.cycle import Streamer

QUIET = 12  # cycles
BEFORE_POWER = (
    2 * QUIET
)  # a host without company goes on after that: see control/host/connection.py
Frame = tuple[int, bytes]


@dataclass
class Host:
    """A streamer with a host that gives no orders yet; ``other`` hears what it sends."""

    begins: int
    other: Host | None = None
    heard: list[Frame] = field(default_factory=list)
    company: int | None = None  # the cycle in which it was told of another host
    number: int = 0

    echoes = False
    host_gone = False
    host_waited = signs_of_life = 0

    def __post_init__(self) -> None:
        settings = replace(describe_stream(dg.Machine.default()), quiet=QUIET)
        inbox: Any = self
        self.streamer = Streamer(inbox, settings, inbox, inbox)

    def turn(self, instant: int) -> None:
        if instant >= self.begins and not self.goes_away:
            self.number += 1
            self.streamer.cycle(self.number, 2_000_000 * instant, 0, 0)

    @property
    def goes_away(self) -> bool:
        """Whether it has given way, which it does before it gets power or not at all."""
        return self.company is not None and self.company <= BEFORE_POWER

    @property
    def has_power(self) -> bool:
        return self.number > BEFORE_POWER and not self.goes_away

    def send(self, frames: Sequence[Frame]) -> None:
        assert self.other is not None
        if self.other.number:  # whoever has not begun hears nothing
            self.other.heard += frames

    def receive(self) -> list[Frame]:
        frames, self.heard = self.heard, []
        return frames

    def orders(self) -> list[Any]:
        return []

    def put_cycle(self, entry: CycleEntry) -> None:
        pass

    def put_event(self, entry: EventEntry) -> None:
        if entry.kind == Happening.FOREIGN and self.company is None:
            self.company = self.number


@pytest.mark.parametrize("swapped", [False, True])  # which of them is first within a cycle
def test_never_both_of_two_hosts_get_power(swapped: bool) -> None:
    alone = 0
    for later in range(4 * QUIET):
        first, second = Host(0), Host(later)
        first.other, second.other = second, first
        turns = (second, first) if swapped else (first, second)
        for instant in range(later + 4 * QUIET):
            for host in turns:
                host.turn(instant)
        assert not (first.has_power and second.has_power), f"{later} cycles later"
        alone += first.has_power or second.has_power
    assert alone > 2 * QUIET, "whoever begins much later finds the other one and goes"


def test_a_host_that_is_alone_gets_power() -> None:
    host, nobody = Host(0), Host(10**9)
    host.other, nobody.other = nobody, host
    for instant in range(4 * QUIET):
        host.turn(instant)
    assert host.has_power
