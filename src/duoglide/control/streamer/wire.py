"""The cycle's frames: SYNC, heartbeat, setpoints and outputs out; the drives' words in."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from duoglide.control.streamer.link import is_fatal
from duoglide.control.streamer.tracks import AxisTrack
from duoglide.drives import pdo
from duoglide.errors import BusError

if TYPE_CHECKING:
    from duoglide.control.channel.orders import StreamSettings
    from duoglide.control.channel.scale import IntTriple
    from duoglide.control.streamer.link import Frame, Link


class Wire:
    """The streamer's frames on one link.

    A link that cannot be read is dead, and stays so: only a new streamer opens the bus again. A
    frame that is not taken is a lost one; the next cycle tries anew.

    Args:
        link: The bus.
        settings: Node numbers, and how often to send a heartbeat.

    Attributes:
        tracks: What has been heard of each drive.
        unsent: Whether a frame of this cycle was not taken.
        failed: Whether the link is dead, or its controller is bus-off or error-passive.
        foreign: Whether somebody else has commanded the drives since the cycle before.
    """

    def __init__(self, link: Link, settings: StreamSettings) -> None:
        self._link = link
        self._nodes = settings.node_ids
        self._every = settings.heartbeat_every
        self._setpoint_ids = tuple(pdo.RPDO1 + node for node in settings.node_ids)
        beat = (pdo.HEARTBEAT + settings.host_node, bytes((pdo.NmtState.OPERATIONAL,)))
        self.tracks = tuple(AxisTrack() for _ in settings.node_ids)
        ours = () if link.echoes else (pdo.SYNC, beat[0], *self._setpoint_ids)
        self._handlers = dict.fromkeys(ours, self._notice_foreigner)
        self._has_outputs = settings.outputs
        for node, track, inputs in zip(
            settings.node_ids, self.tracks, settings.inputs, strict=True
        ):
            self._handlers[pdo.TPDO1 + node] = track.on_feedback
            if inputs:
                self._handlers[pdo.TPDO2 + node] = track.on_inputs
            self._handlers[pdo.EMCY + node] = track.on_emergency
            self._handlers[pdo.HEARTBEAT + node] = track.on_heartbeat
        self._sync: tuple[Frame, ...] = ((pdo.SYNC, b""),)
        self._sync_and_beat: tuple[Frame, ...] = (*self._sync, beat)
        self._outputs: list[Frame] = []
        self._dead = False
        self.unsent = self.failed = self.foreign = False

    def begin(self, number: int, previous: int) -> None:
        """Send SYNC, and the heartbeat when it is due between these two cycles."""
        self.unsent = False
        beat = number // self._every != previous // self._every
        self._send(self._sync_and_beat if beat else self._sync)

    def listen(self, cycles: int) -> None:
        """Read what has come since the last time, ``cycles`` ago."""
        self.foreign = False
        try:
            if not self._dead:
                self._take(self._link.receive())
        except BusError:
            self._dead = self.failed = True
        for track in self.tracks:
            track.end_of_cycle(cycles)
        first, second, third = self.tracks
        if first.missing or second.missing or third.missing:
            self._count_those_alone()

    def _take(self, frames: Iterable[Frame]) -> None:
        """Read frames in the order in which they came; those of strangers are passed over."""
        for identifier, data in frames:
            handler = self._handlers.get(identifier)
            if handler is not None:
                handler(data)
            elif identifier == pdo.ERROR_FRAME:
                self.failed = self.failed or is_fatal(data)

    def _notice_foreigner(self, data: bytes) -> None:
        self.foreign = True

    def _count_those_alone(self) -> None:
        """Tell a drive that is silent from a computer on which no simulated drive runs."""
        if any(not track.missing for track in self.tracks):
            for track in self.tracks:
                track.alone += bool(track.missing)

    def set_outputs(self, axis: int, word: int) -> None:
        """Send the outputs of one axis (index) with the frames of this cycle, if it has any."""
        if not self._has_outputs[axis]:  # what a maker maps there may be a controlword
            return
        self._outputs.append((pdo.RPDO2 + self._nodes[axis], pdo.OUTPUTS.pack(word)))

    def command(self, words: IntTriple, targets: IntTriple) -> None:
        """Send the controlwords and setpoints of this cycle, and outputs that are due."""
        pack = pdo.SETPOINT.pack
        self._send(
            [
                (identifier, pack(word, target))
                for identifier, word, target in zip(self._setpoint_ids, words, targets, strict=True)
            ]
            + self._outputs
        )
        self._outputs = []

    def flush(self) -> None:
        """Send outputs that are due, and nothing else."""
        if self._outputs:
            self._send(self._outputs)
            self._outputs = []

    def _send(self, frames: Sequence[Frame]) -> None:
        try:
            if self._dead:
                raise BusError("the bus has failed")
            self._link.send(frames)
        except BusError:
            self.unsent = True
