"""An SDO client that retries, tells time-outs from refusals, and ignores answers that come late.

canopen's own client takes the late answer to one request for the answer to the next, and writes
to the log on its own account. Blocking: never call it from a callback of the bus.
"""

from __future__ import annotations

import queue
import struct
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import can

from duoglide.drives.pdo import SDO_REPLY, SDO_REQUEST
from duoglide.errors import BusError, DriveError, DriveTimeout

if TYPE_CHECKING:
    import canopen

_HEAD = struct.Struct("<BHB")
_ABORT = 4

ABORT_WORDS = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "time-out",
    0x05040001: "command not known",
    0x06010000: "access not supported",
    0x06010001: "cannot be read",
    0x06010002: "cannot be written",
    0x06020000: "no such object",
    0x06040041: "cannot be mapped to a PDO",
    0x06040042: "the PDO would be too long",
    0x06040043: "parameter incompatible",
    0x06060000: "hardware error",
    0x06070010: "wrong length or type",
    0x06090011: "no such sub-index",
    0x06090030: "value not allowed",
    0x06090031: "value too high",
    0x06090032: "value too low",
    0x08000000: "general error",
    0x08000020: "cannot be stored",
    0x08000021: "local control prevents it",
    0x08000022: "not in this state of the device",
    0x08000023: "no object dictionary",
    0x08000024: "no data available",
}


class SdoRefusalError(DriveError):
    """The drive has answered with an abort code, in ``abort``."""

    def __init__(self, message: str, *, axis: int, abort: int) -> None:
        super().__init__(message, axis=axis)
        self.abort = abort


class SdoClient:
    """Reads and writes the objects of one drive.

    Args:
        network: Where it is.
        node_id: Its node number.
        axis: Which carriage, for errors.
        timeout: How long to wait for one answer [s].
        retries: How often to ask again.
    """

    def __init__(
        self, network: canopen.Network, node_id: int, axis: int, timeout: float, retries: int
    ) -> None:
        self._network = network
        self._node_id = node_id
        self._axis = axis
        self._timeout = timeout
        self._retries = retries
        self._answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        network.subscribe(SDO_REPLY + node_id, self._on_answer)

    def close(self) -> None:
        """Stop listening."""
        self._network.unsubscribe(SDO_REPLY + self._node_id, self._on_answer)

    def _on_answer(self, can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) == 8:
            self._answers.put(bytes(data))

    def upload(self, index: int, sub: int, timeout: float | None = None) -> bytes:
        """Read an object.

        Raises:
            DriveTimeout: No answer, however often it was asked.
            SdoRefusalError: The drive refuses.
            BusError: The bus has failed.
        """
        name = f"reading 0x{index:04X}:{sub}"
        request = _HEAD.pack(0x40, index, sub) + bytes(4)
        restarts = self._retries
        while True:
            answer = self._ask(request, _for(index, sub, 0x40), name, timeout)
            if answer[0] & 2:
                size = 4 - (answer[0] >> 2 & 3) if answer[0] & 1 else 4
                return answer[4 : 4 + size]
            try:
                return self._segments(name, timeout)
            except DriveTimeout:  # a segment cannot be asked for twice, the object can
                if not restarts:
                    raise
                restarts -= 1

    def _segments(self, name: str, timeout: float | None) -> bytes:
        """Read an object of more than four bytes, whose transfer has begun."""
        value, toggle = b"", 0
        while True:
            request = bytes((0x60 | toggle,)) + bytes(7)
            answer = self._ask(request, _segment(toggle), name, timeout, retries=0)
            value += answer[1 : 8 - (answer[0] >> 1 & 7)]
            if answer[0] & 1:
                return value
            toggle ^= 0x10

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write an object of up to four bytes; raises as ``upload`` does."""
        command = 0x23 | (4 - len(data)) << 2
        request = _HEAD.pack(command, index, sub) + data.ljust(4, b"\0")
        name = f"writing 0x{index:04X}:{sub}"
        self._ask(request, _for(index, sub, 0x60), name, None)

    def _ask(
        self,
        request: bytes,
        fits: Callable[[bytes], bool],
        name: str,
        timeout: float | None,
        retries: int | None = None,
    ) -> bytes:
        while not self._answers.empty():
            self._answers.get_nowait()
        tries = 1 + (self._retries if retries is None else retries)
        patience = self._timeout if timeout is None else timeout
        for attempt in range(tries):
            try:
                self._network.send_message(SDO_REQUEST + self._node_id, request)
            except can.CanError as error:
                raise BusError(f"axis {self._axis}, {name}: {error}") from error
            answer = self._wait(fits, patience)
            if answer is not None:
                self._swallow(fits, attempt, patience)
                return self._checked(answer, name)
        raise DriveTimeout(
            f"axis {self._axis} (node {self._node_id}), {name}: no answer"
            f" within {patience:g} s, asked {tries} times",
            axis=self._axis,
        )

    def _wait(self, fits: Callable[[bytes], bool], patience: float) -> bytes | None:
        deadline = time.monotonic() + patience
        while (left := deadline - time.monotonic()) > 0.0:
            try:
                answer = self._answers.get(timeout=left)
            except queue.Empty:
                return None
            if fits(answer):
                return answer
        return None

    def _swallow(self, fits: Callable[[bytes], bool], count: int, patience: float) -> None:
        """Wait for the answers to the requests that were repeated, or they come as the next."""
        for _ in range(count):
            if self._wait(fits, patience) is None:
                return

    def _checked(self, answer: bytes, name: str) -> bytes:
        if answer[0] >> 5 != _ABORT:
            return answer
        abort = int.from_bytes(answer[4:8], "little")
        words = ABORT_WORDS.get(abort, "unknown abort code")
        raise SdoRefusalError(
            f"axis {self._axis} (node {self._node_id}), {name}: refused, {words} (0x{abort:08X})",
            axis=self._axis,
            abort=abort,
        )


def _for(index: int, sub: int, command: int) -> Callable[[bytes], bool]:
    """Return whether an answer is for this object."""

    def fits(answer: bytes) -> bool:
        kind = answer[0] & 0xE0
        return _HEAD.unpack_from(answer)[1:] == (index, sub) and kind in (command, _ABORT << 5)

    return fits


def _segment(toggle: int) -> Callable[[bytes], bool]:
    """Return whether an answer is a segment with this toggle bit."""

    def fits(answer: bytes) -> bool:
        return answer[0] >> 5 == _ABORT or (answer[0] >> 5 == 0 and answer[0] & 0x10 == toggle)

    return fits
