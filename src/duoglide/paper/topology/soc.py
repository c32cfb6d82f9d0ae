"""Single-opened chains (SOC), their constraint degrees and the coupling degree, Eqs. 3-7."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from duoglide.paper.topology.mechanism import Joint, Mechanism
from duoglide.paper.topology.network import poc_between
from duoglide.paper.topology.poc import chain_poc, levers


@dataclass(frozen=True, slots=True)
class Soc:
    """A chain of joints that closes one more loop.

    Attributes:
        joints: The joints of the chain.
        xi: Number of independent displacement equations of its loop, Eq. 4.
    """

    joints: tuple[Joint, ...]
    xi: int

    @property
    def freedoms(self) -> int:
        """Sum of its joints' freedoms."""
        return sum(joint.kind.freedoms for joint in self.joints)

    @property
    def actuated(self) -> int:
        """Number of its motors."""
        return sum(joint.actuated for joint in self.joints)

    @property
    def constraint_degree(self) -> int:
        """Delta_j of Eq. 5: how many loops' worth of unknowns it leaves (+) or fixes (-)."""
        return self.freedoms - self.actuated - self.xi


@dataclass(frozen=True, slots=True)
class Decomposition:
    """One way to build a mechanism from single-opened chains, in order."""

    socs: tuple[Soc, ...]

    @property
    def dof(self) -> int:
        """F of Eq. 3."""
        return sum(soc.freedoms - soc.xi for soc in self.socs)

    @property
    def constraint_degrees(self) -> tuple[int, ...]:
        """Delta_1, Delta_2, ..."""
        return tuple(soc.constraint_degree for soc in self.socs)

    @property
    def kappa(self) -> float:
        """Half the sum of |Delta_j|; its least over all decompositions is the coupling degree."""
        return sum(abs(delta) for delta in self.constraint_degrees) / 2


def decompositions(mechanism: Mechanism) -> Iterator[Decomposition]:
    """Yield every way to decompose a mechanism into single-opened chains.

    The first chain is a loop; each further one starts and ends on links of those before it, and
    passes only links that are new (an ear decomposition of the graph of links).
    """
    seen: set[frozenset[int]] = set()
    for link in mechanism.links:
        for loop in _ears(mechanism, frozenset({link}), frozenset()):
            if frozenset(loop) not in seen:
                seen.add(frozenset(loop))
                yield from (Decomposition(s) for s in _extended(mechanism, (loop,)))


def _extended(
    mechanism: Mechanism, chains: tuple[tuple[int, ...], ...]
) -> Iterator[tuple[Soc, ...]]:
    """Yield the completions of a partial decomposition."""
    used = frozenset(index for chain in chains for index in chain)
    if len(used) == len(mechanism.joints):
        yield tuple(_socs(mechanism, chains))
        return
    links = frozenset(link for i in used for link in mechanism.joints[i].links)
    seen: set[frozenset[int]] = set()
    for ear in _ears(mechanism, links, used):
        if frozenset(ear) not in seen:
            seen.add(frozenset(ear))
            yield from _extended(mechanism, (*chains, ear))


def _ears(
    mechanism: Mechanism, links: frozenset[str], used: frozenset[int]
) -> Iterator[tuple[int, ...]]:
    """Yield paths over unused joints from ``links`` to ``links`` through new links only."""

    def walk(at: str, path: tuple[int, ...], passed: frozenset[str]) -> Iterator[tuple[int, ...]]:
        for index, joint in enumerate(mechanism.joints):
            if index in used or index in path or at not in joint.links:
                continue
            onward = joint.links[1] if joint.links[0] == at else joint.links[0]
            if onward in links:
                yield (*path, index)
            elif onward not in passed:
                yield from walk(onward, (*path, index), passed | {onward})

    for start in sorted(links):
        yield from walk(start, (), frozenset())


def _socs(mechanism: Mechanism, chains: tuple[tuple[int, ...], ...]) -> Iterator[Soc]:
    """Yield the chains with the number of equations that each one brings."""
    built: tuple[Joint, ...] = ()
    for chain in chains:
        joints = tuple(mechanism.joints[index] for index in chain)
        yield Soc(joints, _independent_equations(built, joints))
        built += joints


def _independent_equations(built: tuple[Joint, ...], joints: tuple[Joint, ...]) -> int:
    """Return xi of Eq. 4: dimension of what the two sides of the loop can do together."""
    motion = chain_poc(joint.poc for joint in joints)
    first, last = _ends(joints)
    if built and first != last:
        motion = poc_between(built, first, last).joined(motion, next(levers()))
    return motion.dimension


def _ends(joints: tuple[Joint, ...]) -> tuple[str, str]:
    """Return the first and the last link of a path of joints."""
    if len(joints) == 1:
        return joints[0].links
    first = next(link for link in joints[0].links if link not in joints[1].links)
    last = next((link for link in joints[-1].links if link not in joints[-2].links), first)
    return first, last
