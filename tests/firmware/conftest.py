"""The C reference axis, built twice: as a Python module, and as a program under sanitizers."""

from __future__ import annotations

import importlib.util
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from duoglide.drives.simulation.firmware_objects import RefusalError

FIRMWARE = Path(__file__).parents[2] / "firmware_interface"
SOURCES = [
    FIRMWARE / "reference_axis" / f"{name}.c" for name in ["axis", "demand", "objects", "watch"]
]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]

_DECLARATIONS = """
typedef struct { ...; } lax_axis_t;
void lax_init(lax_axis_t *axis);
uint32_t lax_write(lax_axis_t *axis, uint16_t index, uint8_t sub, int64_t value);
uint32_t lax_read(const lax_axis_t *axis, uint16_t index, uint8_t sub, int64_t *value);
void lax_sync(lax_axis_t *axis);
void lax_setpoint(lax_axis_t *axis, uint16_t controlword, int32_t target);
void lax_heartbeat(lax_axis_t *axis);
void lax_communication(lax_axis_t *axis, bool operational);
void lax_raise_fault(lax_axis_t *axis, uint16_t code);
void lax_set_sto(lax_axis_t *axis, bool active);
void lax_set_inputs(lax_axis_t *axis, uint32_t word);
void lax_tick(lax_axis_t *axis, int64_t dt, int64_t encoder);
uint16_t lax_statusword(const lax_axis_t *axis);
uint8_t lax_error_register(const lax_axis_t *axis);
bool lax_powered(const lax_axis_t *axis);
bool lax_brake_released(const lax_axis_t *axis);
int64_t lax_servo_demand(const lax_axis_t *axis);
int64_t lax_servo_velocity(const lax_axis_t *axis);
int64_t lax_period(const lax_axis_t *axis);
bool lax_take_emergency(lax_axis_t *axis, uint16_t *code);
"""


def build_c_axis(folder: Path) -> ModuleType:
    from cffi import FFI

    ffi = FFI()
    ffi.cdef(_DECLARATIONS)
    ffi.set_source(
        "_reference_axis",
        '#include <stdbool.h>\n#include "axis.h"',
        sources=[str(path) for path in SOURCES],
        include_dirs=[str(FIRMWARE / "reference_axis")],
        extra_compile_args=["-std=c99", "-O1"],
    )
    path = ffi.compile(tmpdir=str(folder))
    spec = importlib.util.spec_from_file_location("_reference_axis", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class CAxis:
    """The C reference axis as the node of a simulated drive takes it."""

    def __init__(self, module: ModuleType) -> None:
        self._lib: Any = module.lib  # type: ignore[attr-defined]
        self._ffi: Any = module.ffi  # type: ignore[attr-defined]
        self._axis = self._ffi.new("lax_axis_t *")
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
        value = self._ffi.new("int64_t *")
        self._check(self._lib.lax_read(self._axis, index, sub, value))
        return int(value[0])

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
        code = self._ffi.new("uint16_t *")
        while self._lib.lax_take_emergency(self._axis, code):
            codes.append(int(code[0]))
        return codes


@pytest.fixture(scope="session")
def make_c_axis(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], CAxis]:
    module = build_c_axis(tmp_path_factory.mktemp("cffi"))
    return lambda: CAxis(module)


@pytest.fixture(scope="session")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The replay program, built with every warning an error and with sanitizers."""
    program = tmp_path_factory.mktemp("sanitized") / "replay"
    command = ["cc", *STRICT, "-Wconversion", "-O1", "-g", "-fsanitize=address,undefined"]
    command += ["-fno-sanitize-recover=all", "-I", str(FIRMWARE / "reference_axis")]
    command += [str(Path(__file__).with_name("replay.c")), *map(str, SOURCES), "-o", str(program)]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return program
