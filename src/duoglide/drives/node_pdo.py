"""The process data of a simulated drive: PDOs as they are mapped now (CiA 301 7.3.3)."""

from __future__ import annotations

from dataclasses import dataclass

from duoglide.drives import pdo
from duoglide.drives.application import AxisApplication
from duoglide.drives.node_objects import NodeObjects

_PDO_TOO_SHORT = 0x8210
_INVALID = 1 << 31
_TIMED = 254  # transmission types from here on act on events


@dataclass(slots=True)
class Channel:
    """One PDO as it is configured."""

    can_id: int
    every: int  # transmission type: 1 to 240 every n-th SYNC, 254 and 255 on events
    entries: tuple[tuple[int, int, int], ...]  # index, subindex, bits
    size: int
    waiting: bytes = b""  # received, not yet acted upon
    sent: bytes = b""  # last value, to see a change
    count: int = 0  # SYNCs since the last one sent

    @property
    def cyclic(self) -> bool:
        """Whether SYNC drives it."""
        return self.every < _TIMED


class ProcessData:
    """Receives, latches, and packs PDOs."""

    def __init__(self, objects: NodeObjects, axis: AxisApplication, node_id: int) -> None:
        self._objects = objects
        self._axis = axis
        self._node_id = node_id
        self._receive: dict[int, Channel] = {}
        self._transmit: list[Channel] = []

    def _configure(self) -> None:
        self._objects.map_changed = False
        received = [self._channel(0x1400 + i, 0x1600 + i) for i in (0, 1)]
        self._receive = {c.can_id: c for c in received if c is not None}
        sent = [self._channel(0x1800 + i, 0x1A00 + i) for i in (0, 1)]
        self._transmit = [c for c in sent if c is not None]

    def _channel(self, parameters: int, mapping: int) -> Channel | None:
        read = self._objects.read
        cob_id = read(parameters, 1)
        raw = [read(mapping, i + 1) for i in range(read(mapping, 0))]
        entries = tuple((e >> 16, e >> 8 & 0xFF, e & 0xFF) for e in raw)
        if cob_id & _INVALID or not entries:
            return None
        size = sum(bits for *_, bits in entries) // 8
        return Channel(cob_id & 0x7FF, read(parameters, 2), entries, size)

    def forget(self) -> None:
        """Drop what waits, on a change of NMT state."""
        self._configure()

    def listens(self, can_id: int) -> bool:
        """Whether a frame is one of this drive's RPDOs."""
        return can_id in self._receive

    def receive(self, can_id: int, data: bytes) -> int:
        """Take an RPDO; returns an emergency code, or 0."""
        channel = self._receive[can_id]
        if len(data) < channel.size:
            return _PDO_TOO_SHORT
        if channel.cyclic:
            channel.waiting = data
        else:
            self._act(channel, data)
        return 0

    def latch(self) -> None:
        """Let the RPDOs that came since the last SYNC act."""
        for channel in self._receive.values():
            if channel.waiting:
                data, channel.waiting = channel.waiting, b""
                self._act(channel, data)

    def _act(self, channel: Channel, data: bytes) -> None:
        if channel.entries == pdo.RPDO1_MAPPING:
            self._axis.setpoint(*pdo.SETPOINT.unpack_from(data))
            return
        values = {}
        for index, sub, bits in channel.entries:
            part, data = data[: bits // 8], data[bits // 8 :]
            values[index, sub] = int(self._objects.variables[index, sub].decode_raw(part))
        if (0x6040, 0) in values and (0x607A, 0) in values:
            self._axis.setpoint(values.pop((0x6040, 0)), values.pop((0x607A, 0)))
        for key, value in values.items():
            self._objects.write(*key, value)

    def sync(self) -> list[tuple[int, bytes]]:
        """Return the frames that this SYNC asks for."""
        frames = []
        for channel in self._transmit:
            if channel.cyclic:
                channel.count += 1
                if channel.count >= max(channel.every, 1):
                    channel.count = 0
                    frames.append((channel.can_id, self._pack(channel)))
        return frames

    def events(self, everything: bool = False) -> list[tuple[int, bytes]]:
        """Return the frames of event-driven PDOs whose values have changed."""
        frames = []
        for channel in self._transmit:
            if not channel.cyclic:
                data = self._pack(channel)
                if everything or data != channel.sent:
                    channel.sent = data
                    frames.append((channel.can_id, data))
        return frames

    def _pack(self, channel: Channel) -> bytes:
        if channel.entries == pdo.TPDO1_MAPPING:
            return pdo.FEEDBACK.pack(self._axis.statusword, self._axis.actual)
        if channel.entries == pdo.TPDO2_MAPPING:
            return pdo.INPUTS.pack(self._axis.read(0x60FD, 0), self._axis.read(0x6061, 0))
        parts = []
        for index, sub, bits in channel.entries:
            value = self._objects.read(index, sub) & ((1 << bits) - 1)
            parts.append(value.to_bytes(bits // 8, "little"))
        return b"".join(parts)
