"""canopen's SDO client, with another way from a request to its answer, and with our errors.

canopen's own fails a read at a late answer to another request, takes any late confirmation for that
of a write, leaves the second answer to a repeated request to whoever asks next, and repeats the
request for a segment, which a drive cannot answer twice. Blocking: never call it from a callback of
the bus.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Iterator
from contextlib import contextmanager

import can
import canopen
from canopen.sdo import SdoAbortedError, SdoCommunicationError
from canopen.sdo import SdoClient as CanopenClient

from duoglide.drives.pdo import SDO_REPLY, SDO_REQUEST
from duoglide.errors import BusError, DriveError, DriveTimeout

_ANSWER_TO = {1: 3, 2: 2, 0: 1, 3: 0}  # command specifiers: write, read, and a segment of either
_SEGMENTS = (0, 3)
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
    0x06070012: "too many bytes",
    0x06070013: "too few bytes",
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
WRONG_LENGTHS = (0x06070010, 0x06070012, 0x06070013)


class ObjectError(DriveError):
    """A drive does not have, or does not keep, an object as the host needs it.

    Attributes:
        index: Of the object.
        sub: Its sub-index.
    """

    def __init__(self, message: str, *, axis: int, index: int = 0, sub: int = 0) -> None:
        super().__init__(message, axis=axis)
        self.index, self.sub = index, sub


class SdoRefusalError(ObjectError):
    """The drive has answered with an abort code.

    Attributes:
        abort: The code.
    """

    def __init__(
        self, message: str, *, axis: int, abort: int, index: int = 0, sub: int = 0
    ) -> None:
        super().__init__(message, axis=axis, index=index, sub=sub)
        self.abort = abort


class SdoClient(CanopenClient):  # type: ignore[misc]  # canopen is not typed
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
        super().__init__(SDO_REQUEST + node_id, SDO_REPLY + node_id, canopen.ObjectDictionary())
        self.network = network
        self._drive = f"axis {axis} (node {node_id})"
        self._axis = axis
        self._timeout = timeout
        self._retries = retries
        network.subscribe(self.tx_cobid, self.on_response)

    def close(self) -> None:
        """Stop listening."""
        self.network.unsubscribe(self.tx_cobid, self.on_response)

    def on_response(self, can_id: int, data: bytearray, timestamp: float) -> None:
        """Keep an answer for whoever waits; one that was cut short is none."""
        if len(data) == 8:
            super().on_response(can_id, data, timestamp)

    def upload(self, index: int, subindex: int, timeout: float | None = None) -> bytes:
        """Read an object.

        Raises:
            DriveTimeout: No answer, however often it was asked.
            SdoRefusalError: The drive refuses.
            BusError: The bus has failed.
        """
        with self._transfer("reading", index, subindex, timeout):
            restarts = self._retries
            while True:
                stream = self.open(index, subindex, buffering=0)
                try:
                    return bytes(stream.read())
                except SdoCommunicationError:  # of a segment; the object can be asked for again
                    if not restarts:
                        raise
                    restarts -= 1

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object of up to four bytes; raises as ``upload`` does."""
        with self._transfer("writing", index, subindex, None):
            super().download(index, subindex, data)

    @contextmanager
    def _transfer(self, what: str, index: int, sub: int, timeout: float | None) -> Iterator[None]:
        """Bound the wait for each answer, and name the axis and the object in errors."""
        name = f"{what} 0x{index:04X}:{sub}"
        self.RESPONSE_TIMEOUT = self._timeout if timeout is None else timeout
        try:
            yield
        except SdoAbortedError as refusal:
            words = ABORT_WORDS.get(refusal.code, "unknown abort code")
            raise SdoRefusalError(
                f"{self._drive}, {name}: refused, {words} (0x{refusal.code:08X})",
                axis=self._axis,
                abort=refusal.code,
                index=index,
                sub=sub,
            ) from refusal
        except SdoCommunicationError as silence:
            raise DriveTimeout(f"{self._drive}, {name}: {silence}", axis=self._axis) from silence
        except can.CanError as error:
            raise BusError(f"axis {self._axis}, {name}: {error}") from error

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send a request until it is answered; what answers another one is dropped."""
        while not self.responses.empty():
            self.responses.get_nowait()
        tries = 1 if sdo_request[0] >> 5 in _SEGMENTS else 1 + self._retries
        for repeats in range(tries):
            self.network.send_message(self.rx_cobid, sdo_request)
            answer = self._answer_to(sdo_request)
            if answer is None:
                continue
            for _ in range(repeats):  # the answers that come late, or they come as the next
                if self._answer_to(sdo_request) is None:
                    break
            if answer[0] >> 5 == _ABORT:
                raise SdoAbortedError(int.from_bytes(answer[4:8], "little"))
            return answer
        raise SdoCommunicationError(
            f"no answer within {self.RESPONSE_TIMEOUT:g} s, asked {tries} times"
        )

    def _answer_to(self, request: bytes) -> bytes | None:
        deadline = time.monotonic() + self.RESPONSE_TIMEOUT
        while (left := deadline - time.monotonic()) > 0.0:
            try:
                answer: bytes = self.responses.get(timeout=left)
            except queue.Empty:
                return None
            if _fits(answer, request):
                return answer
        return None


def _fits(answer: bytes, request: bytes) -> bool:
    """Return whether an answer, or a refusal, is to this request."""
    asked, kind = request[0] >> 5, answer[0] >> 5
    if asked in _SEGMENTS:
        same = kind == _ABORT or not (answer[0] ^ request[0]) & 0x10  # the toggle bit
    else:
        same = answer[1:4] == request[1:4]  # the object
    return same and kind in (_ANSWER_TO[asked], _ABORT)
