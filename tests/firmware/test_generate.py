"""The files made from the EDS are not stale, and the EDS and the code say the same."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import cantools
import pytest

from duoglide.drives import pdo
from duoglide.drives.axis.pdo_maps import PDO_MAPS
from duoglide.drives.linear_axis import eds_path, eds_sha256, object_dictionary
from duoglide.drives.simulation.firmware.objects import DEFAULTS

FIRMWARE = Path(__file__).parents[2] / "firmware_interface"


@pytest.fixture(scope="module")
def generate() -> ModuleType:
    spec = importlib.util.spec_from_file_location("generate", FIRMWARE / "generate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["generate"] = module  # where its dataclass looks for its annotations
    spec.loader.exec_module(module)
    return module


def test_the_header_is_not_stale(generate: ModuleType) -> None:
    entries = generate.read_eds(FIRMWARE / "linear_axis.eds")
    assert (FIRMWARE / "reference_axis" / "linear_axis.h").read_text() == generate.make_header(
        entries
    )


def test_the_dbc_is_not_stale(generate: ModuleType) -> None:
    entries = generate.read_eds(FIRMWARE / "linear_axis.eds")
    assert (FIRMWARE / "linear_axis.dbc").read_text() == generate.make_dbc(entries, [1, 2, 3])


def test_the_header_compiles_without_a_warning(tmp_path: Path) -> None:
    source = tmp_path / "use.c"
    source.write_text('#include "linear_axis.h"\nint32_t low = LAX_HOME_OFFSET_DEFAULT;\n')
    command = ["cc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"]
    subprocess.run([*command, "-I", FIRMWARE / "reference_axis", source], check=True)


def test_the_dbc_decodes_the_frames_of_the_cycle() -> None:
    database = cantools.database.load_file(FIRMWARE / "linear_axis.dbc")
    setpoint = database.decode_message(pdo.RPDO1 + 2, pdo.SETPOINT.pack(0xF, -123456))
    assert setpoint == {"Controlword": 0xF, "TargetPosition": -123456}
    feedback = database.decode_message(pdo.TPDO1 + 3, pdo.FEEDBACK.pack(0x1237, 5))
    assert feedback == {"Statusword": 0x1237, "PositionActualValue": 5}
    emergency = database.decode_message(pdo.EMCY + 1, pdo.pack_emergency(0x8611, 0x21))
    assert emergency == {"ErrorCode": 0x8611, "ErrorRegister": 0x21}


def test_the_axis_starts_with_the_defaults_of_the_eds() -> None:
    dictionary = object_dictionary(1)
    for (index, sub), value in DEFAULTS.items():
        entry = dictionary[index]
        variable = entry if hasattr(entry, "data_type") else entry[sub]
        assert variable.default == value, f"0x{index:04X}:{sub}"


def test_the_host_maps_the_pdos_as_the_eds_does_by_default() -> None:
    dictionary = object_dictionary(5)
    for wanted in PDO_MAPS:
        assert dictionary[wanted.parameters][1].default == wanted.cob_id + 5
        assert dictionary[wanted.parameters][2].default == wanted.kind
        entries = [dictionary[wanted.mapping][i + 1].default for i in range(len(wanted.entries))]
        assert entries == [i << 16 | sub << 8 | bits for i, sub, bits in wanted.entries]
        assert dictionary[wanted.mapping][0].default == len(entries)


def check_eds(path: Path) -> tuple[int, str]:
    """Ask eds-utils, which knows nothing of us, what is wrong with a file."""
    code = "from eds_utils.eds_validate import eds_validate; eds_validate()"
    run = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    return run.returncode, run.stderr


def test_an_independent_checker_finds_no_fault_in_the_eds(tmp_path: Path) -> None:
    assert check_eds(eds_path()) == (0, "")
    wrong = tmp_path / "wrong.eds"
    wrong.write_text(eds_path().read_text().replace("DataType=0x0006", "DataType=0x0099", 1))
    code, words = check_eds(wrong)
    assert code == 1
    assert "0x0099 is invalid" in words


def test_every_list_of_the_eds_names_the_objects_that_it_has() -> None:
    text = eds_path().read_text(encoding="ascii")
    listed = re.findall(r"^\d+=0x([0-9A-F]{4})$", text, re.MULTILINE)
    described = re.findall(r"^\[([0-9A-F]{4})\]$", text, re.MULTILINE)
    assert listed == described


def test_every_record_has_as_many_entries_as_it_says() -> None:
    text = eds_path().read_text(encoding="ascii")
    counts = dict(re.findall(r"^\[(\w{4})\]\n(?:.+\n)*?SubNumber=(\d+)$", text, re.MULTILINE))
    assert len(counts) == text.count("ObjectType=0x8") + text.count("ObjectType=0x9")
    for index, count in counts.items():
        assert len(re.findall(rf"^\[{index}sub", text, re.MULTILINE)) == int(count), index


def test_every_default_is_within_its_limits(generate: ModuleType) -> None:
    for entry in generate.read_eds(FIRMWARE / "linear_axis.eds").values():
        limits = [int(limit, 0) for limit in (entry.low, entry.high) if limit]
        if limits:
            assert min(limits) <= int(entry.default, 0) <= max(limits), entry.name


def test_the_device_is_a_402_drive_with_csp() -> None:
    dictionary = object_dictionary(1)
    assert dictionary[0x1000].default & 0xFFFF == 402
    assert dictionary[0x6502].default & 1 << 7
    assert len(eds_sha256()) == 64
