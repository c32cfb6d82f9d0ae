"""The command line: the place where everything is put together."""

from duoglide.cli.main import main

__all__ = ["main"]
