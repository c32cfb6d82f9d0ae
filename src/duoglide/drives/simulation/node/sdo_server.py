"""The SDO server of a simulated drive: expedited and segmented transfers (CiA 301 7.2.4)."""

from __future__ import annotations

import struct
from collections.abc import Callable

from duoglide.drives.simulation.firmware.objects import RefusalError
from duoglide.drives.simulation.node.objects import NodeObjects

TOGGLE = 0x05030000
BAD_COMMAND = 0x05040001
_HEAD = struct.Struct("<BHB")


class SdoServer:
    """Answers requests of eight bytes; one transfer at a time."""

    def __init__(self, objects: NodeObjects, reply: Callable[[bytes], None]) -> None:
        self._objects = objects
        self._reply = reply
        self._index = self._sub = 0
        self._buffer = bytearray()
        self._toggle = 0

    def request(self, data: bytes) -> None:
        """Answer one request."""
        kind = data[0] >> 5
        handler = {
            0: self._download_segment,
            1: self._download,
            2: self._upload,
            3: self._upload_segment,
            5: self._upload,  # a block upload may be answered by a plain one
        }.get(kind)
        if kind == 4:  # the client aborts
            return
        try:
            if kind in (1, 2, 5, 6):
                _, self._index, self._sub = _HEAD.unpack_from(data)
            if handler is None:
                raise RefusalError(BAD_COMMAND)
            handler(data)
        except RefusalError as refusal:
            head = _HEAD.pack(0x80, self._index, self._sub)
            self._reply(head + struct.pack("<I", refusal.code))

    def _upload(self, data: bytes) -> None:
        value = self._objects.upload(self._index, self._sub)
        if len(value) <= 4:
            command = 0x43 | (4 - len(value)) << 2
            body = value.ljust(4, b"\0")
        else:
            command, body = 0x41, struct.pack("<I", len(value))
            self._buffer, self._toggle = bytearray(value), 0
        self._reply(_HEAD.pack(command, self._index, self._sub) + body)

    def _upload_segment(self, data: bytes) -> None:
        self._check_toggle(data[0])
        part = bytes(self._buffer[:7])
        del self._buffer[:7]
        command = (data[0] & 0x10) | (7 - len(part)) << 1 | (not self._buffer)
        self._reply(bytes((command,)) + part.ljust(7, b"\0"))

    def _download(self, data: bytes) -> None:
        if data[0] & 0x02:
            size = 4 - (data[0] >> 2 & 3) if data[0] & 0x01 else 4
            self._objects.download(self._index, self._sub, data[4 : 4 + size])
        else:
            self._buffer, self._toggle = bytearray(), 0
        self._reply(_HEAD.pack(0x60, self._index, self._sub) + bytes(4))

    def _download_segment(self, data: bytes) -> None:
        self._check_toggle(data[0])
        self._buffer += data[1 : 8 - (data[0] >> 1 & 7)]
        if data[0] & 1:
            self._objects.download(self._index, self._sub, bytes(self._buffer))
        self._reply(bytes((0x20 | data[0] & 0x10,)) + bytes(7))

    def _check_toggle(self, command: int) -> None:
        if command & 0x10 != self._toggle:
            raise RefusalError(TOGGLE)
        self._toggle ^= 0x10
