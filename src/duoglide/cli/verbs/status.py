"""``duoglide status``: who is on the bus, and in which state."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from duoglide.cli.console import say, say_facts, say_json, triple, working
from duoglide.cli.options import Bus, Json, MachineFile, load_machine

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.drives.bus.listen import Overheard
    from duoglide.machine import DriveSettings, Machine

_HELP = """\
Identify and configure the three drives of a bus, and say how they are; nothing gets power.

The first thing to try with real drives. Where another host moves them, it only listens to what
they say, and sends nothing.
"""
_EXAMPLE = """\
Examples:

duoglide status --bus socketcan:can0 --machine cell.toml

duoglide status --json
"""


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("status", help=_HELP, epilog=_EXAMPLE)(status)


def status(bus: Bus = "virtual", machine: MachineFile = None, as_json: Json = False) -> None:
    """Identify and configure the drives of a bus, and say how they are; nothing gets power."""
    described = load_machine(machine)
    overheard = _listen(described, bus)
    if overheard is not None:
        _report_overheard(overheard, described.drives, bus, as_json)
        return
    from duoglide.control.host.robot import Robot

    with working("connecting"):
        robot = Robot.connect(described, bus=bus)
    with robot:
        numbers, why = _numbers(robot), robot.why_not_homed
    if as_json:
        say_json("status", numbers)
        return
    say(f"three drives answer on {numbers['bus']}")
    say_facts(
        [
            ("states", ", ".join(numbers["states"])),
            ("position reference", "known" if numbers["homed"] else f"not known: {why}"),
            ("carriages", f"{triple(numbers['carriages'], 3)} mm"),
        ]
    )


def _numbers(robot: Robot) -> dict[str, Any]:
    return {
        "bus": robot.bus,
        "listening": False,
        "states": [state.words for state in robot.states],
        "homed": robot.homed,
        "carriages": robot.carriages.tolist(),
    }


def _listen(machine: Machine, bus: str) -> Overheard | None:
    """Return what is heard of a bus that another host is on; None where one may connect."""
    from duoglide.drives.bus.buses import BusKind, parse_bus
    from duoglide.drives.bus.listen import listen

    if parse_bus(bus).kind is BusKind.VIRTUAL:
        return None
    with working("listening"):
        overheard = listen(bus, machine.drives)
    return overheard if overheard.host else None


def _report_overheard(
    overheard: Overheard, settings: DriveSettings, bus: str, as_json: bool
) -> None:
    drives = [_drive(overheard, settings, number) for number in (1, 2, 3)]
    if as_json:
        host = list(overheard.host)
        drive_columns = {key: [drive[key] for drive in drives] for key in drives[0]}
        heard = {"bus": bus, "listening": True, "host": host, "homed": None}
        say_json("status", {**heard, **drive_columns})
        return
    say(f"another host is on {bus}: only listened, nothing was sent")
    rows = [(f"axis {number}", _words(drive)) for number, drive in enumerate(drives, start=1)]
    say_facts([*rows, ("of the host", ", ".join(overheard.host))])
    if others := set(overheard.heartbeats) - {*settings.node_ids, settings.host_id}:
        say_facts([("other heartbeats", "nodes " + ", ".join(map(str, sorted(others))))])


def _drive(overheard: Overheard, settings: DriveSettings, number: int) -> dict[str, Any]:
    """Return what is known of one drive, by the keys of the JSON; None for what was not heard."""
    from duoglide.drives.scale import Scale

    node = settings.node_ids[number - 1]
    feedback, beat = overheard.feedback.get(node), overheard.heartbeats.get(node)
    emergency, scale = overheard.emergencies.get(node), Scale.of(settings, number)
    return {
        "states": None if feedback is None else _state(feedback.statusword),
        "carriages": None if feedback is None else scale.to_mm(feedback.actual),
        "heartbeats": None if beat is None else beat.name.replace("_", "-").lower(),
        "emergencies": None if emergency is None else emergency.code,
    }


def _state(statusword: int) -> str:
    from duoglide.drives.cia402 import decode
    from duoglide.errors import DriveError

    try:
        return decode(statusword).words
    except DriveError:
        return f"no state: statusword 0x{statusword:04X}"


def _words(drive: dict[str, Any]) -> str:
    from duoglide.drives.cia402 import emergency_words

    said = "no feedback"
    if drive["states"] is not None:
        said = f"{drive['states']}, at {drive['carriages']:.3f} mm by its own count"
    said += f", heartbeat {drive['heartbeats'] or 'not heard'}"
    if (code := drive["emergencies"]) is not None:
        said += f", emergency 0x{code:04X}: {emergency_words(code)}"
    return said
