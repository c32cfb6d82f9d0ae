"""Make reference_axis/linear_axis.h and linear_axis.dbc from linear_axis.eds.

    python firmware_interface/generate.py            write both
    python firmware_interface/generate.py --nodes 4 5 6 --dbc other.dbc

Plain Python, no packages. tests/firmware/test_generate.py says when the two files are stale.
"""

from __future__ import annotations

import argparse
import configparser
import re
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
EDS = HERE / "linear_axis.eds"
HEADER = HERE / "reference_axis" / "linear_axis.h"

_C_TYPES = {
    0x0002: "int8_t",
    0x0003: "int16_t",
    0x0004: "int32_t",
    0x0005: "uint8_t",
    0x0006: "uint16_t",
    0x0007: "uint32_t",
}
_BITS = {0x0002: 8, 0x0003: 16, 0x0004: 32, 0x0005: 8, 0x0006: 16, 0x0007: 32}
_SIGNED = (0x0002, 0x0003, 0x0004)


@dataclass(frozen=True)
class Entry:
    """One sub-index of the object dictionary."""

    index: int
    sub: int
    name: str
    data_type: int
    access: str
    default: str
    low: str
    high: str

    @property
    def bits(self) -> int:
        """Its size."""
        return _BITS[self.data_type]

    @property
    def signed(self) -> bool:
        """Whether it is a signed number."""
        return self.data_type in _SIGNED


def read_eds(path: Path) -> dict[tuple[int, int], Entry]:
    """Read every variable of an EDS file."""
    parser = configparser.RawConfigParser(inline_comment_prefixes=(";",))
    parser.read_string(path.read_text(encoding="ascii"))
    names = {
        s: parser[s]["ParameterName"] for s in parser.sections() if "ParameterName" in parser[s]
    }
    entries = {}
    for section, name in names.items():
        found = re.fullmatch(r"([0-9A-F]{4})(?:sub([0-9A-F]+))?", section)
        keys = parser[section]
        if found is None or "DataType" not in keys:
            continue
        index, sub = int(found[1], 16), int(found[2] or "0", 16)
        whole = name if found[2] is None else f"{names[found[1]]} {name}"
        entries[index, sub] = Entry(
            index=index,
            sub=sub,
            name=whole,
            data_type=int(keys["DataType"], 16),
            access=keys["AccessType"],
            default=keys.get("DefaultValue", "0"),
            low=keys.get("LowLimit", ""),
            high=keys.get("HighLimit", ""),
        )
    return entries


# -- C header ---------------------------------------------------------------------------------


def make_header(entries: dict[tuple[int, int], Entry]) -> str:
    """Return linear_axis.h: indices, defaults, limits and types of every number."""
    lines = [
        "/* Object dictionary of a linear-axis drive.",
        " * Made from linear_axis.eds by generate.py: do not edit. */",
        "#ifndef LINEAR_AXIS_H",
        "#define LINEAR_AXIS_H",
        "",
        "#include <stdint.h>",
        "",
        "/* Key of an object: index and sub-index in one number. */",
        "#define LAX_KEY(index, sub) (((uint32_t)(index) << 8) | (uint32_t)(sub))",
    ]
    for entry in entries.values():
        if entry.data_type not in _C_TYPES:
            continue
        name = _c_name(entry)
        kind = _C_TYPES[entry.data_type]
        lines += ["", f"/* 0x{entry.index:04X}:{entry.sub} {entry.name}, {kind}, {entry.access} */"]
        lines.append(f"#define LAX_{name} LAX_KEY(0x{entry.index:04X}, {entry.sub})")
        default = entry.default
        if "$NODEID" in default:
            base = default.replace("$NODEID", "").strip("+")
            lines.append(f"#define LAX_{name}_DEFAULT(node) ({base}u + (node))")
            continue
        lines.append(f"#define LAX_{name}_DEFAULT {_c_number(default, entry)}")
        for word, limit in (("MIN", entry.low), ("MAX", entry.high)):
            if limit:
                lines.append(f"#define LAX_{name}_{word} {_c_number(limit, entry)}")
    return "\n".join([*lines, "", "#endif", ""])


