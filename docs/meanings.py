"""What mkdocstrings asks for: the docstrings of a machine's classes as they are at run time.

They are completed from the metadata of the fields (``duoglide.machine.meaning``), which somebody
who only reads the source does not see.
"""

import importlib
import inspect
from typing import Any

import griffe


class Meanings(griffe.Extension):
    """Take the docstring of each documented class from the class itself."""

    def on_class_instance(self, *, cls: griffe.Class, **_: Any) -> None:
        """Read the docstring again, from the class that Python has made."""
        if cls.docstring and any(d.callable_path.endswith("documented") for d in cls.decorators):
            module, _, name = cls.path.rpartition(".")
            cls.docstring.value = inspect.getdoc(getattr(importlib.import_module(module), name))
