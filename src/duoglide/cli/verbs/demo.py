"""``duoglide demo``: the whole way once, from a pick and a place to a replayed run."""

from __future__ import annotations

import shlex
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from duoglide.cli.console import Failed, complain, percent, say, say_facts, say_json, working
from duoglide.cli.motion import run_facts, run_with_progress
from duoglide.cli.options import Json, MachineFile, load_machine
from duoglide.cli.outputs import Force, require_log, require_picture
from duoglide.cli.powered import under_power
from duoglide.cli.program import planning
from duoglide.cli.verbs.plan import plan_numbers
from duoglide.errors import BusError, DriveError

if TYPE_CHECKING:
    from duoglide.control.host.run.report import RunReport
    from duoglide.machine import Machine
    from duoglide.motion.audit import Audit
    from duoglide.planning.trajectory import Trajectory
    from duoglide.playback.compare import Comparison

T = TypeVar("T")
_PICK, _PLACE, _LIFT = (-41.0, -152.5, 295.0), (-41.0, 152.5, 295.0), 25.0
_TRIES = 3
_HELP = """\
Plan, stream, log and replay a pick-and-place cycle on three simulated drives.

The standard cycle, 25/305/25 mm there and back. Writes plan.mcap, run.mcap and demo.png, or
plan-2.mcap and so on where these are there already; no hardware, no other process.
"""
_EXAMPLE = """\
Examples:

duoglide demo

duoglide demo --machine cell.toml --out results
"""


@dataclass(frozen=True, slots=True)
class _Files:
    """What the demo writes."""

    plan: Path
    run: Path
    picture: Path

    @classmethod
    def within(cls, folder: Path, number: int = 1) -> _Files:
        """Name the files of the demo, those of a second one with a 2, and so on."""
        end = f"-{number}" if number > 1 else ""
        names = f"plan{end}.mcap", f"run{end}.mcap", f"demo{end}.png"
        return cls(*(folder / name for name in names))

    @property
    def all(self) -> tuple[Path, Path, Path]:
        """The plan, the run and the picture."""
        return self.plan, self.run, self.picture

    @property
    def free(self) -> bool:
        """Whether nothing stands where they shall be written."""
        return not any(file.exists() or file.is_symlink() for file in self.all)


@dataclass(slots=True)
class _Tries:
    """Runs that a busy computer disturbed; on simulated drives nothing speaks against another.

    Attributes:
        disturbed: What each of them ended with.
    """

    disturbed: list[str] = field(default_factory=list)

    def until_undisturbed(self, run: Callable[[], T]) -> T:
        """Try up to three times; raise what the last one ended with."""
        for _ in range(_TRIES - 1):
            try:
                return run()
            except Failed as error:
                if not isinstance(error.cause, DriveError | BusError):
                    raise
                self.disturbed.append(str(error))
                complain(f"{error}; is this computer busy? Once more", 0)
        return run()

    @property
    def facts(self) -> list[tuple[str, str]]:
        return [("disturbed before", text) for text in self.disturbed]


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("demo", help=_HELP, epilog=_EXAMPLE)(demo)


def demo(
    machine: MachineFile = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Where to write. (default: here, beside others)"),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Plan, stream, log and replay a pick-and-place cycle on three simulated drives."""
    described = load_machine(machine)
    if out is None:
        files = next(f for number in count(1) if (f := _Files.within(Path(), number)).free)
    else:
        out.mkdir(parents=True, exist_ok=True)
        files = _Files.within(out)
    require_log(files.plan, force=force)
    require_log(files.run, force=force)
    require_picture(files.picture)
    trajectory = _plan(described)
    audit = trajectory.audit()
    trajectory.save(files.plan)
    tries = _Tries()
    report = tries.until_undisturbed(lambda: _stream(described, trajectory, files.run))
    same = tries.until_undisturbed(lambda: _replay(described, files.run))
    with working("drawing"):
        _draw(trajectory, files)
    if as_json:
        numbers = _numbers(trajectory, audit, report, same)
        names = {"plan": files.plan, "log": files.run, "picture": files.picture}
        say_json("demo", {**numbers, "disturbed": tries.disturbed, "files": names})
        return
    say(f"25/305/25 mm there and back in {trajectory.duration:.4f} s, a pick and a place")
    say_facts([*_plan_facts(audit), *run_facts(report), _replay_fact(same), *tries.facts])
    written = [shlex.quote(str(file)) for file in files.all]
    say(f"wrote {', '.join(written)}")
    say(f"to take them away again: rm {' '.join(written)}")
    say("The drives were simulated; nothing here has moved real ones yet.")


def _plan(machine: Machine) -> Trajectory:
    from duoglide.planning.plan import plan
    from duoglide.planning.programs.pick_and_place import pick_and_place

    there = pick_and_place(_PICK, _PLACE, lift=_LIFT)
    back = pick_and_place(_PLACE, _PICK, lift=_LIFT)
    with planning() as done:
        return plan(machine, there.then(back), progress=done)


def _stream(machine: Machine, trajectory: Trajectory, log: Path) -> RunReport:
    doing = "bringing up three simulated drives"
    with under_power(machine, "virtual", doing, run=(trajectory, True)) as robot:
        return run_with_progress(robot, trajectory, log=log, approach=True, override=1.0)


def _replay(machine: Machine, run: Path) -> Comparison:
    """Stream the recorded run again and compare what was sent."""
    from duoglide.playback.compare import compare
    from duoglide.playback.replay import prepare
    from duoglide.storage import read_log

    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "again.mcap"
        with working("checking the recorded run"):
            again = prepare(run, machine, log=log, approach=True)
        doing = "bringing them up again"
        with under_power(machine, "virtual", doing, run=(again.trajectory, True)) as robot:
            run_with_progress(robot, again.trajectory, log=log, approach=True, override=1.0)
        return compare(read_log(run), read_log(log))


def _draw(trajectory: Trajectory, files: _Files) -> None:
    from duoglide.drawing.picture import save
    from duoglide.playback.run_data import read_run
    from duoglide.storage import read_log
    from duoglide.viewer.run_picture import plot_run

    save(plot_run(read_run(read_log(files.run)), {0: trajectory}), files.picture)


def _plan_facts(audit: Audit) -> list[tuple[str, str]]:
    return [
        ("picks", f"{audit.picks_per_minute:.0f} a minute"),
        ("worst use, velocity", f"{percent(audit.velocity)} of the limit, carriages 1 to 3"),
        ("worst use, acceleration", percent(audit.acceleration)),
        ("worst use, jerk", percent(audit.jerk)),
        ("least clearance", f"{audit.least_clearance:.2f} mm to a singular surface"),
    ]


def _replay_fact(same: Comparison) -> tuple[str, str]:
    if same.same_pace:
        return "replay", f"all {same.common} setpoints the same, increment for increment"
    return "replay", f"{same.common} cycles compared, setpoints differ by up to {same.by_cycle}"


def _numbers(
    trajectory: Trajectory, audit: Audit, report: RunReport, same: Comparison
) -> dict[str, object]:
    numbers = plan_numbers(trajectory, audit)
    told = {key: numbers[key] for key in ("duration", "use", "least_clearance")}
    return {**told, "run": report.to_dict(), "replay": same.to_dict()}
