"""Bring-up of one drive: who it is, then everything it must know before it gets power.

The order is that of real drives: identity first, PDO mapping with its own ritual, then timing,
watchdogs, stops and limits; everything that can be is read back.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from duoglide.drives import pdo
from duoglide.drives.axis.objects import DriveObjects
from duoglide.drives.axis.pdo_maps import (
    OTHER_RPDOS,
    OTHER_TPDOS,
    PDO_MAPS,
    map_pdo,
    switch_off_pdo,
)
from duoglide.drives.axis.sdo_client import ObjectError, SdoRefusalError
from duoglide.drives.cia402 import METHODS_HERE, Mode
from duoglide.drives.scale import RateUnits
from duoglide.errors import ConfigError, DriveError, DriveTimeout, DuoglideWarning
from duoglide.machine.drive_contract import answer_to
from duoglide.machine.drive_settings import Reference

PROFILE_402 = 402  # low word of 0x1000
_SCAN_PATIENCE = 0.5  # [s]
_FIRST_ANSWER = 0.1  # how long to wait for one answer of a drive that may still be booting [s]
_WORTH_TELLING = 1.0  # of waiting [s]
_SLOW, _LOOKS = 0.03, 3  # an answer that takes as long whenever it is asked for [s]
_REQUESTS = 150  # of one bring-up, roughly
_NO_LIMIT = {(0x607D, 1): -(1 << 31), (0x607D, 2): (1 << 31) - 1}
_SPEED_ROOM = 1.1  # so that a drive that has fallen behind by a lost setpoint may catch up
_PERIOD_AGREES = 1e-3  # share
_MILLI, _BYTE = -3, 255  # of 0x60C2: the exponent that all drives know, the largest value
_ABORT_QUICK_STOP = 3  # 0x6007: quick stop when the host is lost
_RAMP = 1  # 0x605B, 0x605C: brake first
_RAMP_QUICK = 2  # 0x605D, 0x605E: brake at 0x6085


class DriveWarning(DuoglideWarning):
    """A drive keeps its host waiting."""


@dataclass(frozen=True, slots=True)
class Identity:
    """What a drive says it is (0x1000, 0x1008, 0x1018, 0x6502)."""

    device_type: int
    vendor_id: int
    product_code: int
    revision: int
    serial: int
    name: str
    modes: int


def wait_for_boot(drive: DriveObjects) -> None:
    """Wait until a drive answers at all; drives may boot later than the host.

    Raises:
        DriveTimeout: Nothing within ``boot_timeout``; says which nodes were heard.
    """
    if not await_answer(drive):
        raise no_answer(drive)


def await_answer(drive: DriveObjects) -> bool:
    """Wait until a drive answers at all, and return whether it has within ``boot_timeout``.

    Warns, as ``DriveWarning``, of a drive that keeps its host waiting: once, after a second.
    """
    begin = time.monotonic()
    told, patience = False, drive.settings.boot_timeout
    while True:
        try:
            drive.read(0x1000, timeout=_FIRST_ANSWER)
        except DriveTimeout:
            waited = time.monotonic() - begin
            if waited >= patience:
                return False
            if waited > _WORTH_TELLING and not told:
                told = True
                warnings.warn(
                    f"axis {drive.number} (node {drive.node_id}) does not answer yet; it is waited"
                    f" for, up to drives.boot_timeout = {patience:g} s",
                    DriveWarning,
                    stacklevel=2,
                )
            continue
        _tell_if_slow(drive)
        return True


def _tell_if_slow(drive: DriveObjects) -> None:
    """Warn of a drive that takes long for each answer: its bring-up takes that long many times."""
    quickest = math.inf
    for _ in range(_LOOKS):
        begin = time.monotonic()
        drive.read(0x1000)
        quickest = min(quickest, time.monotonic() - begin)
        if quickest < _SLOW:
            return
    warnings.warn(
        f"axis {drive.number} (node {drive.node_id}) takes {1e3 * quickest:.0f} ms for an answer:"
        f" bring-up, which asks some {_REQUESTS} times, takes about {_REQUESTS * quickest:.0f} s",
        DriveWarning,
        stacklevel=2,
    )


def no_answer(drive: DriveObjects) -> DriveTimeout:
    """Make the error for a drive that does not answer: it asks who else is on the bus."""
    return DriveTimeout(
        f"axis {drive.number}: node {drive.node_id} does not answer for"
        f" {drive.settings.boot_timeout:g} s; {_who_answers(drive)}. Its supply, its node"
        f" number and its bit rate ({drive.settings.bit_rate} bit/s) are to be checked first;"
        " drives.boot_timeout says how long a drive may take",
        axis=drive.number,
    )


def _who_answers(drive: DriveObjects) -> str:
    """Ask all nodes that a bus may have for something that each of them knows."""
    drive.network.scanner.reset()  # whoever was heard before may be gone
    drive.network.scanner.search()
    time.sleep(_SCAN_PATIENCE)
    heard = sorted(set(drive.network.scanner.nodes) - {drive.settings.host_id})
    if drive.node_id in heard:
        return "it does answer, but too late: the bus or one of its ends is overloaded"
    if not heard:
        return "no other node does"
    strangers = [node for node in heard if node not in drive.settings.node_ids]
    unknown = f", of which node_ids does not name {', '.join(map(str, strangers))}"
    return f"nodes {', '.join(map(str, heard))} do" + (unknown if strangers else "")


def identify(drive: DriveObjects) -> Identity:
    """Find out what a drive is, and refuse one that is not what the machine file says.

    Raises:
        DriveError: Not a CiA 402 drive, another vendor or product, or no cyclic synchronous
            position.
    """
    device_type = drive.read(0x1000)
    if device_type & 0xFFFF != PROFILE_402:
        raise drive.error(
            f"is no CiA 402 drive: 0x1000 says profile {device_type & 0xFFFF}, not {PROFILE_402}"
        )
    identity = Identity(
        device_type=device_type,
        vendor_id=drive.read(0x1018, 1),
        product_code=_read_optional(drive, 0x1018, 2),
        revision=_read_optional(drive, 0x1018, 3),
        serial=_read_optional(drive, 0x1018, 4),
        name=_name(drive),
        modes=_read_optional(drive, 0x6502, 0),
    )
    for key in ("vendor_id", "product_code"):
        says, wanted = getattr(identity, key), getattr(drive.quirks, key)
        if wanted not in (0, says):
            raise drive.error(
                f"{key} is 0x{says:08X}, the machine file wants 0x{wanted:08X}:"
                " another drive, or drives.quirks is for another one"
            )
    knows = identity.modes & Mode.CYCLIC_SYNCHRONOUS_POSITION.supported_bit
    if not knows and not drive.quirks.trust_csp:
        raise drive.error(
            f"does not know cyclic synchronous position: 0x6502 is 0x{identity.modes:08X},"
            f" bit 7 is not set; {answer_to(0x6502, 0)}"
        )
    return identity


def _read_optional(drive: DriveObjects, index: int, sub: int) -> int:
    """Read what CiA 301 or CiA 402 leave to the maker; 0 where the drive does not have it."""
    try:
        return drive.read(index, sub)
    except SdoRefusalError:
        return 0


def _name(drive: DriveObjects) -> str:
    try:
        return drive.read_text(0x1008)
    except SdoRefusalError:  # optional in CiA 301
        return ""


def configure(
    drive: DriveObjects,
    ask_units: Callable[[], RateUnits],
    travel: tuple[float, float] | None,
    speed: float | None,
) -> None:
    """Write everything that a drive must know before it gets power.

    Args:
        drive: The drive, without power.
        ask_units: Returns what its speeds and accelerations mean; DriveError where that is not
            known.
        travel: Software limits, 0x607D [mm]; None leaves those of the drive. One that counts
            itself outside, because it has not been homed, gets none until it is: it may refuse
            the very place where it stands.
        speed: Greatest one that the host asks for [mm/s]; 0x607F, with room above it, bounds what
            a setpoint that is far off can do. None leaves that of the drive.
    """
    drive.command(pdo.Nmt.ENTER_PRE_OPERATIONAL)
    refusals = Refusals(drive)
    units: RateUnits | None = None
    with refusals.collected():
        units = ask_units()
    for parameters in (*OTHER_RPDOS, *OTHER_TPDOS):
        with refusals.collected():
            switch_off_pdo(drive, parameters)
    for wanted in PDO_MAPS:
        with refusals.collected():
            if all(drive.has(index) for index, _, _ in wanted.entries):
                map_pdo(drive, wanted)
            else:
                switch_off_pdo(drive, wanted.parameters)
    if _counts_syncs(drive):
        with refusals.collected():
            if drive.has(0x1006):
                drive.write(0x1006, 0, 0)  # with a cycle set, a drive must not change its counter
            drive.write_checked(0x1019, 0, 0)
    if not drive.has(0x60C2):
        with refusals.collected():
            require_period(drive)
    settings = list_settings(drive, units, travel, speed)
    if _stands_outside(drive, settings):
        settings = [(i, sub, _NO_LIMIT.get((i, sub), value)) for i, sub, value in settings]
    for index, sub, value in settings:
        if drive.has(index):
            with refusals.collected():
                _write_setting(drive, index, sub, value)
    _require_homing(drive, refusals)
    for index, sub, value, size in drive.quirks.writes:
        with refusals.collected():
            drive.write_bytes(index, sub, value.to_bytes(size, "little", signed=value < 0))
    refusals.raise_them()


def _write_setting(drive: DriveObjects, index: int, sub: int, value: int) -> None:
    try:
        drive.write_checked(index, sub, value)
    except SdoRefusalError:
        if index == 0x60C2:
            require_period(drive)  # which names the cycle that would do
        raise


def _stands_outside(drive: DriveObjects, settings: list[tuple[int, int, int]]) -> bool:
    """Whether a drive counts itself outside of the software limits that it would be told."""
    limits = [value for index, sub, value in settings if (index, sub) in _NO_LIMIT]
    return bool(limits) and not min(limits) <= drive.read(0x6064) <= max(limits)


def _require_homing(drive: DriveObjects, refusals: Refusals) -> None:
    """Refuse a drive that cannot be homed as the machine file says, before it gets power."""
    if drive.settings.reference is Reference.ABSOLUTE:
        return
    if drive.has(0x6098):
        with refusals.collected():
            drive.write_checked(0x6098, 0, drive.settings.homing.method[drive.number - 1])
    if drive.has(drive.quirks.home_object[0]):
        with refusals.collected():
            drive.read_bytes(*drive.quirks.home_object)


class Refusals:
    """All that one drive refuses, so that whoever mends the machine file need not ask one by one.

    Args:
        drive: Which.
    """

    def __init__(self, drive: DriveObjects) -> None:
        self._drive = drive
        self._found: list[DriveError] = []

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Keep what a drive refuses inside, and go on; a drive that is silent ends it."""
        try:
            yield
        except DriveTimeout:
            raise
        except DriveError as refusal:
            self._found.append(refusal)

    def raise_them(self) -> None:
        """Raise DriveError with every refusal and the key that answers it; nothing if none."""
        if not self._found:
            return
        said = [self._say(refusal) for refusal in self._found]
        if len(said) == 1:
            raise self._drive.error(said[0])
        raise self._drive.error(
            f"{len(said)} objects are refused: {'; '.join(said)}."
            " duoglide drives probe prints the tables that answer all of them"
        )

    def _say(self, refusal: DriveError) -> str:
        words = str(refusal).removeprefix(f"axis {self._drive.number} (node {self._drive.node_id})")
        answer = ""
        if isinstance(refusal, ObjectError):
            answer = self._answer(refusal.index, refusal.sub)
        return words.lstrip(",: ") + (f" [{answer}]" if answer else "")

    def _answer(self, index: int, sub: int) -> str:
        if any((index, sub) == write[:2] for write in self._drive.quirks.writes):
            return "drives.quirks writes names it"
        home = (index, sub) == self._drive.quirks.home_object
        return answer_to(0x607C, 0) if home else answer_to(index, sub)


