"""What a drive watches: its host, and how far its carriage is from where it should be."""

from __future__ import annotations

from dataclasses import dataclass

HEARTBEAT_LOST = 0x8130
SETPOINT_LOST = 0x8250
SYNC_LOST = 0x8700

_MILLISECOND = 1000  # [us]
_WINDOW_OFF = 0xFFFFFFFF  # of 0x6065: do not watch


@dataclass(slots=True)
class HostWatch:
    """Watches the host's heartbeat and its setpoints.

    Each watch is armed by the first frame it watches, so that a drive may be brought up at
    leisure, and speaks once: it is armed again by the next frame.
    """

    setpoint_age: int = 0  # [us]
    sync_age: int = 0
    heartbeat_age: int = 0
    setpoint_armed: bool = False
    heartbeat_armed: bool = False

    def take_setpoint(self, armed: bool) -> None:
        """Note a setpoint; it arms the watch in NMT OPERATIONAL."""
        self.setpoint_age = 0
        self.setpoint_armed = armed

    def take_heartbeat(self) -> None:
        """Note a heartbeat."""
        self.heartbeat_age = 0
        self.heartbeat_armed = True

    def advance(self, dt: int) -> None:
        """Let time pass [us]."""
        self.setpoint_age += dt
        self.sync_age += dt
        self.heartbeat_age += dt

    def lost_heartbeat(self, consumer: int) -> bool:
        """Whether the heartbeat has just been lost; ``consumer`` is 0x1016:1."""
        limit = (consumer & 0xFFFF) * _MILLISECOND
        if not (self.heartbeat_armed and limit and self.heartbeat_age > limit):
            return False
        self.heartbeat_armed = False
        return True

    def lost_setpoints(self, timer: int) -> int:
        """Return the emergency if setpoints have just been lost, or 0; ``timer`` is 0x1400:5."""
        limit = timer * _MILLISECOND
        if not (self.setpoint_armed and limit and self.setpoint_age > limit):
            return 0
        self.setpoint_armed = False
        return SYNC_LOST if self.sync_age > limit else SETPOINT_LOST


@dataclass(slots=True)
class FollowingWatch:
    """Watches the following error, 0x6065 and 0x6066."""

    beyond: int = 0  # for how long it has been outside [us]

    def exceeded(self, dt: int, error: int, window: int, timeout: int) -> bool:
        """Let ``dt`` pass with this error; whether it has now been outside for too long."""
        if window == _WINDOW_OFF or abs(error) <= window:
            self.beyond = 0
            return False
        self.beyond += dt
        return self.beyond > timeout * _MILLISECOND
