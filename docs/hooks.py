"""What mkdocs asks for while it builds: docstrings cite as Sphinx does, pages as people do."""

from pathlib import Path
from typing import Any

from duoglide.control.host.commission import probe_dictionary
from duoglide.drives.onboarding.probe_text import tables
from duoglide.machine import Machine
from duoglide.machine.drive_contract import CONTRACT, ContractObject, Need

_CONTRACT = "<!-- the contract, object by object -->"
_PROBED = "<!-- what probing acme_sd1.eds prints -->"
_DICTIONARY = Path(__file__).parent / "howto" / "acme_sd1.eds"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put what is made from the code in its places."""
    for mark, make in ((_CONTRACT, contract_table), (_PROBED, probed_dictionary)):
        if mark in markdown:
            markdown = markdown.replace(mark, make())
    return markdown


def on_page_content(html: str, **_: Any) -> str:
    """Write citations, and what leads to a block of code, without their marks in docstrings."""
    return html.replace("[Shen2021]_", "[Shen2021]").replace("::</p>", ":</p>")


def probed_dictionary() -> str:
    """Return what ``duoglide drives probe --eds`` prints of the example, as a block of TOML."""
    machine = Machine.default()
    found = (probe_dictionary(machine, _DICTIONARY),)
    return f"```toml\n{tables(found, machine.drives, f'dictionary {_DICTIONARY.name}')}```"


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
