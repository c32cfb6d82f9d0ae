from __future__ import annotations

from dataclasses import replace

import duoglide as dg
from duoglide.control.host.connection import describe_stream
from duoglide.control.streamer.tracks import AxisTrack
from duoglide.control.streamer.wire import Wire
from duoglide.drives import pdo
from duoglide.drives.cia402 import Mode
from duoglide.machine.drive_quirks import Quirks


def hear(track: AxisTrack, *syncs: int) -> int:
    """Let a cycle end in which the answers to these SYNCs came; return the one that counts."""
    for sync in syncs:
        track.on_feedback(pdo.FEEDBACK.pack(0x1637, sync))
    track.end_of_cycle(1)
    return track.actual


def regular() -> AxisTrack:
    track = AxisTrack()
    for sync in range(1, 10):
        assert hear(track, sync) == sync
    return track


def test_an_answer_that_is_early_belongs_to_the_next_cycle() -> None:
    track = regular()
    assert [hear(track, 10, 11), hear(track), hear(track, 12)] == [10, 11, 12]


def test_after_answers_that_came_late_it_does_not_stay_behind() -> None:
    """The drives' process was held up; its last two answers come in one cycle."""
    track = regular()
    hear(track)
    hear(track)
    assert not track.certain
    hear(track, 10, 11)  # 12 is due
    assert not track.certain
    assert [hear(track, 12, 13), hear(track, 14), hear(track, 15)] == [13, 14, 15]
    assert track.certain


def test_what_came_after_a_gap_is_judged_only_once_it_is_regular() -> None:
    track = regular()
    assert track.settled
    hear(track)
    seen = []
    for sync in range(11, 16):
        hear(track, sync)
        seen.append(track.settled)
    assert seen == [False, False, False, True, True]


def test_how_long_a_drive_has_bounded_what_it_is_asked_for_is_counted() -> None:
    track = AxisTrack()
    for statusword, limited in ((0x1237, 0), (0x1A37, 1), (0x1A37, 2), (0x1237, 0)):
        track.on_feedback(pdo.FEEDBACK.pack(statusword, 0))
        track.end_of_cycle(1)
        assert track.limited == limited


class Lines:
    """A link of lists."""

    echoes = False

    def __init__(self, *frames: tuple[int, bytes]) -> None:
        self.heard, self.sent = list(frames), list[tuple[int, bytes]]()

    def send(self, frames: object) -> None:
        self.sent += frames  # type: ignore[arg-type]

    def receive(self) -> list[tuple[int, bytes]]:
        return self.heard


def test_what_is_not_mapped_by_the_host_is_neither_read_nor_written() -> None:
    """A maker's second TPDO may hold a 6 where the contract's has the mode: homing."""
    machine = dg.Machine.default()
    quirks = (Quirks(absent=(0x60FD, 0x60FE)), Quirks(), Quirks())
    machine = replace(machine, drives=replace(machine.drives, quirks=quirks))
    fifth = pdo.INPUTS.pack(0xFFFF, Mode.HOMING)
    link = Lines((pdo.TPDO2 + 1, fifth), (pdo.TPDO2 + 2, fifth))
    wire = Wire(link, describe_stream(machine))  # type: ignore[arg-type]
    wire.listen(1)
    assert [track.homing for track in wire.tracks] == [False, True, False]
    assert [track.inputs for track in wire.tracks] == [0, 0xFFFF, 0]
    for axis in range(3):
        wire.set_outputs(axis, 1)
    sent = {identifier for identifier, _ in wire._outputs}
    assert sent == {pdo.RPDO2 + 2, pdo.RPDO2 + 3}
