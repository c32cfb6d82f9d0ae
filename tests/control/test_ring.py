from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from duoglide.control.channel.ring import CAPACITY, CycleEntry, EventEntry, Ring


@pytest.fixture
def ends() -> Iterator[tuple[Ring, Ring]]:
    descriptor = Ring.allocate()
    writer, reader = Ring(descriptor), Ring(descriptor)
    os.close(descriptor)
    yield writer, reader
    writer.close()
    reader.close()


def entry(cycle: int) -> CycleEntry:
    return CycleEntry(
        cycle, 10**12 + cycle, 53_000, 0, 0.1 * cycle, 1.0 / 3.0,
        (-(2**31), 2**31 - 1, cycle), (1, -2, 3), (-4, 5, -6), (15, 6, 7), (0x1237, 0xFFFF, 0),
        2, 7, 1, 2, cycle,
    )  # fmt: skip


def test_records_come_out_as_they_went_in_and_in_order(ends: tuple[Ring, Ring]) -> None:
    writer, reader = ends
    sent = [entry(1), EventEntry(2, -5, 9, 3, 17, 0x8611, 2.5), entry(3)]
    writer.put_cycle(sent[0])
    writer.put_event(sent[1])
    writer.put_cycle(sent[2])
    assert list(reader.drain()) == sent
    assert list(reader.drain()) == []


def test_the_writer_never_waits_and_what_finds_no_room_is_counted(ends: tuple[Ring, Ring]) -> None:
    writer, reader = ends
    for cycle in range(CAPACITY + 5):
        writer.put_cycle(entry(cycle))
    assert reader.dropped == 5
    assert [e.cycle for e in reader.drain()] == list(range(CAPACITY))
    writer.put_cycle(entry(99))
    assert [e.cycle for e in reader.drain()] == [99]


def test_the_writer_sees_that_the_reader_lives(ends: tuple[Ring, Ring]) -> None:
    writer, reader = ends
    before = writer.signs_of_life
    reader.show_life()
    assert writer.signs_of_life == before + 1
