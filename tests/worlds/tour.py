"""Once through the product, in whatever world this process lives: ``python tour.py FOLDER``.

Without assert statements, because ``python -OO`` drops them. What goes wrong is an exit code and a
line on stderr.
"""

from __future__ import annotations

import contextlib
import locale
import os
import sys
import tomllib
from pathlib import Path

PROGRAM = """\
# fünf Millimeter höher, 10 µm genau
start = [-41, -30, 300]
speed = 400
[[moves]]
type = "line"
to = [-41, 30, 300]
"""
# Names are bytes to the system; in a world of ASCII Python spells them another way.
PART, CELL = (os.fsdecode(name.encode()) for name in ("Fräsen.toml", "Maschine-ä.toml"))
STEPS = [
    f"machine {CELL}",
    f"plan {PART} --machine {CELL} --out plan.mcap --picture plan.png",
    f"stream plan.mcap --machine {CELL} --approach --log run.mcap",
    "log run.mcap --csv run.csv",
]


def require(true: bool, words: str) -> None:
    """End the process unless something holds."""
    if not true:
        sys.exit(f"tour: {words}")


def main(folder: str) -> None:
    """Write a machine, plan a program for it, stream the plan to drives, and export the log."""
    from duoglide.cli.main import run
    from duoglide.machine import DriveSettings, Machine

    with contextlib.suppress(locale.Error):  # as a program with windows does
        locale.setlocale(locale.LC_ALL, "")
    point = os.environ.get("TOUR_DECIMAL_POINT", ".")
    require(locale.localeconv()["decimal_point"] == point, "this world is not what it should be")
    os.chdir(folder)
    Path(PART).write_bytes(PROGRAM.encode())
    patient = Machine(
        drives=DriveSettings(
            setpoint_timeout=0.25,  # this computer may be busy
            heartbeat_timeout=1.0,
            missing_frames=60,
            late_cycles=120,
            sdo_timeout=1.0,
            sdo_retries=6,
        )
    )
    patient.save(CELL)
    for step in STEPS:
        code = run(step.split())
        require(code == 0, f"duoglide {step!a} has ended with {code}")
    text = Path(CELL).read_bytes().decode()
    require(Machine.from_dict(tomllib.loads(text)) == patient, "the machine file says another one")
    require(text.count("# ") > 50, "the machine file explains nothing")
    table = Path("run.csv").read_text(encoding="utf-8").splitlines()
    require(len(table) > 100, "the run has no cycles")
    require(all("," in line and ";" not in line for line in table), "the table has odd commas")


if __name__ == "__main__":
    main(sys.argv[1])
