"""The command ``duoglide``: its verbs, and how every failure becomes one line and an exit code.

====== ===========================================================
code   meaning
====== ===========================================================
0      done
1      refused or failed; one line on stderr says what and why
2      used wrongly; one line on stderr says how
====== ===========================================================
"""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Sequence
from io import TextIOWrapper
from typing import TYPE_CHECKING, Annotated

import typer

from duoglide.cli.console import EXTRAS, complain
from duoglide.cli.verbs import (
    check,
    demo,
    drives,
    figures,
    log,
    machine,
    plan,
    replay,
    status,
    stream,
    view,
    workspace,
)
from duoglide.errors import DuoglideError

if TYPE_CHECKING:
    from types import FrameType

DONE, FAILED, MISUSED = 0, 1, 2
_USAGE: type[Exception] = typer.BadParameter.__mro__[1]  # click's, or typer's own copy of it

# Help is data, here and in each verb: what Python drops with -OO is no place for it.
_HELP = """\
Plan, check, stream, log and replay the motions of a two-rail parallel robot.

Begin with [bold]duoglide demo[/bold]; every command explains itself with --help.
"""

app = typer.Typer(
    name="duoglide",
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for verb in (
    demo,
    plan,
    check,
    stream,
    replay,
    status,
    drives,
    log,
    workspace,
    figures,
    view,
    machine,
):
    verb.add_to(app)


@app.callback(invoke_without_command=True, help=_HELP)
def start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Plan, check, stream, log and replay the motions of a two-rail parallel robot."""
    if version:
        from duoglide import __version__

        typer.echo(f"duoglide {__version__}")
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())
        raise typer.Exit(MISUSED)


class _Interrupted(KeyboardInterrupt):
    """Ctrl-C, but as a class of its own.

    A KeyboardInterrupt that happens within ``exec`` (imports are full of it) makes Python end by a
    signal in the end, although it was caught.
    """


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and leave the process with its exit code.

    Whoever ends it from outside (a supervisor's SIGTERM, a terminal that is gone) ends it as Ctrl-C
    does: a machine in motion stops along its path and logs are closed.
    """
    _require_streams()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup has it for SIGHUP
            signal.signal(number, _interrupt)
    sys.exit(run(arguments))


def _require_streams() -> None:
    """Put nowhere in the place of closed streams, and let them bear any text.

    Else the next file or socket would be opened as one of them, and be written to; file names may
    hold what the terminal cannot show.
    """
    while (nowhere := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(nowhere)
    if sys.stdout is None:
        sys.stdout = open(1, "w")  # noqa: SIM115  # for as long as the process lives
    if sys.stderr is None:
        sys.stderr = open(2, "w")  # noqa: SIM115
    for text in (sys.stdout, sys.stderr):
        if isinstance(text, TextIOWrapper):
            text.reconfigure(errors="backslashreplace")


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise _Interrupted


def run(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Args:
        arguments: Of the command line; default: those of this process.
    """
    words = list(arguments) if arguments is not None else None
    try:
        command = typer.main.get_command(app)
        with warnings.catch_warnings():
            _show_only_our_warnings()
            code = command.main(args=words, prog_name="duoglide", standalone_mode=False)
            sys.stdout.flush()
    except _USAGE as error:
        return _misused(error)
    except (DuoglideError, ImportError, OSError, KeyboardInterrupt, typer.Abort) as error:
        return _explain(error)
    return _code(code)


def _explain(error: BaseException) -> int:
    """Say in one line what went wrong, and return the exit code for it."""
    if isinstance(error, BrokenPipeError):  # the reader of our output has gone: nobody listens
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    if isinstance(error, ImportError):
        return _without(error)
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return complain(f"{where}{error.strerror or error}", FAILED)
    return complain(str(error) if isinstance(error, DuoglideError) else "interrupted", FAILED)


def _code(code: object) -> int:
    """Turn what a command has returned into an exit code; click says 130 for Ctrl-C."""
    if not isinstance(code, int) or code == DONE:
        return DONE
    return code if code in (FAILED, MISUSED) else complain("interrupted", FAILED)


def _misused(error: Exception) -> int:
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "duoglide"
    message = getattr(error, "format_message", error.__str__)()
    return complain(f"{message} (see {command} --help)", MISUSED)


def _without(error: ImportError) -> int:
    """Say which extra brings a missing module; any other missing module is a fault of ours."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRAS:
        raise error
    extra = EXTRAS[module]
    return complain(f'this needs {module}: pip install "duoglide[{extra}]"', FAILED)


def _show_only_our_warnings() -> None:
    """Let warnings of ours come as one line, and nobody else's."""
    from duoglide.storage.reader import LogWarning

    def show(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        if issubclass(category, LogWarning):
            complain(f"warning: {message}", DONE)

    warnings.showwarning = show
