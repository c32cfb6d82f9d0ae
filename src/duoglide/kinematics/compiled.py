"""Compiling with numba, once per machine where a directory for its cache can be written to."""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable, Mapping
from opcode import hasconst, opmap
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

_PLACES = 256  # of constants that one byte tells apart
_NOTHING = opmap["NOP"]


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function on its first call, or load it from numba's cache.

    Where neither the installed package nor the user's cache directory can be written to, the cache
    is beside other temporary files; and where that cannot be either, it is compiled anew in every
    process. A division by zero gives infinity or NaN, as in numpy.
    """
    import numba

    options = {"error_model": "numpy", **options}
    first = _cached(function, numba.config.CACHE_DIR, options)  # empty: where numba likes it
    dispatcher = first or _cached(function, _temporary_cache(), options)
    if dispatcher is None:
        return numba.njit(function, **options)
    _watch_what_it_calls(dispatcher, function)
    return dispatcher


def _cached(function: Callable[..., Any], folder: str, options: Mapping[str, Any]) -> Any:
    """Have numba keep in ``folder`` what it compiles; None where it can write nowhere."""
    import numba

    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, folder
    try:
        return numba.njit(function, cache=True, **options)
    except RuntimeError:  # it found no directory for its cache
        return None
    finally:
        numba.config.CACHE_DIR = before


def _temporary_cache() -> str:
    """Return a folder of the user alone, as what is in a cache is executed; empty for none."""
    folder = Path(tempfile.gettempdir()) / f"duoglide-kernels-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return ""
    private = found.st_uid == os.getuid() and not found.st_mode & 0o077
    return str(folder) if private and stat.S_ISDIR(found.st_mode) else ""


def kept(dispatcher: Any) -> bool:
    """Whether numba's cache has a function, so that its first call need not wait for the compiler.

    Args:
        dispatcher: What ``compiled`` has returned.
    """
    from numba.core.caching import FunctionCache

    cache = getattr(dispatcher, "_cache", None)
    return isinstance(cache, FunctionCache) and bool(cache._cache_file._load_index())


def inlined(function: Callable[..., Any]) -> Any:
    """Let compiled code call a function that nobody else calls compiled, which is less to make."""
    return compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def share(*formulas: Callable[..., Any], inline: bool = False) -> None:
    """Let compiled code call formulas that stay plain functions for everyone else.

    Args:
        formulas: Plain arithmetic.
        inline: Whether the call itself would take as long as they do.
    """
    from numba.extending import register_jitable

    for formula in formulas:
        register_jitable(forceinline=inline)(formula)


def _watch_what_it_calls(dispatcher: Any, function: Callable[..., Any]) -> None:
    """Let what is cached expire with any function that it calls, in whichever module that is.

    By itself numba looks at the file of the function alone: after a change in another one it would
    go on with the old code.
    """
    from numba.core.caching import FunctionCache

    cache = getattr(dispatcher, "_cache", None)  # there is none where compiling is switched off
    if isinstance(cache, FunctionCache):
        file = cache._cache_file
        file._source_stamp = (file._source_stamp, fingerprint(function))


def fingerprint(function: Callable[..., Any]) -> str:
    """Describe the code of a function, of all that it calls, and the constants that they use."""
    seen: dict[str, tuple[Any, ...]] = {}
    waiting: list[Any] = [function]
    while waiting:
        value = waiting.pop()
        value = getattr(value, "py_func", value)  # what a compiled function was made of
        if not isinstance(value, FunctionType):
            continue
        name, code = f"{value.__module__}.{value.__qualname__}", value.__code__
        if name in seen:
            continue
        used = {n: value.__globals__[n] for n in code.co_names if n in value.__globals__}
        numbers = {n: v for n, v in used.items() if isinstance(v, int | float | str | tuple)}
        seen[name] = *_instructions(code), code.co_names, sorted(numbers.items())
        waiting += used.values()
    return repr(sorted(seen.items()))


def _instructions(code: CodeType) -> tuple[bytes, list[Any]]:
    """Return the instructions of a function, and the constants in the order in which it uses them.

    The places of the constants and what does nothing do not count: ``python -OO`` drops docstrings,
    which changes both, and must not throw away what others have compiled.
    """
    masked, used = bytearray(code.co_code), list(code.co_consts)
    if len(used) <= _PLACES:  # else a place takes more than the one byte
        used = []
        for at in range(0, len(masked), 2):
            if masked[at] in hasconst:
                used.append(code.co_consts[masked[at + 1]])
                masked[at + 1] = 0
    work = b"".join(
        masked[at : at + 2] for at in range(0, len(masked), 2) if masked[at] != _NOTHING
    )
    return work, [value for value in used if not isinstance(value, CodeType)]
