"""What is remembered of the place of the carriages, and what takes it away; no process, no bus."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import duoglide as dg
from duoglide.control.channel.events import Happening
from duoglide.control.host.reference import PositionReference, Sighting
from duoglide.control.host.state_file import DriveMemory, read_memory, state_path
from duoglide.kinematics.home import home_carriages

MACHINE = dg.Machine.default()
BUS, MARK = "socketcan:can0", 50
PLACES = [round(1000.0 * place) for place in home_carriages(MACHINE)]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path


def sightings(places: list[int] = PLACES, **changed: int) -> list[Sighting]:
    """Return what three drives show that cannot say whether they are homed."""
    drives = [DriveMemory(0x9A, 7, 100 + i, MARK, place) for i, place in enumerate(places)]
    return [Sighting(None, False, replace(drive, **changed)) for drive in drives]


def connect(
    seen: list[Sighting] | None = None, machine: dg.Machine = MACHINE, bus: str = BUS
) -> PositionReference:
    reference = PositionReference(machine, bus, kept=True)
    reference.judge(seen or sightings(), [MARK] * 3, heard=False)
    return reference


def home() -> PositionReference:
    """Home a machine, and switch it off where it stands."""
    reference = connect()
    reference.find(PLACES)
    reference.note_power(False, PLACES)
    return reference


def test_a_new_machine_is_not_homed_and_a_homed_one_is_again_at_the_next_connection() -> None:
    assert "nothing is known" in connect().why
    assert home().known
    assert connect().known


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        (sightings([PLACES[0] + 1500, *PLACES[1:]]), "axis 1 says -200.425 mm, and was left at"),
        (sightings(mark=0), "has restarted, or another host has configured it"),
        (sightings(mark=100), "has restarted, or another host has configured it"),
        (sightings(vendor=1), "is another drive than the one that was homed"),
        (sightings(serial=5), "is another drive than the one that was homed"),
        (sightings([400_000, *PLACES[1:]]), "axis 1"),
    ],
)
def test_what_a_drive_shows_at_the_next_connection_ends_the_reference(
    seen: list[Sighting], words: str
) -> None:
    home()
    reference = connect(seen)
    assert not reference.known
    assert words in reference.why
    assert not connect(seen).known  # nor is it known at the one after


def test_carriages_that_have_settled_a_little_are_still_where_they_were_left() -> None:
    home()
    assert connect(sightings([place - 400 for place in PLACES])).known


def test_a_drive_that_says_by_itself_is_believed_either_way() -> None:
    home()
    says_no = [replace(one, homed=False) for one in sightings()]
    assert "says that it has no reference" in connect(says_no).why
    assert connect([replace(one, homed=True) for one in sightings(mark=0)]).known


def test_absolute_encoders_need_no_homing() -> None:
    drives = replace(MACHINE.drives, reference="absolute")
    assert connect(sightings(mark=0), replace(MACHINE, drives=drives)).known


def test_another_bus_or_another_scale_has_another_memory() -> None:
    home()
    assert not connect(bus="socketcan:can1").known
    finer = replace(MACHINE.drives, increments_per_mm=(500.0,) * 3)
    assert not connect(machine=replace(MACHINE, drives=finer)).known


def put(key: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda table: table.update({key: value})


@pytest.mark.parametrize(
    "spoil",
    [
        put("version", 2),
        put("homed", "yes"),
        put("standing", 1),
        put("drives", []),
        lambda table: table["drives"][0].update(position=2**40),
        lambda table: table["drives"][1].update(mark=True),
        lambda table: table["drives"][2].pop("serial"),
    ],
)
def test_a_memory_that_was_tampered_with_is_not_believed(
    spoil: Callable[[dict[str, Any]], None],
) -> None:
    home()
    path = state_path(MACHINE.drives, BUS)
    table = json.loads(path.read_text("ascii"))
    spoil(table)
    path.write_text(json.dumps(table), "ascii")
    with pytest.raises(dg.InputError, match=path.name):
        read_memory(path)
    assert "what was kept of it cannot be used" in connect().why


@pytest.mark.parametrize("content", [b"", b"\xff\x00", b"[" * 20_000, b"[" * 9_000, b"null"])
def test_what_is_no_memory_is_one_clear_error(content: bytes) -> None:
    home()
    state_path(MACHINE.drives, BUS).write_bytes(content)
    assert "cannot be used" in connect().why


def cycle(number: int, *actual: int, missing: int = 0) -> Any:
    return SimpleNamespace(cycle=number, actual=actual, missing=missing)


def test_a_position_that_jumps_ends_the_reference_and_a_fast_move_does_not() -> None:
    reference = home()
    reach = int(1000.0 * MACHINE.stop_limits.velocity[0] * MACHINE.drives.cycle)
    reference.add_cycle(cycle(1, *PLACES))
    reference.add_cycle(cycle(2, PLACES[0] + reach, *PLACES[1:]))
    assert reference.known
    reference.add_cycle(cycle(3, PLACES[0] + 3 * reach + 2000, *PLACES[1:]))
    assert "the position of axis 1 has jumped by" in reference.why


def test_a_gap_in_the_feedback_is_no_jump() -> None:
    reference = home()
    reach = int(1000.0 * MACHINE.stop_limits.velocity[0] * MACHINE.drives.cycle)
    reference.add_cycle(cycle(1, *PLACES))
    reference.add_cycle(cycle(2, 0, 0, 0, missing=7))
    reference.add_cycle(cycle(5, *(place + 4 * reach for place in PLACES)))
    assert reference.known


@pytest.mark.parametrize(("code", "known"), [(0x7305, False), (0x7320, False), (0x2310, True)])
def test_only_the_fault_of_an_encoder_ends_the_reference(code: int, known: bool) -> None:
    reference = home()
    event = SimpleNamespace(kind=Happening.EMERGENCY, axis=2, code=code)
    reference.add_event(event)  # type: ignore[arg-type]
    assert reference.known is known
    assert connect().known is known
