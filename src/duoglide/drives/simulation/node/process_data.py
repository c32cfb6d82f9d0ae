"""The process data of a simulated drive: PDOs as they are mapped now (CiA 301 7.3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

from duoglide.drives import pdo
from duoglide.drives.simulation.node.application import AxisApplication
from duoglide.drives.simulation.node.objects import NodeObjects

_PDO_TOO_SHORT = 0x8210
_INVALID = 1 << 31
_MOST = 8  # PDOs in a direction
_TIMED = 254  # transmission types from here on act on events


@dataclass(slots=True)
class Channel:
    """One PDO as it is configured; two are equal if they are configured alike."""

    can_id: int
    every: int  # transmission type: 1 to 240 every n-th SYNC, 254 and 255 on events
    entries: tuple[tuple[int, int, int], ...]  # index, subindex, bits
    inhibit: int = 0  # least time between two transmissions on events [us]
    timer: int = 0  # longest time between them; 0: no limit [us]
    waiting: bytes = field(default=b"", compare=False)  # received, not yet acted upon
    sent: bytes = field(default=b"", compare=False)  # last value, to see a change
    age: int = field(default=0, compare=False)  # since it was sent [us]
    count: int = field(default=0, compare=False)  # SYNCs since the last one sent

    @property
    def size(self) -> int:
        """How many bytes it has."""
        return sum(bits for *_, bits in self.entries) // 8

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
        """Look at the parameters again; a PDO that they leave alone goes on as it was."""
        self._objects.map_changed = False
        before = [*self._receive.values(), *self._transmit]
        takes, sends = (
            [before[before.index(c)] if c in before else c for c in self._channels(first)]
            for first in (0x1400, 0x1800)
        )
        self._receive = {c.can_id: c for c in takes}
        self._transmit = sends

    def _channels(self, first: int) -> list[Channel]:
        """Return the PDOs of one direction that are on."""
        there = (i for i in range(first, first + _MOST) if (i, 1) in self._objects.variables)
        return [channel for i in there if (channel := self._channel(i)) is not None]

    def _channel(self, parameters: int) -> Channel | None:
        read, mapping = self._objects.read, parameters + 0x200
        cob_id = read(parameters, 1)
        raw = [read(mapping, i + 1) for i in range(read(mapping, 0))]
        entries = tuple((e >> 16, e >> 8 & 0xFF, e & 0xFF) for e in raw)
        if cob_id & _INVALID or not entries:
            return None
        sends = parameters >= 0x1800
        inhibit, timer = (read(parameters, 3), read(parameters, 5)) if sends else (0, 0)
        return Channel(cob_id & 0x7FF, read(parameters, 2), entries, 100 * inhibit, 1000 * timer)

    def forget(self) -> None:
        """Drop what waits, on a change of NMT state."""
        self._receive, self._transmit = {}, []
        self._configure()

    def listens(self, can_id: int) -> bool:
        """Whether a frame is one of this drive's RPDOs."""
        if self._objects.map_changed:
            self._configure()
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
        if self._objects.map_changed:
            self._configure()
        frames = []
        for channel in self._transmit:
            if channel.cyclic:
                channel.count += 1
                if channel.count >= max(channel.every, 1):
                    channel.count = 0
                    frames.append((channel.can_id, self._pack(channel)))
        return frames

    def events(self, dt: int) -> list[tuple[int, bytes]]:
        """Let ``dt`` [us] pass; return the event-driven frames that are due.

        A PDO is sent when its value has changed, and when its event timer is over, but not before
        its inhibit time is.
        """
        if self._objects.map_changed:
            self._configure()
        frames = []
        for channel in self._transmit:
            if channel.cyclic:
                continue
            channel.age += dt
            data = self._pack(channel)
            due = data != channel.sent or 0 < channel.timer <= channel.age
            if due and (channel.age >= channel.inhibit or not channel.sent):
                channel.sent, channel.age = data, 0
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
