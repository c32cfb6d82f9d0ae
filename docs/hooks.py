"""What mkdocs asks for while it builds: docstrings cite as Sphinx does, pages as people do."""

from typing import Any


def on_page_content(html: str, **_: Any) -> str:
    """Write citations, and what leads to a block of code, without their marks in docstrings."""
    return html.replace("[Shen2021]_", "[Shen2021]").replace("::</p>", ":</p>")
