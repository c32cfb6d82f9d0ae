from __future__ import annotations

import importlib
import sys
import tempfile
from pathlib import Path
from typing import Any

import numba
import pytest

from duoglide.kinematics import kernels
from duoglide.kinematics.compiled import _temporary_cache, compiled, fingerprint, kept

CALLER = "def caller(x):\n    return 2.0 * called(x) + SHIFT\n"


def make(called: str, shift: float = 1.0, caller: str = CALLER) -> dict[str, Any]:
    """Two functions as two modules would hold them."""
    space: dict[str, Any] = {"__name__": "somewhere", "SHIFT": shift}
    exec(f"def called(x):\n    return {called}\n" + caller, space)
    return space


def test_a_fingerprint_tells_what_a_function_calls_and_with_which_constants() -> None:
    first = make("x + 1.0")
    variants = [
        make("x + 2.0"),
        make("x - 1.0"),
        make("x + 1.0", shift=3.0),
        make("x + 1.0", caller=CALLER.replace("2.0", "4.0")),
    ]
    known = fingerprint(first["caller"])
    assert fingerprint(make("x + 1.0")["caller"]) == known
    assert len({known, *(fingerprint(other["caller"]) for other in variants)}) == 5
    first["called"] = numba.njit(first["called"])
    assert fingerprint(first["caller"]) == known


def test_a_fingerprint_is_the_same_with_docstrings_and_without() -> None:
    source = (
        "def called(x):\n    'Words.'\n    if x > 3.0:\n        return None\n    return x + {}\n"
    )
    prints = []
    for level, number in ((0, 1.0), (2, 1.0), (2, 2.0)):
        space: dict[str, Any] = {"__name__": "somewhere"}
        exec(compile(source.format(number), "file", "exec", optimize=level), space)
        prints.append(fingerprint(space["called"]))
    assert prints[0] == prints[1] != prints[2]


def test_what_is_cached_expires_when_a_function_in_another_module_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "caller_module.py").write_text(
        "from called_module import called\n\n\ndef caller(x):\n    return called(x)\n"
    )
    for change in (1.0, 2.0):
        (tmp_path / "called_module.py").write_text(f"def called(x):\n    return x + {change}\n")
        for name in ("caller_module", "called_module"):
            monkeypatch.delitem(sys.modules, name, raising=False)
        space = importlib.import_module("caller_module")
        numba.extending.register_jitable(space.called)
        quick = compiled(space.caller)
        assert quick(1.0) == 1.0 + change
        assert sum(quick.stats.cache_misses.values()) == 1  # not what was cached before
    again = compiled(space.caller)
    assert again(1.0) == 3.0
    assert sum(again.stats.cache_hits.values()) == 1


def test_where_numba_may_write_nowhere_the_cache_is_a_private_temporary_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(function: Any, **options: Any) -> Any:
        if not numba.config.CACHE_DIR:
            raise RuntimeError("cannot cache function: no locator available")
        return njit(function, **options)

    njit = numba.njit
    monkeypatch.setattr(numba, "njit", read_only)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert compiled(kernels.legs_pose).stats.cache_path.startswith(str(tmp_path))
    assert numba.config.CACHE_DIR == ""
    (folder,) = tmp_path.iterdir()
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o777)  # whoever can write there could have us run anything
    assert _temporary_cache() == ""


def test_it_is_known_whether_a_function_has_to_be_compiled_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "kept_module.py").write_text("def kept_function(x):\n    return 2.0 * x\n")
    function = importlib.import_module("kept_module").kept_function
    first = compiled(function)
    assert not kept(first)
    assert first(1.0) == 2.0
    assert kept(compiled(function))
