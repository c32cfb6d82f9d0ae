from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from duoglide.drives import pdo
from duoglide.errors import DriveError

words = st.integers(0, 0xFFFF)
positions = st.integers(-(1 << 31), (1 << 31) - 1)


@settings(max_examples=50, deadline=None)
@given(words, positions)
def test_a_setpoint_is_six_bytes_little_endian(controlword: int, target: int) -> None:
    data = pdo.SETPOINT.pack(controlword, target)
    assert len(data) == 6
    assert int.from_bytes(data[:2], "little") == controlword
    assert int.from_bytes(data[2:], "little", signed=True) == target


@settings(max_examples=50, deadline=None)
@given(words, positions)
def test_feedback_survives_packing(statusword: int, actual: int) -> None:
    data = pdo.FEEDBACK.pack(statusword, actual)
    assert pdo.unpack_feedback(data) == pdo.Feedback(statusword, actual)


def test_a_position_beyond_32_bits_is_refused() -> None:
    with pytest.raises(struct.error):
        pdo.SETPOINT.pack(15, 1 << 31)


def test_feedback_that_is_cut_short_is_refused() -> None:
    with pytest.raises(DriveError, match="5 bytes"):
        pdo.unpack_feedback(bytes(5))


@pytest.mark.parametrize("size", range(3, 9))
def test_emergencies_are_read_at_any_length(size: int) -> None:
    emergency = pdo.unpack_emergency(pdo.pack_emergency(0x8611, 0x21, b"abcde")[:size])
    assert (emergency.code, emergency.register) == (0x8611, 0x21)


def test_an_nmt_command_names_its_node() -> None:
    assert pdo.pack_nmt(pdo.Nmt.START, 3) == b"\x01\x03"
