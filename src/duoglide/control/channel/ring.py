"""A ring of fixed-size records in shared memory: one process writes, one reads, nobody waits.

The writer never blocks: when the reader is too far behind, a record is dropped and counted. The
two counters are aligned 64-bit words, each written by one side only; that is enough on x86-64 and
AArch64 as CPython stores them, because the interpreter puts far more than a barrier between the
record and its counter.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterator
from struct import Struct
from typing import NamedTuple

from duoglide.control.channel.scale import IntTriple

_HEAD = 64  # bytes, eight words; the first six are used
_WRITTEN, _READ, _DROPPED, _ALIVE, _ORDERS, _FATAL = range(6)

CAPACITY = 16384  # records: half a minute at 500 Hz


class CycleEntry(NamedTuple):
    """One cycle, as the streamer writes it.

    Attributes:
        cycle: Number of the SYNC.
        time: When the cycle began, monotonic [ns].
        lateness: After its deadline [ns].
        skipped: Cycles left out before this one.
        path_time: Of the setpoint [s].
        rate: Path time per time.
        setpoint: Sent after this SYNC [increments].
        actual: Sampled at this SYNC [increments].
        following: Actual position less the setpoint that this SYNC should have found reached; 0
            where no answer came.
        controlword: Sent after this SYNC.
        statusword: Sampled at this SYNC.
        phase: A ``storage`` phase.
        missing: Bit i: no answer of drive i + 1 to this SYNC.
        state: A ``RunState``.
        power: A ``Power``.
        run: Number of the prepared setpoints.
    """

    cycle: int
    time: int
    lateness: int
    skipped: int
    path_time: float
    rate: float
    setpoint: IntTriple
    actual: IntTriple
    following: IntTriple
    controlword: IntTriple
    statusword: IntTriple
    phase: int
    missing: int
    state: int
    power: int
    run: int

    @classmethod
    def from_flat(cls, values: tuple[float, ...]) -> CycleEntry:
        """Build the entry from its 26 numbers in the ring."""
        v = values
        triples = (v[6:9], v[9:12], v[12:15], v[15:18], v[18:21])
        return cls._make((*v[:6], *triples, *v[21:]))


class EventEntry(NamedTuple):
    """Something that happened once; ``kind`` is a ``Happening``, ``detail`` depends on it."""

    cycle: int
    time: int
    kind: int
    axis: int
    detail: int
    code: int
    value: float


_CYCLE = Struct("<BQqqIdd9i6HBBBBI")
_EVENT = Struct("<BQqBBBId")
_IS_CYCLE, _IS_EVENT = 1, 2
_SIZE = 104


class Ring:
    """The shared memory and both ends of it.

    Args:
        descriptor: An open memory file of ``Ring.BYTES`` bytes; the ring does not close it.
    """

    BYTES = _HEAD + CAPACITY * _SIZE

    def __init__(self, descriptor: int) -> None:
        self._memory = mmap.mmap(descriptor, self.BYTES)
        self._words = memoryview(self._memory)[:_HEAD].cast("Q")  # written whole, never by bytes

    @staticmethod
    def allocate() -> int:
        """Make an anonymous memory file of the right size and return its descriptor."""
        descriptor = os.memfd_create("duoglide-ring", os.MFD_CLOEXEC)
        os.ftruncate(descriptor, Ring.BYTES)
        return descriptor

    def put_cycle(self, entry: CycleEntry) -> None:
        """Write the record of a cycle, or count it as dropped."""
        at = self._room()
        if at:
            cycle, time, lateness, skipped, u, rate, a, b, c, d, e, *rest = entry
            _CYCLE.pack_into(
                self._memory, at, _IS_CYCLE, cycle, time, lateness, skipped, u, rate,
                *a, *b, *c, *d, *e, *rest,
            )  # fmt: skip
            self._words[_WRITTEN] += 1

    def put_event(self, entry: EventEntry) -> None:
        """Write the record of an event, or count it as dropped."""
        at = self._room()
        if at:
            _EVENT.pack_into(self._memory, at, _IS_EVENT, *entry)
            self._words[_WRITTEN] += 1

    def drain(self) -> Iterator[CycleEntry | EventEntry]:
        """Take every record that is there, oldest first."""
        while self._words[_READ] < self._words[_WRITTEN]:
            at = _HEAD + self._words[_READ] % CAPACITY * _SIZE
            if self._memory[at] == _IS_CYCLE:
                yield CycleEntry.from_flat(_CYCLE.unpack_from(self._memory, at)[1:])
            else:
                yield EventEntry(*_EVENT.unpack_from(self._memory, at)[1:])
            self._words[_READ] += 1

    def show_life(self) -> None:
        """Let the writer see that the reader is alive."""
        self._words[_ALIVE] += 1

    @property
    def signs_of_life(self) -> int:
        """How often the reader has shown life."""
        return self._words[_ALIVE]

    def announce_order(self) -> None:
        """Let the writer know that an order waits; one thread at a time."""
        self._words[_ORDERS] += 1

    @property
    def orders(self) -> int:
        """How many orders have been announced."""
        return self._words[_ORDERS]

    @property
    def fatal_signals(self) -> int:
        """Bit n: signal n would end the reader's process, if it heard it."""
        return self._words[_FATAL]

    @fatal_signals.setter
    def fatal_signals(self, bits: int) -> None:
        self._words[_FATAL] = bits

    @property
    def dropped(self) -> int:
        """How many records found no room."""
        return self._words[_DROPPED]

    def close(self) -> None:
        """Unmap the memory."""
        self._words.release()
        self._memory.close()

    def _room(self) -> int:
        """Return where the next record goes, 0 for nowhere."""
        written = self._words[_WRITTEN]
        if written - self._words[_READ] >= CAPACITY:
            self._words[_DROPPED] += 1
            return 0
        return _HEAD + written % CAPACITY * _SIZE
