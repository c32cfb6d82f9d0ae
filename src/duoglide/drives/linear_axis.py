"""Where the object dictionary of a linear axis is, and what it says.

``firmware_interface/linear_axis.eds`` is the source of truth. In a wheel it lies beside this
module; in a checkout it is found where the firmware's engineers read it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from duoglide.errors import ConfigError

if TYPE_CHECKING:
    import canopen

_NAME = "linear_axis.eds"


def eds_path() -> Path:
    """Return the path of the EDS file.

    Raises:
        ConfigError: It is neither in the package nor in a checkout around it.
    """
    here = Path(__file__).resolve()
    places = [here.with_name(_NAME), here.parents[3] / "firmware_interface" / _NAME]
    for place in places:
        if place.is_file():
            return place
    raise ConfigError(f"{_NAME} is missing; looked for {' and '.join(map(str, places))}")


def eds_sha256() -> str:
    """Return the SHA-256 of the EDS file in hexadecimal: what a log says the drives were."""
    return hashlib.sha256(eds_path().read_bytes()).hexdigest()


def object_dictionary(node_id: int) -> canopen.ObjectDictionary:
    """Read the object dictionary for the drive with this node number."""
    import canopen

    return canopen.import_od(str(eds_path()), node_id)


def read_variables(node_id: int) -> dict[tuple[int, int], canopen.objectdictionary.ODVariable]:
    """Return every variable of the EDS by index and sub-index."""
    entries = object_dictionary(node_id).values()
    variables = (v for e in entries for v in (e.values() if hasattr(e, "values") else (e,)))
    return {(v.index, v.subindex): v for v in variables}
