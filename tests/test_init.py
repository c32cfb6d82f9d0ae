from __future__ import annotations

import ast
import importlib
import inspect
import subprocess
import sys

import pytest

import duoglide as dg

HEAVY = {
    "can",
    "canopen",
    "matplotlib",
    "mujoco",
    "numba",
    "ruckig",
    "scipy",
    "sympy",
    "toppra",
    "viser",
}


def loaded_after(code: str) -> set[str]:
    """Run code in an interpreter of its own, and list which heavy libraries it has loaded."""
    listing = f"{code}\nimport sys\nprint(*({HEAVY!r} & set(sys.modules)))"
    run = subprocess.run(
        [sys.executable, "-c", listing], capture_output=True, text=True, check=True, timeout=600
    )
    return set(run.stdout.split())


@pytest.mark.parametrize(
    "code",
    [
        "import duoglide",
        "import duoglide as dg; dg.Machine.default()",
        "import duoglide as dg; dg.inverse(dg.Geometry(), (-41.0, 0.0, 302.0))",
        "import duoglide as dg; dg.forward_all(dg.Geometry(), (-111.24, 244.70, 246.92))",
        "import duoglide as dg; dg.clearance(dg.Geometry(), [(-41.0, 0.0, 302.0)] * 1000)",
    ],
)
def test_no_heavy_library_loads_before_it_is_used(code: str) -> None:
    assert loaded_after(code) == set()


def test_importing_takes_less_than_three_tenths_of_a_second() -> None:
    """Of the processor's time, and the least of a few runs: other processes share the machine."""
    code = (
        "import numpy, time; t = time.process_time(); import duoglide, duoglide.machine;"
        "print(time.process_time() - t)"
    )
    command = [sys.executable, "-c", code]
    runs = [
        float(subprocess.run(command, capture_output=True, check=True, timeout=600).stdout)
        for _ in range(3)
    ]
    assert min(runs) < 0.3


def test_every_name_of_all_is_there_and_is_itself() -> None:
    for name in dg.__all__:
        value = getattr(dg, name)
        home = importlib.import_module(f"duoglide.{dg._HOME_OF[name]}")
        assert getattr(home, name) is value
        assert name in dir(dg)


def test_the_type_checker_sees_the_names_that_all_lists() -> None:
    tree = ast.parse(inspect.getsource(dg))
    (block,) = [
        node
        for node in tree.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ]
    imported = {
        alias.asname: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert imported == {name: f"duoglide.{home}" for name, home in dg._HOME_OF.items()}


def test_every_public_name_is_explained() -> None:
    for name in dg.__all__:
        assert inspect.getdoc(getattr(dg, name)), name


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'invrese'"):
        _ = dg.invrese  # type: ignore[attr-defined]