def _counts_syncs(drive: DriveObjects) -> bool:
    """Whether a drive expects SYNC with a counter, which the host's is without."""
    if not drive.has(0x1019):
        return False
    try:
        return drive.read(0x1019) != 0
    except SdoRefusalError:  # optional in CiA 301
        return False


def list_settings(
    drive: DriveObjects,
    units: RateUnits | None,
    travel: tuple[float, float] | None,
    speed: float | None,
) -> list[tuple[int, int, int]]:
    """Return the objects to write: timing, watchdogs, stops and limits.

    Takes and means what ``configure`` does; without units, none of the objects that need them.
    """
    settings, quirks, scale = drive.settings, drive.quirks, drive.scale
    value, exponent = interpolation_time(settings.cycle, _fixed_exponent(drive))
    timeout = _milliseconds(settings.heartbeat_timeout)
    objects = [
        (0x60C2, 1, value),
        (0x60C2, 2, exponent),
        (0x1006, 0, round(settings.cycle * 1e6)),
        (0x1016, 1, settings.host_id << 16 | timeout),
        (0x1017, 0, _milliseconds(settings.heartbeat_period)),
        (0x1029, 1, 0),
        (0x6007, 0, _ABORT_QUICK_STOP),
        (0x605A, 0, quirks.quick_stop_option),
        (0x605B, 0, _RAMP),
        (0x605C, 0, _RAMP),
        (0x605D, 0, _RAMP_QUICK),
        (0x605E, 0, _RAMP_QUICK),
        (0x6065, 0, scale.magnitude(settings.following_error_window)),
        (0x6066, 0, _milliseconds(settings.following_error_time)),
    ]
    if units is not None:
        ramp = settings.quick_stop_deceleration[drive.number - 1]
        objects.append((0x6085, 0, units.ramp(ramp, "drives.quick_stop_deceleration")))
    if quirks.setpoint_timer:
        objects.append((0x1400, 5, _milliseconds(settings.setpoint_patience)))
    if travel is not None:
        low, high = sorted(map(scale.to_increments, travel))
        objects += [(0x607D, 1, low), (0x607D, 2, high)]
    if units is not None and speed is not None:
        most = units.most_speed  # a bound that cannot be said is set as high as can be
        objects.append((0x607F, 0, units.speed(min(_SPEED_ROOM * speed, most), "limits.velocity")))
    return objects


