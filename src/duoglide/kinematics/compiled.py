"""Compiling with numba, once per machine where a directory for its cache can be written to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function on its first call, or load it from numba's cache.

    Where neither the installed package nor the user's cache directory can be written to, it is
    compiled anew in every process. A division by zero gives infinity or NaN, as in numpy.
    """
    import numba

    options = {"error_model": "numpy", **options}
    try:
        return numba.njit(function, cache=True, **options)
    except RuntimeError:  # numba found no directory for its cache
        return numba.njit(function, **options)


def inlined(function: Callable[..., Any]) -> Any:
    """Let compiled code call a function that nobody else calls compiled, which is less to make."""
    return compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)
