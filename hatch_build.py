"""What a package index shows of README.md: links and pictures that work there, or none.

The README's links are relative to the repository, which a page of a package index is not. With the
address at which the files of this version can be had in ``DUOGLIDE_FILES_URL``, as in
``https://example.org/duoglide/raw/v0.1.0``, they become absolute. Without it pictures are left out,
captions too, and links become plain text: nothing on the page is broken.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_PICTURE = re.compile(r"!\[([^]]*)\]\((?!\w+:)([^)]+)\)")
_CAPTION = r"(?:\n\n\*(?:[^*])+\*(?=\n))?"  # the paragraph in italics below a picture
_LINK = re.compile(r"(?<!!)\[([^]]*)\]\((?![\w+]+:|#)([^)]+)\)")


def for_an_index(text: str, files: str) -> str:
    """Return the README as a package index shows it.

    Args:
        text: Of README.md.
        files: Address under which the repository's files can be had; empty where there is none.
    """
    if files:
        base = files.rstrip("/")
        text = _PICTURE.sub(rf"![\1]({base}/\2)", text)
        return _LINK.sub(rf"[\1]({base}/\2)", text)
    text = re.sub(_PICTURE.pattern + _CAPTION + r"\n*", "", text)
    return _LINK.sub(r"\1", text)


class ReadmeHook(MetadataHookInterface):
    """Gives the build its long description."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Fill in ``readme``."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        files = os.environ.get("DUOGLIDE_FILES_URL", "")
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": for_an_index(text, files),
        }