def list_homing(drive: DriveObjects, units: RateUnits | None) -> list[tuple[int, int, int]]:
    """Return the objects that say how to home; the speeds only of a homing that moves."""
    homing = drive.settings.homing
    method = homing.method[drive.number - 1]
    objects = [(0x6098, 0, method)]
    if method not in METHODS_HERE and units is not None:
        objects += [
            (0x6099, 1, units.speed(homing.search_speed, "drives.homing.search_speed")),
            (0x6099, 2, units.speed(homing.creep_speed, "drives.homing.creep_speed")),
            (0x609A, 0, units.ramp(homing.acceleration, "drives.homing.acceleration")),
        ]
    return objects


def _fixed_exponent(drive: DriveObjects) -> int | None:
    """Return the unit of 0x60C2 where the drive lets nobody choose it; None where it does."""
    if not drive.has(0x60C2):
        return None
    try:
        kept = drive.read(0x60C2, 2)
        drive.write(0x60C2, 2, _MILLI if kept != _MILLI else kept)
    except SdoRefusalError:
        with suppress(SdoRefusalError):  # a drive that cannot say it refuses what is written next
            return drive.read(0x60C2, 2)
    return None


def read_period(drive: DriveObjects) -> float | None:
    """Return over which time a drive interpolates, as 0x60C2 says [s]; None where it does not."""
    try:
        value, exponent = drive.read(0x60C2, 1), drive.read(0x60C2, 2)
    except SdoRefusalError:
        return None
    return value * 10.0**exponent if value else None


