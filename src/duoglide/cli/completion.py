"""What a shell completes beyond verbs and options: files, buses, makes of drives, keys."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

RECORDINGS = (".mcap",)
FRAMES = (".log", ".asc", ".blf", ".trc")
PROGRAMS = (".toml", ".csv", ".nc", ".ngc", ".gcode", ".gco", ".tap", ".cnc")
TABLES = (".toml",)
DICTIONARIES = (".eds", ".dcf")
_NETWORK = Path("/sys/class/net")
_CAN = "280"  # ARPHRD_CAN
_FORMS = ("virtual", "socketcand:127.0.0.1:29536", "udp:239.74.163.2:43113")


def files(*suffixes: str) -> Callable[[str], list[str]]:
    """Return what completes the name of a file that ends in one of ``suffixes``."""

    def complete(incomplete: str) -> list[str]:
        found = _entries(incomplete, suffixes)
        while len(found) == 1 and found[0].endswith("/"):  # a lone folder would end the word
            inside = _entries(found[0], suffixes)
            if not inside:
                break
            found = inside
        return found

    return complete


def _entries(incomplete: str, suffixes: tuple[str, ...]) -> list[str]:
    folder, slash, start = incomplete.rpartition("/")
    try:
        entries = sorted(Path(folder + slash or ".").expanduser().iterdir())
    except OSError:
        return []
    names = (
        f"{entry.name}/" if entry.is_dir() else entry.name
        for entry in entries
        if entry.name.startswith(start) and (start or not entry.name.startswith("."))
    )
    return [
        f"{folder}{slash}{name}" for name in names if name.endswith("/") or _ends(name, suffixes)
    ]


def _ends(name: str, suffixes: tuple[str, ...]) -> bool:
    return name.lower().endswith(suffixes)


def buses(incomplete: str) -> list[str]:
    """Return the buses that a name may begin: CAN interfaces of this computer, and the forms."""
    return [name for name in (*can_interfaces(_NETWORK), *_FORMS) if name.startswith(incomplete)]


def can_interfaces(network: Path) -> list[str]:
    """Return the names of the buses that a kernel's folder of network interfaces shows."""
    try:
        places = sorted(network.iterdir())
    except OSError:
        return []
    return [f"socketcan:{place.name}" for place in places if _is_can(place)]


def _is_can(place: Path) -> bool:
    try:
        return (place / "type").read_text("ascii").strip() == _CAN
    except OSError:
        return False


def profiles(incomplete: str) -> list[str]:
    """Return the makes of drives whose name begins so."""
    from duoglide.machine.drive_profiles import PROFILES

    return [name for name in PROFILES if name.startswith(incomplete)]


def keys(incomplete: str) -> list[str]:
    """Return the keys of a machine file that begin so."""
    from duoglide.machine.schema import known_keys

    return [key for key in known_keys() if key.startswith(incomplete)]
