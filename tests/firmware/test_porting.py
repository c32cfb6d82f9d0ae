"""The reference axis compiles alone, as C and as C++, and the example of glue drives it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware_interface"
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
COMPILERS = {
    "gcc-c99": ["gcc", "-std=c99"],
    "gcc-c17": ["gcc", "-std=c17"],
    "g++-c++11": ["g++", "-x", "c++", "-std=c++11"],
    "g++-c++20": ["g++", "-x", "c++", "-std=c++20"],
    "clang-c99": ["clang", "-std=c99"],
    "clang++-c++11": ["clang++", "-x", "c++", "-std=c++11"],
}


@pytest.fixture(params=COMPILERS)
def compiler(request: pytest.FixtureRequest) -> list[str]:
    command = COMPILERS[request.param]
    if shutil.which(command[0]) is None:
        pytest.skip(f"there is no {command[0]} on this computer")
    return command


def test_the_folder_of_the_axis_compiles_alone(compiler: list[str], tmp_path: Path) -> None:
    alone = tmp_path / "alone"
    shutil.copytree(FIRMWARE / "reference_axis", alone)
    for source in alone.glob("*.c"):
        subprocess.run([*compiler, *WARNINGS, "-fsyntax-only", source], check=True)


def test_the_glue_of_the_example_drives_the_axis(compiler: list[str], tmp_path: Path) -> None:
    stub, glue = HERE / "canopennode_stub", FIRMWARE / "canopennode"
    folders = [stub, glue, FIRMWARE / "reference_axis"]
    sources = [stub / "drive.c", glue / "glue.c", *(FIRMWARE / "reference_axis").glob("*.c")]
    program = tmp_path / "drive"
    includes = [word for folder in folders for word in ("-I", str(folder))]
    subprocess.run([*compiler, *WARNINGS, *includes, *sources, "-o", program], check=True)
    run = subprocess.run([program], capture_output=True, text=True, check=True, timeout=10)
    assert run.stdout.splitlines() == [
        "lacks 60fe",
        "lacks 0000",
        "mode 0",
        "limits 0 0",
        "wrong mode 15, wrong sub 14",  # ODR_INVALID_VALUE, ODR_SUB_NOT_EXIST
        "enabled 1237 -1000",
        "moving 1237 775",  # setpoint k - 2 is 800; the servo is one period of 25 behind
        "host gone 0218 1020",  # braked past the last setpoint, in fault
        "emergencies 8700 8130",  # SYNC, and then the heartbeat
        "tpdo2 1, locks 0",
    ]
