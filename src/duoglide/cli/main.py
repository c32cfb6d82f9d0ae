"""The command ``duoglide``: its verbs, and how every failure becomes few lines and an exit code.

====== ===========================================================
code   meaning
====== ===========================================================
0      done
1      refused or failed; stderr says what and why
2      used wrongly; stderr says how
130    interrupted: Ctrl-C, SIGTERM, SIGHUP; what moved has stopped
====== ===========================================================

With ``--json`` a failure is said on stdout, as JSON, and nowhere else.
"""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from io import TextIOWrapper
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from duoglide.cli.console import EXTRAS, Failed, Stopped, complain, say_json
from duoglide.cli.next_verb import next_command
from duoglide.cli.verbs import (
    check,
    demo,
    doctor,
    drives,
    figures,
    log,
    machine,
    operate,
    plan,
    replay,
    status,
    stream,
    view,
    workspace,
)
from duoglide.cli.verbs import run as run_verb
from duoglide.control.host.interrupt import ENDINGS, interrupting
from duoglide.errors import DuoglideError, DuoglideWarning, printable

DONE, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130
_USAGE: type[Exception] = typer.BadParameter.__mro__[1]  # click's, or typer's own copy of it

_NO_MEMORY = (
    "this computer gives the process no more memory or threads; a machine that had power has been"
    " stopped and switched off. Give it more (ulimit -v, ulimit -u), or end other processes"
)

# Help is data, here and in each verb: what Python drops with -OO is no place for it.
_HELP = """\
Plan, check, stream, log and replay the motions of a two-rail parallel robot.

Begin with [bold]duoglide demo[/bold]; every command explains itself with --help.
"""


class _Verbs(TyperGroup):
    """The verbs; keeps what an interrupt says, of which typer leaves a number alone."""

    def invoke(self, ctx: Any) -> Any:
        """Run the verb that was asked for."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            facts = interrupt.facts if isinstance(interrupt, Stopped) else {}
            raise Failed(interrupt, facts) from None


app = typer.Typer(
    name="duoglide",
    cls=_Verbs,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for verb in (
    demo,
    plan,
    check,
    stream,
    run_verb,
    replay,
    status,
    operate,
    doctor,
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
    interrupt = interrupting(_Interrupted)
    for number in ENDINGS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup has it for SIGHUP
            signal.signal(number, interrupt)
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


def run(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    Args:
        arguments: Of the command line; default: those of this process.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        command = typer.main.get_command(app)
        with warnings.catch_warnings():
            _show_only_our_warnings()
            code = command.main(args=words, prog_name="duoglide", standalone_mode=False)
            sys.stdout.flush()
    except BrokenPipeError:  # the reader of our output has gone: nobody listens
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except Failed as failure:
        return _tell(words, _failure(failure.cause, failure.facts, words))
    except (MemoryError, RuntimeError) as error:
        if not isinstance(error, MemoryError) and "new thread" not in str(error):
            raise
        return _tell(words, _Failure(type(error).__name__, _NO_MEMORY))
    except (DuoglideError, ImportError, OSError, KeyboardInterrupt, _USAGE, typer.Abort) as error:
        return _tell(words, _failure(error, {}, words))
    return code if isinstance(code, int) else DONE


@dataclass(frozen=True, slots=True)
class _Failure:
    """What is said of a failure, and the exit code that goes with it."""

    kind: str
    message: str
    code: int = FAILED
    facts: Mapping[str, object] = field(default_factory=dict)
    next: str | None = None


def _failure(error: BaseException, facts: Mapping[str, object], words: Sequence[str]) -> _Failure:
    """Put what went wrong into words."""
    kind = type(error).__name__
    if isinstance(error, _USAGE):
        return _Failure("UsageError", _usage(error), MISUSED)
    if isinstance(error, ImportError):
        return _Failure(kind, _without(error))
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return _Failure(kind, f"{where}{error.strerror or error}")
    if isinstance(error, DuoglideError):
        following = next_command(error, facts, words)
        return _Failure(kind, str(error), FAILED, {**vars(error), **facts}, following)
    return _Failure("Interrupted", str(error) or "interrupted", INTERRUPTED, facts)


def _tell(words: list[str], failure: _Failure) -> int:
    """Say it once: to whoever asked for JSON on stdout, to people on stderr."""
    if "--json" not in words:
        complain(failure.message, failure.code)
        if failure.next is not None:
            print(f"next: {printable(failure.next)}", file=sys.stderr)  # whole, to be copied
        return failure.code
    verb = next((word for word in words if not word.startswith("-")), "")
    said = {"error": failure.message, "type": failure.kind, "exit_code": failure.code}
    if failure.next is not None:
        said["next"] = failure.next
    say_json(verb, {**said, **failure.facts}, ok=False)
    return failure.code


def _usage(error: Exception) -> str:
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "duoglide"
    message = getattr(error, "format_message", error.__str__)()
    return f"{message} (see {command} --help)"


def _without(error: ImportError) -> str:
    """Say which extra brings a missing module; any other missing module is a fault of ours."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRAS:
        raise error
    return f'this needs {module}: pip install "duoglide[{EXTRAS[module]}]"'


def _show_only_our_warnings() -> None:
    """Let warnings of ours come as one line, and nobody else's."""

    def show(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        if issubclass(category, DuoglideWarning):
            complain(f"warning: {message}", DONE)

    warnings.showwarning = show
