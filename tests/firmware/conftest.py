"""The C reference axis, built twice: as a shared library, and as a program under sanitizers."""

from __future__ import annotations

import ctypes
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from duoglide.drives.simulation.firmware.objects import RefusalError

FIRMWARE = Path(__file__).parents[2] / "firmware_interface"
SOURCES = [
    FIRMWARE / "reference_axis" / f"{name}.c" for name in ["axis", "demand", "objects", "watch"]
]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]

_SIZE = '#include "axis.h"\nunsigned long lax_size(void) { return sizeof(lax_axis_t); }\n'
_DECLARATION = re.compile(r"^(\w+) (lax_\w+)\((.*)\);", re.M)
_ARGUMENT = re.compile(r"(?:const )?(\w+) (\*?)\w+")
_TYPES: dict[str, Any] = {
    "void": None,
    "bool": ctypes.c_bool,
    **{f"uint{bits}_t": getattr(ctypes, f"c_uint{bits}") for bits in (8, 16, 32)},
    **{f"int{bits}_t": getattr(ctypes, f"c_int{bits}") for bits in (32, 64)},
}


def declare(library: ctypes.CDLL, header: str) -> None:
    """Tell ctypes what a header says of each function."""
    for result, name, arguments in _DECLARATION.findall(header):
        function = getattr(library, name)
        function.restype = _TYPES[result]
        function.argtypes = [
            ctypes.c_void_p
            if kind == "lax_axis_t"
            else ctypes.POINTER(_TYPES[kind])
            if star
            else _TYPES[kind]
            for kind, star in _ARGUMENT.findall(arguments)
        ]


def build_c_axis(folder: Path) -> ctypes.CDLL:
    """Compile the axis to a shared library; a compiler is all that is needed."""
    size, library = folder / "size.c", folder / "axis.so"
    size.write_text(_SIZE, encoding="utf-8")
    command = ["cc", "-std=c99", "-O1", "-shared", "-fPIC", "-I", str(FIRMWARE / "reference_axis")]
    command += [*map(str, SOURCES), str(size), "-o", str(library)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    loaded = ctypes.CDLL(str(library))
    declare(loaded, (FIRMWARE / "reference_axis" / "axis.h").read_text(encoding="utf-8"))
    return loaded


class CAxis:
    """The C reference axis as the node of a simulated drive takes it."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._lib = library
        size = library.lax_size()
        self._memory = ctypes.create_string_buffer(b"\xa5" * size, size)  # as memory comes
        self._axis = ctypes.addressof(self._memory)
        self._lib.lax_init(self._axis)

    statusword = property(lambda self: self._lib.lax_statusword(self._axis))
    error_register = property(lambda self: self._lib.lax_error_register(self._axis))
    powered = property(lambda self: self._lib.lax_powered(self._axis))
    brake_released = property(lambda self: self._lib.lax_brake_released(self._axis))
    servo_demand = property(lambda self: self._lib.lax_servo_demand(self._axis))
    servo_velocity = property(lambda self: self._lib.lax_servo_velocity(self._axis))
    period = property(lambda self: self._lib.lax_period(self._axis))
    actual = property(lambda self: self.read(0x6064, 0))

    def read(self, index: int, sub: int) -> int:
        value = ctypes.c_int64()
        self._check(self._lib.lax_read(self._axis, index, sub, value))
        return value.value

    def write(self, index: int, sub: int, value: int) -> None:
        self._check(self._lib.lax_write(self._axis, index, sub, value))

    def _check(self, abort: int) -> None:
        if abort:
            raise RefusalError(abort)

    def sync(self) -> None:
        self._lib.lax_sync(self._axis)

    def setpoint(self, controlword: int, target: int) -> None:
        self._lib.lax_setpoint(self._axis, controlword, target)

    def heartbeat(self) -> None:
        self._lib.lax_heartbeat(self._axis)

    def communication(self, operational: bool) -> None:
        self._lib.lax_communication(self._axis, operational)

    def fault(self, code: int) -> None:
        self._lib.lax_raise_fault(self._axis, code)

    def set_sto(self, active: bool) -> None:
        self._lib.lax_set_sto(self._axis, active)

    def set_inputs(self, word: int) -> None:
        self._lib.lax_set_inputs(self._axis, word)

    def tick(self, dt: int, encoder: int) -> None:
        self._lib.lax_tick(self._axis, dt, encoder)

    def take_emergencies(self) -> list[int]:
        codes = []
        code = ctypes.c_uint16()
        while self._lib.lax_take_emergency(self._axis, code):
            codes.append(code.value)
        return codes


@pytest.fixture(scope="session")
def make_c_axis(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], CAxis]:
    library = build_c_axis(tmp_path_factory.mktemp("c_axis"))
    return lambda: CAxis(library)


@pytest.fixture(scope="session")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The replay program, built with every warning an error and with sanitizers."""
    program = tmp_path_factory.mktemp("sanitized") / "replay"
    command = ["cc", *STRICT, "-Wconversion", "-O1", "-g", "-fsanitize=address,undefined"]
    command += ["-fno-sanitize-recover=all", "-I", str(FIRMWARE / "reference_axis")]
    command += [str(Path(__file__).with_name("replay.c")), *map(str, SOURCES), "-o", str(program)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return program
