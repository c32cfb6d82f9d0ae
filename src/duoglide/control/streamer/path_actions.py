"""What a path asks for on its way: outputs at their places, waits for inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from duoglide.arrays import AXES
from duoglide.control.channel.orders import Happening

if TYPE_CHECKING:
    from duoglide.control.streamer.follower import Motion
    from duoglide.control.streamer.wire import Wire


class Tell(Protocol):
    """Records an event of this cycle."""

    def __call__(
        self, kind: Happening, axis: int = 0, detail: int = 0, code: int = 0, value: float = 0.0
    ) -> None:
        """Record it."""


class PathActions:
    """The drives' outputs and inputs, as a path uses them.

    Args:
        wire: Where outputs go and inputs come from.
        tell: Records what was done.
    """

    def __init__(self, wire: Wire, tell: Tell) -> None:
        self._wire = wire
        self._tell = tell
        self._outputs = [0] * AXES

    def set_outputs(self, axis: int, word: int) -> None:
        """Set 0x60FE:1 of one axis (index) with the frames of this cycle."""
        self._outputs[axis] = word
        self._wire.switch(axis, word)
        self._tell(Happening.OUTPUT, axis=axis + 1, code=word)

    def carry_out(self, motion: Motion) -> None:
        """Do what the path asks for here: outputs, and the end of waits."""
        for action in motion.due():
            axis = action.axis - 1
            mask = 1 << action.bit
            word = self._outputs[axis] | mask if action.value else self._outputs[axis] & ~mask
            self.set_outputs(axis, word)
        if (wait := motion.wait) is None:
            return
        if bool(self._wire.tracks[wait.axis - 1].inputs >> wait.bit & 1) == wait.value:
            self._tell(Happening.INPUT, wait.axis, wait.bit, value=motion.waited)
            motion.go_on()
        elif motion.waited >= wait.timeout:
            self._tell(Happening.INPUT_TIMEOUT, wait.axis, wait.bit, value=motion.waited)
            motion.stop()
