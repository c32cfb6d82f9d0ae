"""In what a drive of another maker differs from that of firmware_interface/, as data.

An imitated drive carries no signature: the host believes nothing of it that it would not believe of
a stranger.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from duoglide.drives.linear_axis import read_variables
from duoglide.machine.drive_quirks import Interlock

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

Key = tuple[int, int]  # index and sub-index of an object

_FIRST_RPDO, _FIRST_TPDO = 0x1400, 0x1800  # communication parameters
_MAPS = 0x200  # from there to the mapping parameters
_COB_IDS = {_FIRST_RPDO: 0x200, _FIRST_TPDO: 0x180}
_EVERY_SYNC = 1  # transmission type
_STATUSWORD = 0x60410010  # mapped
_BITS = {1: 0x05, 2: 0x06, 4: 0x07}  # data types without a sign, by their bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Imitation:
    """In what a drive differs from that of firmware_interface/.

    Attributes:
        absent: Indices of objects that it does not have.
        absent_subs: Single sub-indices that it does not have.
        values: What objects hold at power-on, whatever the contract says; those that the contract
            does not know are read-only numbers of 32 bits.
        fixed: Objects that cannot be written.
        allowed: The only values that objects take.
        running: Numbers of further TPDOs, from 3 on, that send the statusword on every SYNC as the
            drive is delivered.
        velocity_unit: What one unit of its velocities means [increments/s].
        acceleration_unit: What one unit of its accelerations means [increments/s^2].
        here: The homing method that takes the place where it stands for known; no other succeeds.
        home_object: What holds the position at the place of reference.
        home_sign: -1 where it subtracts that position.
        homes_on_level: Whether homing begins where bit 4 is set, and not only where it rises.
        interlock: What bit 3 of its inputs is while safe torque off is active.
        follows_bit: Whether bit 12 of the statusword says that it follows its setpoints.
        boot_delay: How long it takes to boot [s].
        sdo_delay: How long it takes for an answer [s].
    """

    absent: tuple[int, ...] = ()
    absent_subs: tuple[Key, ...] = ()
    values: Mapping[Key, int] = field(default_factory=dict)
    fixed: tuple[Key, ...] = ()
    allowed: Mapping[Key, tuple[int, ...]] = field(default_factory=dict)
    running: tuple[int, ...] = ()
    velocity_unit: float = 1.0
    acceleration_unit: float = 1.0
    here: int = 37
    home_object: Key = (0x607C, 0)
    home_sign: int = 1
    homes_on_level: bool = False
    interlock: Interlock = Interlock.SET
    follows_bit: bool = True
    boot_delay: float = 0.0
    sdo_delay: float = 0.0

    def variables(self, node_id: int) -> dict[Key, ODVariable]:
        """Return every variable of such a drive by index and sub-index.

        Args:
            node_id: Of the drive.
        """
        contract = read_variables(node_id)
        found = dict(contract)
        for key, value in self.values.items():
            found[key] = _holding(contract.get(key) or _constant(key), key, value)
        for number in self.running:
            _add_running_pdo(found, contract, _FIRST_TPDO + number - 1, node_id)
        if self.home_object not in found:
            found[self.home_object] = _holding(contract[0x607C, 0], self.home_object, 0)
        for key in self.fixed:
            found[key] = _holding(found[key], key, found[key].default)
            found[key].access_type = "ro"
        return {
            key: variable
            for key, variable in found.items()
            if key[0] not in self.absent and key not in self.absent_subs
        }


CONTRACT = Imitation()
"""No difference: a drive of firmware_interface/, with the signature of the simulation."""


def _holding(like: ODVariable, key: Key, value: int) -> ODVariable:
    """Return a variable of the same kind, that holds a value at power-on."""
    made = copy.copy(like)
    made.index, made.subindex, made.default = *key, value
    return made


def _constant(key: Key) -> ODVariable:
    from canopen.objectdictionary import ODVariable

    made = ODVariable(f"0x{key[0]:04X}:{key[1]}", *key)
    made.data_type, made.access_type = _BITS[4], "ro"
    return made


def _add_running_pdo(
    found: dict[Key, ODVariable], contract: Mapping[Key, ODVariable], parameters: int, node_id: int
) -> None:
    """Add a TPDO that is on at delivery."""
    number = parameters - _FIRST_TPDO
    cob_id = _COB_IDS[_FIRST_TPDO] + 0x100 * number + node_id
    for (index, sub), like in contract.items():
        if index == _FIRST_TPDO:
            held = {1: cob_id, 2: _EVERY_SYNC}.get(sub, like.default)
            found[parameters, sub] = _holding(like, (parameters, sub), held)
        elif index == _FIRST_TPDO + _MAPS:
            held = {0: 1, 1: _STATUSWORD}.get(sub, 0)
            key = (parameters + _MAPS, sub)
            found[key] = _holding(like, key, held)
