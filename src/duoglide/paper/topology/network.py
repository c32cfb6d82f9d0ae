"""The POC set of one link relative to another, through a network of joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from duoglide.errors import InputError
from duoglide.paper.topology.mechanism import Joint
from duoglide.paper.topology.poc import Poc, levers

_Edge = tuple[str, str, Poc]


def poc_between(joints: Iterable[Joint], first: str, second: str) -> Poc:
    """Find what ``second`` can do relative to ``first``, Eqs. 1 and 2.

    Joints in series are united, chains in parallel are intersected, until one chain is left.

    Args:
        joints: The joints of the mechanism or of a part of it.
        first: Name of the link that is held.
        second: Name of the link that is watched.

    Raises:
        InputError: The links are not connected, or the network is not series-parallel between them.
    """
    edges = [(*joint.links, joint.poc) for joint in joints]
    arms = levers()
    while True:
        edges = _merge_parallel(edges)
        inner = _next_inner(edges, {first, second})
        if inner is None:
            break
        here = [edge for edge in edges if inner in edge[:2]]
        edges = [edge for edge in edges if inner not in edge[:2]]
        if len(here) == 2:
            ends = [b if a == inner else a for a, b, _ in here]
            edges.append((ends[0], ends[1], here[0][2].joined(here[1][2], next(arms))))
    if len(edges) != 1 or set(edges[0][:2]) != {first, second}:
        raise InputError(f"no series-parallel network of joints between {first!r} and {second!r}")
    return edges[0][2]


def _merge_parallel(edges: list[_Edge]) -> list[_Edge]:
    """Intersect edges between the same links; drop edges from a link to itself."""
    merged: dict[frozenset[str], _Edge] = {}
    for a, b, poc in edges:
        if a == b:
            continue
        key = frozenset((a, b))
        merged[key] = (a, b, merged[key][2] & poc) if key in merged else (a, b, poc)
    return list(merged.values())


def _next_inner(edges: list[_Edge], ends: set[str]) -> str | None:
    """Find a link that can be removed: in series between two edges, or dangling."""
    degrees = Counter(link for edge in edges for link in edge[:2])
    removable = (link for link, degree in degrees.items() if degree <= 2 and link not in ends)
    return next(removable, None)
