"""What mkdocs asks for while it builds: docstrings cite as Sphinx does, pages as people do."""

from typing import Any

from duoglide.machine.drive_contract import CONTRACT, ContractObject, Need

_CONTRACT = "<!-- the contract, object by object -->"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put tables that are made from the code in their places."""
    return markdown.replace(_CONTRACT, contract_table()) if _CONTRACT in markdown else markdown


def on_page_content(html: str, **_: Any) -> str:
    """Write citations, and what leads to a block of code, without their marks in docstrings."""
    return html.replace("[Shen2021]_", "[Shen2021]").replace("::</p>", ":</p>")


def contract_table() -> str:
    """Return what the host asks of a drive and what a gap costs, as a table in Markdown."""
    rows = ["| object | need | without it | what answers |", "|---|---|---|---|"]
    rows += [_row(item) for item in sorted(CONTRACT, key=lambda item: (item.index, item.subs))]
    return "\n".join(rows)


def _row(item: ContractObject) -> str:
    subs = "" if item.subs == (0,) else f":{','.join(map(str, item.subs))}"
    if item.need is Need.REQUIRED:
        without = "refused"
    else:
        without = f"**unsafe:** {item.cost}" if item.unsafe else item.cost
    answer = item.answer or (f"`absent = [0x{item.index:04X}]`" if without != "refused" else "")
    return f"| 0x{item.index:04X}{subs} {item.name} | {item.need.value} | {without} | {answer} |"
