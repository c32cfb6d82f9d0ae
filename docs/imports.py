"""Draw which folder imports which, in a commit of the past and now: ``docs/images/imports.png``.

    python docs/imports.py 35ed1ff

A row imports the columns that have a dot; rows and columns are modules, in the order of the layers.
Everything is to be on the lower left of the diagonal. Imports under TYPE_CHECKING and in functions
count; red ones are part of a circle.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

ROOT = Path(__file__).parents[1]
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
    "contracts"
]
LAYERS = re.findall(r"\w+", " ".join(reversed(CONTRACTS[0]["layers"])))


@dataclass(frozen=True)
class House:
    """Modules in the order of the layers, and which imports which.

    Attributes:
        folders: Folder of each module.
        imports: Whether the row imports the column, shape (n, n).
        circular: Which of the imports are part of a circle.
    """

    folders: list[str]
    imports: np.ndarray
    circular: np.ndarray

    @classmethod
    def of(cls, sources: dict[str, str]) -> House:
        """Read the imports of modules; ``sources`` has the text of each by its file."""
        names = {
            file: file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
            for file in sources
        }
        files = sorted((f for f in sources if f.count("/") > 1 or is_layer(f)), key=place)
        index = {names[file]: i for i, file in enumerate(files)}
        imports = np.zeros((len(files), len(files)), dtype=bool)
        for i, file in enumerate(files):
            others = [index[to] for to in imported(sources[file], index) if to in index]
            imports[i, others] = True
        np.fill_diagonal(imports, val=False)
        _, group = connected_components(csr_array(imports), connection="strong")
        circular = imports & (group[:, None] == group)
        return cls([file.rpartition("/")[0] for file in files], imports, circular)


def is_layer(file: str) -> bool:
    """Whether a file directly in the package is a layer of its own."""
    return Path(file).stem in LAYERS


def place(file: str) -> tuple[int, str, str]:
    """Return where a module stands: layer, folder, name."""
    layer = file.split("/")[1].removesuffix(".py")
    return LAYERS.index(layer), file.rpartition("/")[0], file


def imported(source: str, modules: Collection[str]) -> set[str]:
    """Return what a source imports: modules, or those that the names come from."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in modules else node.module for name in whole}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found


def sources_of(revision: str) -> dict[str, str]:
    """Return the files of the package in a commit."""
    packed = subprocess.run(
        ["git", "archive", revision, "src"], cwd=ROOT, capture_output=True, check=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        return {
            member.name.removeprefix("src/"): file.read().decode()
            for member in archive.getmembers()
            if member.name.endswith(".py") and (file := archive.extractfile(member))
        }


def sources_now() -> dict[str, str]:
    """Return the files of the package as they are."""
    base = ROOT / "src"
    return {file.relative_to(base).as_posix(): file.read_text() for file in base.rglob("*.py")}


def draw(axes: Axes, house: House, title: str) -> None:
    """Draw one matrix, with a frame around each folder."""
    rows, columns = np.nonzero(house.imports & ~house.circular)
    axes.plot(columns, rows, "s", ms=1.2, color="#5e3c99")
    rows, columns = np.nonzero(house.circular)
    axes.plot(columns, rows, "s", ms=2.2, color="#c8102e")
    layers = [folder.split("/")[1] if "/" in folder else "errors" for folder in house.folders]
    for names, width in ((house.folders, 0.4), (layers, 1.0)):
        starts = [i for i, name in enumerate(names) if i == 0 or names[i - 1] != name]
        for start, end in zip(starts, [*starts[1:], len(names)], strict=True):
            side = end - start
            axes.add_patch(
                mpl.patches.Rectangle(
                    (start - 0.5, start - 0.5), side, side, fill=False, lw=width, ec="#888888"
                )
            )
            if width == 1.0 and side > 4:
                axes.text(-4, start + 0.5 * side - 0.5, names[start], ha="right", va="center")
    n = len(names)
    axes.set(xlim=(-1, n), ylim=(n, -1), xticks=[], yticks=[], aspect="equal")
    folders = np.array(house.folders)
    inside = (house.imports & (folders[:, None] == folders)).sum()
    largest = max(map(house.folders.count, house.folders))
    axes.set_title(
        f"{title}\n{n} modules, {len(set(house.folders))} folders, at most {largest} in one\n"
        f"{house.imports.sum()} imports, {inside} within a folder,"
        f" {house.circular.sum()} in circles"
    )


def main() -> None:
    """Draw before and after."""
    from matplotlib.figure import Figure

    revision = sys.argv[1]
    mpl.rcParams.update({"font.size": 7, "axes.titlesize": 9})
    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    for axes, sources, title in zip(
        figure.subplots(1, 2),
        (sources_of(revision), sources_now()),
        (f"before ({revision})", "now"),
        strict=True,
    ):
        draw(axes, House.of(sources), title)
    figure.savefig(ROOT / "docs" / "images" / "imports.png", dpi=110)


if __name__ == "__main__":
    main()
