"""One look at a machine: all that a page shows of it, as it was at one time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from duoglide.arrays import FloatArray, read_only
from duoglide.control.channel.events import RunState
from duoglide.control.host.run.handle import RunStatus
from duoglide.drives.cia402 import State
from duoglide.kinematics.model import forward

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot

_SILENCE = 1.0  # [s]; a stream that has something to say says it hundreds of times a second


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What a machine was like.

    Attributes:
        states: Of the three drives.
        carriages: Where they were [mm], shape (3,).
        homed: Whether the drives knew where they were.
        why_not_homed: Why not; empty where they did.
        enabled: Whether all drives were under power and followed setpoints.
        latched: What has stopped the machine since the last reset, in words; that nothing is heard
            of the stream any more, too.
        position: Platform centre O' [mm], shape (3,); None where it is not known.
        run: What the run in progress was doing; None where nothing ran.
    """

    states: tuple[State, ...]
    carriages: FloatArray
    homed: bool
    why_not_homed: str
    enabled: bool
    latched: tuple[str, ...]
    position: FloatArray | None
    run: RunStatus | None

    @classmethod
    def at(cls, robot: Robot) -> Look:
        """Look at a machine of this process.

        Raises:
            DuoglideError: It cannot be seen.
        """
        run = robot.current_run
        latched = [trip.words for trip in robot.latched]
        if robot.trace.silence > _SILENCE:
            latched.append("nothing is heard of the stream any more")
        homed, carriages = robot.homed, robot.carriages
        return cls(
            states=robot.states,
            carriages=carriages,
            homed=homed,
            why_not_homed=robot.why_not_homed,
            enabled=robot.enabled,
            latched=tuple(latched),
            position=forward(robot.machine.geometry, carriages) if homed else None,
            run=run.status if run is not None else None,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        run = self.run
        return {
            "states": [state.name for state in self.states],
            "carriages": self.carriages.tolist(),
            "homed": self.homed,
            "why_not_homed": self.why_not_homed,
            "enabled": self.enabled,
            "latched": list(self.latched),
            "position": self.position.tolist() if self.position is not None else None,
            "run": _status_to_dict(run) if run is not None else None,
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Look:
        """Read it back.

        Raises:
            KeyError: Something is missing.
        """
        run, position = values["run"], values["position"]
        return cls(
            states=tuple(State[name] for name in values["states"]),
            carriages=read_only(np.array(values["carriages"])),
            homed=bool(values["homed"]),
            why_not_homed=str(values["why_not_homed"]),
            enabled=bool(values["enabled"]),
            latched=tuple(map(str, values["latched"])),
            position=read_only(np.array(position)) if position is not None else None,
            run=RunStatus(**{**run, "state": RunState[run["state"]]}) if run is not None else None,
        )


def _status_to_dict(status: RunStatus) -> dict[str, Any]:
    return {
        "state": status.state.name,
        "path_time": status.path_time,
        "rate": status.rate,
        "carriages": status.carriages,
        "following_error": status.following_error,
        "lateness": status.lateness,
        "override": status.override,
    }
