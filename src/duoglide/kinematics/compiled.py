"""Compiling with numba, once per machine where a directory for its cache can be written to."""

from __future__ import annotations

from collections.abc import Callable
from types import CodeType, FunctionType
from typing import Any


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function on its first call, or load it from numba's cache.

    Where neither the installed package nor the user's cache directory can be written to, it is
    compiled anew in every process. A division by zero gives infinity or NaN, as in numpy.
    """
    import numba

    options = {"error_model": "numpy", **options}
    try:
        dispatcher = numba.njit(function, cache=True, **options)
    except RuntimeError:  # numba found no directory for its cache
        return numba.njit(function, **options)
    _watch_what_it_calls(dispatcher, function)
    return dispatcher


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
        constants = [value for value in code.co_consts if not isinstance(value, CodeType)]
        seen[name] = code.co_code, constants, code.co_names, sorted(numbers.items())
        waiting += used.values()
    return repr(sorted(seen.items()))
