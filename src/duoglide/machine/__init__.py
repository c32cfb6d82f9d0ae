"""What the machine is: dimensions, limits and drives, in one frozen value and one TOML file."""

from duoglide.machine.cell import Box
from duoglide.machine.drive_quirks import Homing, Quirks
from duoglide.machine.drive_settings import DriveSettings, Reference
from duoglide.machine.geometry import Geometry
from duoglide.machine.limits import CarriageLimits
from duoglide.machine.machine import Machine
from duoglide.machine.masses import Masses
from duoglide.machine.timing import Timing

__all__ = [
    "Box",
    "CarriageLimits",
    "DriveSettings",
    "Geometry",
    "Homing",
    "Machine",
    "Masses",
    "Quirks",
    "Reference",
    "Timing",
]