def _c_name(entry: Entry) -> str:
    return re.sub(r"[^A-Z0-9]+", "_", entry.name.upper()).strip("_")


def _c_number(text: str, entry: Entry) -> str:
    value = int(text, 0)
    if value == -(1 << 31):
        return "INT32_MIN"
    written = text if text.lower().startswith("0x") else str(value)
    return written + ("" if entry.signed else "u")


# -- DBC --------------------------------------------------------------------------------------

_PDOS = (("RPDO1", 0x1400), ("RPDO2", 0x1401), ("TPDO1", 0x1800), ("TPDO2", 0x1801))


def make_dbc(entries: dict[tuple[int, int], Entry], nodes: list[int]) -> str:
    """Return linear_axis.dbc: the frames of the cycle for drives with these node numbers."""
    names = [f"AXIS{node}" for node in nodes]
    lines = ['VERSION "made from linear_axis.eds by generate.py: do not edit"', "", "NS_ :", ""]
    lines += ["BS_:", "", "BU_: HOST " + " ".join(names), ""]
    comments = []
    lines += _message(0x000, "NMT", "HOST", [("Command", 0, 8, False), ("Node", 8, 8, False)])
    lines += _message(0x080, "SYNC", "HOST", [])
    for node, name in zip(nodes, names, strict=True):
        for pdo, parameters in _PDOS:
            base = int(entries[parameters, 1].default.replace("$NODEID+", ""), 0)
            sender = "HOST" if pdo.startswith("R") else name
            signals, offset = [], 0
            for entry in _mapped(entries, parameters + 0x200):
                signals.append((_signal_name(entry), offset, entry.bits, entry.signed))
                comments.append((base + node, _signal_name(entry), entry))
                offset += entry.bits
            lines += _message(base + node, f"{name}_{pdo}", sender, signals)
        emergency = [("ErrorCode", 0, 16, False), ("ErrorRegister", 16, 8, False)]
        lines += _message(0x080 + node, f"{name}_EMCY", name, emergency, size=8)
        lines += _message(0x700 + node, f"{name}_Heartbeat", name, [("NmtState", 0, 8, False)])
    for can_id, signal, entry in comments:
        lines.append(f'CM_ SG_ {can_id} {signal} "0x{entry.index:04X}:{entry.sub} {entry.name}";')
    return "\n".join([*lines, ""])


def _mapped(entries: dict[tuple[int, int], Entry], mapping: int) -> list[Entry]:
    """Return the objects in a PDO as the EDS maps it by default."""
    found = []
    for position in range(int(entries[mapping, 0].default, 0)):
        word = int(entries[mapping, position + 1].default, 0)
        found.append(entries[word >> 16, word >> 8 & 0xFF])
    return found


def _signal_name(entry: Entry) -> str:
    return "".join(word.capitalize() for word in re.findall(r"[A-Za-z0-9]+", entry.name))


def _message(
    can_id: int,
    name: str,
    sender: str,
    signals: list[tuple[str, int, int, bool]],
    size: int | None = None,
) -> list[str]:
    bits = sum(bits for _, _, bits, _ in signals)
    lines = [f"BO_ {can_id} {name}: {bits // 8 if size is None else size} {sender}"]
    for signal, start, length, signed in signals:
        sign = "-" if signed else "+"
        lines.append(f' SG_ {signal} : {start}|{length}@1{sign} (1,0) [0|0] "" Vector__XXX')
    return [*lines, ""]


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nodes", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--dbc", type=Path, default=HERE / "linear_axis.dbc")
    arguments = parser.parse_args()
    entries = read_eds(EDS)
    HEADER.write_text(make_header(entries), encoding="ascii")
    arguments.dbc.write_text(make_dbc(entries, arguments.nodes), encoding="ascii")


if __name__ == "__main__":
    main()
