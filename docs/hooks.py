"""What mkdocs asks for while it builds: docstrings cite as Sphinx does, pages as people do."""

import inspect
import re
from pathlib import Path
from typing import Any

import duoglide
from duoglide.control.host.commission import probe_dictionary
from duoglide.drives.onboarding.probe_text import tables
from duoglide.machine import Machine
from duoglide.machine.drive_contract import CONTRACT, ContractObject, Need

_CONTRACT = "<!-- the contract, object by object -->"
_PROBED = "<!-- what probing acme_sd1.eds prints -->"
_NAMES = "<!-- every name of the library -->"
_ENTRY = re.compile(r"^::: dg\.(\w+)\n(?: {4}options:\n)?", re.M)
_DICTIONARY = Path(__file__).parent / "howto" / "acme_sd1.eds"


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put what is made from the code in its places."""
    for mark, make in (
        (_CONTRACT, contract_table),
        (_PROBED, probed_dictionary),
        (_NAMES, name_table),
    ):
        if mark in markdown:
            markdown = markdown.replace(mark, make())
    return _ENTRY.sub(_under_its_name, markdown)


def _under_its_name(entry: re.Match[str]) -> str:
    """Describe ``dg.NAME`` where it is written, under the name by which it is called."""
    name = entry[1]
    head = f"      heading: dg.{name}\n      toc_label: dg.{name}\n"
    return f"::: duoglide.{duoglide._HOME_OF[name]}.{name}\n    options:\n{head}"


def name_table() -> str:
    """Return every name of the library with the first line of its docstring, as a table."""
    rows = ["| name | what it is |", "|---|---|"]
    for name in sorted(duoglide.__all__, key=str.lower):
        first = inspect.getdoc(getattr(duoglide, name)).partition("\n")[0].replace("``", "`")
        rows.append(f"| [`dg.{name}`][duoglide.{duoglide._HOME_OF[name]}.{name}] | {first} |")
    return "\n".join(rows)


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
