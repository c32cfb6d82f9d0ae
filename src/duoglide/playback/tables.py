"""A log as a CSV or Parquet file."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from duoglide.playback.columns import Columns, columns_of
from duoglide.storage import Log
from duoglide.storage.atomic import appearing


def write_csv(log: Log, file: str | Path) -> int:
    """Write a log as CSV: names with units in the first row, and no value where there is none.

    Args:
        log: A plan or a run.
        file: Where to write.

    Returns:
        How many rows it has.

    Raises:
        LogError: The log cannot be read or the file cannot be written.
    """
    columns = columns_of(log)
    with appearing(file) as temporary, temporary.open("w", encoding="ascii") as stream:
        stream.write(",".join(columns) + "\n")
        rows = 0
        for row in _rows(columns):
            stream.write(",".join(_text(value) for value in row) + "\n")
            rows += 1
    return rows


def write_parquet(log: Log, file: str | Path) -> int:
    """Write a log as Parquet, one column a quantity; needs the extra ``parquet``.

    Returns:
        How many rows it has.

    Raises:
        LogError: The log cannot be read or the file cannot be written.
        ModuleNotFoundError: pyarrow is not installed.
    """
    import pyarrow
    import pyarrow.parquet

    table = pyarrow.table(columns_of(log))
    with appearing(file) as temporary:
        pyarrow.parquet.write_table(table, temporary)
    return int(table.num_rows)


def _rows(columns: Columns) -> Iterable[tuple[float, ...]]:
    """Return the rows of a table, as plain numbers."""
    return zip(*(column.tolist() for column in columns.values()), strict=True)


def _text(value: float) -> str:
    """Return a number as the shortest text that reads back exactly; nothing for NaN."""
    return repr(value) if math.isfinite(value) else ""
