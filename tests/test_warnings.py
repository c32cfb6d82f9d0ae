"""Which warnings are errors in a test: those that the project can do something about."""

from __future__ import annotations

import warnings

import pytest

OURS = ["duoglide", "duoglide.machine.rules", "tests.conftest"]
THEIRS = ["click.utils", "duoglidelike.rules", "numpy.lib"]


def warn_from(module: str, kind: type[Warning] = DeprecationWarning) -> None:
    """Warn as the code of a module would."""
    warnings.warn_explicit("is going away", kind, f"{module}.py", 1, module=module)


@pytest.mark.parametrize("module", OURS)
def test_a_warning_about_our_own_code_is_an_error(module: str) -> None:
    with pytest.raises(DeprecationWarning):
        warn_from(module)
    with pytest.raises(DeprecationWarning):  # this file is a test as well
        warnings.warn("is going away", DeprecationWarning, stacklevel=1)


@pytest.mark.parametrize("module", THEIRS)
def test_a_warning_about_what_a_library_does_inside_is_none(module: str) -> None:
    with warnings.catch_warnings(record=True) as caught:  # else it would be in the summary
        warn_from(module)
    assert len(caught) == 1


def test_what_is_left_open_is_an_error_wherever_it_is_found() -> None:
    with pytest.raises(ResourceWarning):
        warn_from("gc", ResourceWarning)
    with pytest.raises(pytest.PytestUnhandledThreadExceptionWarning):
        warn_from("_pytest.threadexception", pytest.PytestUnhandledThreadExceptionWarning)
