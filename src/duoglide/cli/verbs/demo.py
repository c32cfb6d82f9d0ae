"""``duoglide demo``: the whole way once, from a pick and a place to a replayed run."""

from __future__ import annotations

import typer


def add_to(app: typer.Typer) -> None:
    """Add the verb to the command line."""