def require_period(drive: DriveObjects) -> None:
    """Refuse a drive that interpolates over another time than the cycle, and is not told it."""
    period, cycle = read_period(drive), drive.settings.cycle
    if period is not None and abs(period - cycle) > _PERIOD_AGREES * cycle:
        raise drive.error(
            f"0x60C2 says that it interpolates over {period:g} s, and is not told another:"
            f" drives.cycle = {period:g} would do"
        )


def interpolation_time(cycle: float, fixed: int | None = None) -> tuple[int, int]:
    """Return the cycle as 0x60C2 has it: a value of 1 to 255 and a power of ten.

    Milliseconds come first: some drives know nothing else.

    Args:
        cycle: [s].
        fixed: The only power of ten that a drive takes; None where it takes any.

    Raises:
        ConfigError: The cycle cannot be written that way.
    """
    for exponent in (_MILLI, -2, -4, -5, -6) if fixed is None else (fixed,):
        value = round(cycle / 10.0**exponent)
        if 1 <= value <= _BYTE and abs(value * 10.0**exponent - cycle) < 1e-9:
            return value, exponent
    if fixed is not None:
        raise ConfigError(
            f"cycle = {cycle:g}: the drive counts it in 1e{fixed} s alone (0x60C2:2); use a whole"
            f" number of them, up to {_BYTE}"
        )
    raise ConfigError(
        f"cycle = {cycle:g}: 0x60C2 cannot say that; use 1 to {_BYTE} times a power of ten [s]"
    )


def _milliseconds(seconds: float) -> int:
    """Round up: a watchdog must not be shorter than asked."""
    return min(-int(-seconds * 1e3 // 1), 0xFFFF)
