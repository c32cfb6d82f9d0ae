"""Frames of any identifier, length and content: the cycle never raises and names its stops."""

from __future__ import annotations

import numpy as np
import pytest
from cell_by_hand import CellByHand
from straight import Straight

import duoglide as dg
from duoglide.control.channel.events import Happening
from duoglide.drives.bus.socketcand import ERROR_FRAME, decode_received

START = np.array([-250.0, 100.0, -150.0])
A_CYCLE = 4  # frames: a fifth of the bus at 1 Mbit/s
NEAR = (0x080, 0x081, 0x182, 0x183, 0x281, 0x701, 0x702, 0x77F, 0x201, ERROR_FRAME)


def storm(machine: dg.Machine, frames: int) -> None:
    """Send so many frames, begin anew after every stop, and look at what is said of it."""
    chance = np.random.default_rng(11)
    sent = 0
    while sent < frames:
        cell = CellByHand(machine, START).enable()
        cell.run(Straight(machine, START, length=250.0, duration=0.25))
        near = 0.1 * chance.random()  # how many of them look like somebody's of this bus
        for _ in range(200):
            for _ in range(A_CYCLE):
                identifier = int(chance.integers(0, 0x800))
                if chance.random() < near:
                    identifier = NEAR[int(chance.integers(len(NEAR)))]
                cell.strange.append((identifier, chance.bytes(int(chance.integers(0, 9)))))
            sent += A_CYCLE
            cell.cycles(1)
        cell.cycles(50)
        assert cell.completed or cell.tripped() or not cell.happened(Happening.STARTED)


def test_no_frame_raises_out_of_the_cycle(machine: dg.Machine) -> None:
    storm(machine, 20_000)


@pytest.mark.slow
def test_no_frame_of_a_million_raises_out_of_the_cycle(machine: dg.Machine) -> None:
    storm(machine, 1_000_000)


def test_no_message_of_a_server_raises() -> None:
    chance = np.random.default_rng(5)
    words = [b"frame", b"error", b"<", b"-1", b"181", b"0x1", b"zz", b"1.0", b"FFFFFFFFFF", b"00"]
    for _ in range(20_000):
        count = int(chance.integers(1, 6))
        decode_received([words[int(chance.integers(len(words)))] for _ in range(count)])
    assert decode_received([b"frame", b"181", b"1.0", b"0102"]) == (0x181, b"\1\2")
    assert decode_received([b"frame", b"-1", b"1.0", b"0102"]) is None
    assert decode_received([b"oh"]) is None
