"""What a connected machine shows of itself, whatever it does."""

from __future__ import annotations

from typing import TYPE_CHECKING

from duoglide.arrays import FloatArray, read_only
from duoglide.control.host.drivetrain import Drivetrain
from duoglide.drives.cia402 import State, decode
from duoglide.kinematics.model import forward

if TYPE_CHECKING:
    from duoglide.control.host.connection import Connection
    from duoglide.control.streamer.supervise import Trip
    from duoglide.drives.simulated import SimulatedDrives
    from duoglide.machine import Machine


class ConnectedMachine:
    """A machine, its drives and what they say.

    Args:
        machine: Its description.
        connection: To its drives.
    """

    def __init__(self, machine: Machine, connection: Connection) -> None:
        self.machine = machine
        self._connection = connection
        self._drives = Drivetrain(machine, connection)

    @property
    def bus(self) -> str:
        """Name of the bus, as others can open it."""
        return self._connection.bus

    @property
    def simulated(self) -> SimulatedDrives | None:
        """The simulated drives of a ``virtual`` bus; None where they are somebody else's."""
        return self._connection.simulated

    @property
    def homed(self) -> bool:
        """Whether the drives' position reference is known."""
        return self._drives.homed

    @property
    def enabled(self) -> bool:
        """Whether all three drives are under power and follow setpoints."""
        return self._drives.enabled

    @property
    def latched(self) -> tuple[Trip, ...]:
        """What has made the machine stop since the last ``reset_fault``, in order."""
        return self._drives.latched

    @property
    def states(self) -> tuple[State, State, State]:
        """The CiA 402 states of the drives.

        Raises:
            DriveError: A statusword matches no state.
        """
        first, second, third = map(decode, self._drives.latest.statusword)
        return first, second, third

    @property
    def carriages(self) -> FloatArray:
        """Where the drives say that the carriages are [mm], shape (3,)."""
        return read_only(self._drives.carriages)

    @property
    def held(self) -> FloatArray:
        """Where the setpoints hold the carriages [mm], shape (3,)."""
        return read_only(self._drives.held)

    @property
    def position(self) -> FloatArray:
        """Platform centre O' in the base frame, from the carriages [mm], shape (3,).

        Raises:
            NotHomedError: The reference is not known.
        """
        self._drives.require_homed()
        return forward(self.machine.geometry, self.carriages)
