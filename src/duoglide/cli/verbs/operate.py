"""``duoglide reset``, ``home``, ``jog`` and ``park``: the machine's day, step by step."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from duoglide.cli.console import complain, say, say_facts, say_json, triple, working
from duoglide.cli.motion import run_numbers
from duoglide.cli.options import (
    Bus,
    HomeHere,
    Json,
    MachineFile,
    Override,
    load_machine,
    number,
    override_factor,
    point,
)
from duoglide.cli.powered import under_power

if TYPE_CHECKING:
    from duoglide.control.host.robot import Robot
    from duoglide.control.host.run.report import RunReport

_RENEW = 0.02  # [s] between two orders: after 50 ms without one the platform is let go
_RESET_HELP = """\
Acknowledge the faults of the drives, on purpose; the power stays off.

What has caused a fault is mended first. A drive that has restarted is configured again, and has
lost its reference.
"""
_RESET_EXAMPLE = """\
Examples:

duoglide reset --bus socketcan:can0 --machine cell.toml
"""
_HOME_HELP = """\
Find the position reference of all three drives together; where it is known, nothing happens.

The default, method 37, declares the place where the machine stands to be its home pose: put it
there, look, and say so by --home-here. Simulated drives need nobody to look.
"""
_HOME_EXAMPLE = """\
Examples:

duoglide home --bus socketcan:can0 --machine cell.toml --home-here

duoglide home --bus socketcan:can0 --machine cell.toml --home-here --again
"""
_JOG_HELP = """\
Move the platform a little, by a planned and checked motion, and switch the power off again.

With --velocity it moves at that velocity for --seconds, or as far as it may go that way: every step
is looked at, with its way to rest, before it is taken. Ctrl-C stops along the path.
"""
_JOG_EXAMPLE = """\
Examples:

duoglide jog 0,1,0 --bus socketcan:can0 --machine cell.toml

duoglide jog -1,0,0 --bus socketcan:can0 --machine cell.toml --override 5

duoglide jog --velocity 0,10,0 --seconds 2 --bus socketcan:can0 --machine cell.toml
"""
_PARK_HELP = """\
Go to the home pose, where there is most room and the power may go off, and switch it off.

A machine that has stopped where no run may begin backs out first, at creep speed: on that way
nothing that is too small gets smaller. Ctrl-C stops along the path.
"""
_PARK_EXAMPLE = """\
Examples:

duoglide park --bus socketcan:can0 --machine cell.toml
"""


def add_to(app: typer.Typer) -> None:
    """Add the verbs to the command line."""
    app.command("reset", help=_RESET_HELP, epilog=_RESET_EXAMPLE)(reset)
    app.command("home", help=_HOME_HELP, epilog=_HOME_EXAMPLE)(home)
    app.command(
        "jog",
        help=_JOG_HELP,
        epilog=_JOG_EXAMPLE,
        context_settings={"ignore_unknown_options": True},  # -1,0,0 is a way to go
    )(jog)
    app.command("park", help=_PARK_HELP, epilog=_PARK_EXAMPLE)(park)


def reset(bus: Bus = "virtual", machine: MachineFile = None, as_json: Json = False) -> None:
    """Acknowledge the faults of the drives, on purpose; the power stays off."""
    from duoglide.control.host.robot import Robot

    described = load_machine(machine)
    with working("connecting"):
        robot = Robot.connect(described, bus=bus)
    with robot:
        robot.reset_fault()
        numbers = {"bus": robot.bus, "states": [state.words for state in robot.states]}
        numbers |= _place(robot)
    _tell("reset", numbers, "no fault is left", as_json)


def home(
    bus: Bus = "virtual",
    machine: MachineFile = None,
    home_here: HomeHere = False,
    again: Annotated[
        bool, typer.Option("--again", help="Although the reference is known; with --home-here.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Find the position reference of all three drives together."""
    if again and not home_here:
        raise typer.BadParameter(
            "somebody has to see that the machine stands in its home pose: add --home-here",
            param_hint="--again",
        )
    with under_power(load_machine(machine), bus, home_here=home_here) as robot:
        robot.home(again=again, confirm=home_here)
        numbers = {"bus": robot.bus, **_place(robot)}
    _tell("home", numbers, "the position reference is known", as_json)


def jog(
    by: Annotated[str | None, typer.Argument(metavar="X,Y,Z", help="How far [mm].")] = None,
    *,
    velocity: Annotated[
        str | None,
        typer.Option("--velocity", metavar="X,Y,Z", help=r"Instead: how fast \[mm/s]."),
    ] = None,
    seconds: Annotated[
        str | None,
        typer.Option("--seconds", metavar="S", help=r"With --velocity: for how long \[s]."),
    ] = None,
    bus: Bus = "virtual",
    machine: MachineFile = None,
    override: Override = "10",
    as_json: Json = False,
) -> None:
    """Move the platform a little, by a planned and checked motion."""
    if (by is None) == (velocity is None) or (velocity is None) != (seconds is None):
        raise typer.BadParameter("give X,Y,Z, or --velocity X,Y,Z with --seconds S")
    factor = override_factor(override)
    if by is not None:
        displacement = point(by, "X,Y,Z")
        _move("jog", bus, machine, lambda robot: robot.jog(displacement, factor), as_json)
        return
    speed = point(velocity or "", "--velocity")
    period = number(seconds or "", "--seconds", "s")
    _move("jog", bus, machine, lambda robot: _keep_on(robot, speed, period), as_json)


def _keep_on(robot: Robot, velocity: tuple[float, float, float], seconds: float) -> RunReport:
    """Move at a velocity for so long, or until something is in the way."""
    from duoglide.control.host.run.handle import stop_on_interrupt

    handle = robot.start_jog(velocity)
    end = time.monotonic() + seconds
    with stop_on_interrupt(handle.run):
        while time.monotonic() < end and not handle.run.done and not handle.blocked:
            handle.aim(velocity)
            time.sleep(_RENEW)
    if handle.blocked:
        complain(f"stopped early: {handle.blocked} is in the way", 0)
    return handle.stop()


def park(
    bus: Bus = "virtual",
    machine: MachineFile = None,
    as_json: Json = False,
) -> None:
    """Go to the home pose, where there is most room and the power may go off."""

    def back_out_and_park(robot: Robot) -> RunReport:
        robot.recover()
        return robot.park()

    _move("park", bus, machine, back_out_and_park, as_json)


def _move(
    verb: str, bus: str, machine: MachineFile, move: Callable[[Robot], RunReport], as_json: bool
) -> None:
    """Bring the machine under power, move it, and say where it is then."""
    with under_power(load_machine(machine), bus, doing="connecting") as robot:
        with working("moving"):
            report = move(robot)
        numbers = {**run_numbers(report, None), "bus": robot.bus, **_place(robot)}
    _tell(verb, numbers, "moved", as_json)


def _place(robot: Robot) -> dict[str, Any]:
    """Return where the machine is, by the keys of the JSON."""
    return {
        "homed": robot.homed,
        "carriages": robot.carriages.tolist(),
        "position": robot.position.tolist() if robot.homed else None,
    }


def _tell(verb: str, numbers: dict[str, Any], done: str, as_json: bool) -> None:
    if as_json:
        say_json(verb, numbers)
        return
    say(done)
    rows = [("carriages", f"{triple(numbers['carriages'], 3)} mm")]
    if numbers["homed"]:
        rows.append(("platform", f"{triple(numbers['position'], 3)} mm"))
    else:
        rows.append(("position reference", "not known: duoglide home finds it"))
    say_facts(rows)
