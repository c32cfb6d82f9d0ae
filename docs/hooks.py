"""What mkdocs asks for while it builds: docstrings cite as Sphinx does, pages as people do."""

from typing import Any


def on_page_content(html: str, **_: Any) -> str:
    """Write citations without the underscore that makes them one in docstrings."""
    return html.replace("[Shen2021]_", "[Shen2021]")
