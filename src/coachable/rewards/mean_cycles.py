"""The greatest mean pay of walks in a graph of what a run may remember, by Howard's policy iteration."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

_EPSILON = 1e-9


class Run(NamedTuple):
    """Locations by name, each with how many samples the run is there."""

    stays: tuple[tuple[str, int], ...]

    def __str__(self) -> str:
        return ", ".join(f"{name} × {samples}" for name, samples in self.stays)


@dataclass(frozen=True)
class Exploit:
    """The most that a kind of run earns, and a periodic run that earns it."""

    kind: str
    """Such as `never enters O2`."""
    mean: float
    """The greatest mean pay a sample."""
    approach: Run
    """The samples before the period begins."""
    period: Run
    """The samples that come again and again."""
    share: float = 1.0
    """The share of the samples that go to this period; the rest go to that of `beside`."""
    beside: Exploit | None = None
    """Where two periods by turns earn more than one: the other one."""


@dataclass(frozen=True, eq=False)
class Graph:
    """Memories, and the samples that lead from one to another; edges are sorted by their sources."""

    names: tuple[str, ...]
    rows: Float[np.ndarray, "nodes numbers"]
    num_first: int
    """The first so many nodes are where runs begin."""
    source: Int[np.ndarray, " edges"]
    target: Int[np.ndarray, " edges"]
    paid: Float[np.ndarray, " edges"]
    goes_on: Bool[np.ndarray, " edges"]
    """Whether the run does not go round with it."""

    def best(
        self,
        kind: str,
        places: Bool[np.ndarray, " locations"],
        edges: Bool[np.ndarray, " edges"] | None = None,
    ) -> Exploit | None:
        """The most that runs earn at these locations and along these edges; `None` without such a run."""
        size, location = len(self.rows), self.rows[:, 0].astype(int)
        allowed = places[location[self.source]] & places[location[self.target]]
        allowed = allowed if edges is None else allowed & edges
        starts = np.flatnonzero(places[location[: self.num_first]])
        pairs = [(self.source[allowed], self.target[allowed]), (np.full(len(starts), size), starts)]
        source, target = map(np.concatenate, zip(*pairs, strict=True))
        matrix = coo_array((np.ones(len(source), bool), (source, target)), (size + 1, size + 1)).tocsr()
        order, before = breadth_first_order(matrix, size)
        alive = np.zeros(size + 1, bool)
        alive[order] = True
        while True:
            kept = np.flatnonzero(allowed & alive[self.source] & alive[self.target])
            onward = np.zeros(size + 1, bool)
            onward[self.source[kept]] = True
            if not (alive[:size] & ~onward[:size]).any():
                break
            alive[:size] &= onward[:size]
        if not len(kept):
            return None
        cycle = kept[maximum_mean_cycle(self.source[kept], self.target[kept], self.paid[kept])]
        node, approach = int(self.source[cycle[0]]), []
        while node != size:
            approach.append(int(location[node]))
            node = int(before[node])
        mean = float(self.paid[cycle].mean())
        return Exploit(kind, mean, self._run(approach[::-1]), self._period(cycle))

    def best_at_rate(self, kind: str, rate: float, sign: int) -> Exploit | None:
        """The most that runs earn that complete at most (`sign` 1) or at least (−1) so many rounds a sample.

        That is min over λ ≥ 0 of the maximum mean cycle of pay − λ · sign · (rounds − rate), for the runs'
        shares of samples are a linear program (Altman, *Constrained Markov decision processes*, 1999): two
        cycles, one on either side of the rate, at the λ at which both are best.
        """
        parts = connected_components(self._matrix(), connection="strong")[1]
        within = np.flatnonzero(parts[self.source] == parts[self.target])
        found = [
            self._in_part(kind, within[parts[self.source[within]] == part], rate, sign)
            for part in np.unique(parts[self.source[within]])
        ]
        return max(filter(None, found), key=lambda exploit: exploit.mean, default=None)

    def _in_part(self, kind: str, edges: Int[np.ndarray, " edges"], rate: float, sign: int) -> Exploit | None:
        """The same among runs in one strongly connected part, in which any two cycles may be mixed."""
        source, target, paid = self.source[edges], self.target[edges], self.paid[edges]
        excess = sign * (~self.goes_on[edges] - rate)

        def best(price: float, pay: float = 1.0) -> tuple[Int[np.ndarray, " cycle"], float, float]:
            cycle = maximum_mean_cycle(source, target, pay * paid - price * excess)
            return edges[cycle], float(paid[cycle].mean()), float(excess[cycle].mean())

        (one, earned, beyond), (other, less, within) = best(0.0), best(1.0, pay=0.0)
        if beyond <= _EPSILON:
            return Exploit(kind, earned, self._run([]), self._period(one))
        if within > _EPSILON:
            return None
        while True:
            price = (earned - less) / (beyond - within)
            between, pay, over = best(price)
            if pay - price * over <= earned - price * beyond + _EPSILON:
                break
            if over > 0:
                one, earned, beyond = between, pay, over
            else:
                other, less, within = between, pay, over
        share = beyond / (beyond - within)
        beside = Exploit(kind, earned, self._run([]), self._period(one), 1 - share)
        mean = share * less + (1 - share) * earned
        return Exploit(kind, mean, self._run([]), self._period(other), share, beside)

    def _matrix(self) -> csr_array:
        size = len(self.rows)
        return coo_array((np.ones(len(self.source), bool), (self.source, self.target)), (size, size)).tocsr()

    def _period(self, cycle: Int[np.ndarray, " cycle"]) -> Run:
        return self._run(self.rows[self.target[cycle], 0].astype(int).tolist())

    def _run(self, locations: Sequence[int]) -> Run:
        return Run(tuple((self.names[k], len(list(samples))) for k, samples in itertools.groupby(locations)))


def maximum_mean_cycle(
    source: Int[np.ndarray, " edges"], target: Int[np.ndarray, " edges"], weight: Float[np.ndarray, " edges"]
) -> Int[np.ndarray, " cycle"]:
    """The edges of a cycle whose mean weight is the greatest, in their order.

    Howard's policy iteration: every node keeps one of its edges; the mean of the cycle that this leads to,
    and the bias on the way there, say whether another edge is better.

    **Arguments:** edges sorted by `source`; every node that one leads to has edges of its own.
    """
    nodes, source = np.unique(source, return_inverse=True)
    target = np.searchsorted(nodes, target)
    begins = np.flatnonzero(np.append(True, np.diff(source) > 0))
    chosen = _best_of_each(weight, source, begins)
    while True:
        mean, bias = _evaluated(target[chosen], weight[chosen])
        gain = mean[target]
        better = gain > mean[source] + 1e-12
        value = np.where(np.abs(gain - mean[source]) <= 1e-12, weight - gain + bias[target], -np.inf)
        best = _best_of_each(np.where(better.any(), gain, value), source, begins)
        improves = better[best] if better.any() else value[best] > bias + 1e-9
        if not improves.any():
            break
        chosen = np.where(improves, best, chosen)
    node = int(mean.argmax())
    seen: dict[int, int] = {}
    walk = []
    while node not in seen:
        seen[node] = len(walk)
        walk.append(int(chosen[node]))
        node = int(target[chosen[node]])
    return np.array(walk[seen[node] :])


def _best_of_each(
    value: Float[np.ndarray, " edges"], source: Int[np.ndarray, " edges"], begins: Int[np.ndarray, " nodes"]
) -> Int[np.ndarray, " nodes"]:
    """The first edge of each node that has the node's greatest value."""
    greatest = np.maximum.reduceat(value, begins)
    edges = np.flatnonzero(value == greatest[source])
    return edges[np.flatnonzero(np.append(True, np.diff(source[edges]) > 0))]


def _evaluated(
    onward: Int[np.ndarray, " nodes"], weight: Float[np.ndarray, " nodes"]
) -> tuple[Float[np.ndarray, " nodes"], Float[np.ndarray, " nodes"]]:
    """The mean of the cycle that each node's chosen edges lead to, and the bias until there."""
    size = len(onward)
    least, far = np.arange(size), onward
    for _ in range(size.bit_length()):  # twice as far each time
        least, far = np.minimum(least, least[far]), far[far]
    on_cycle = np.zeros(size, bool)
    on_cycle[far] = True
    root = least[far]
    total = np.bincount(root[on_cycle], weight[on_cycle], size)
    count = np.bincount(root[on_cycle], minlength=size)
    mean = (total / np.maximum(count, 1))[root]
    is_root = root == np.arange(size)
    bias = np.where(is_root, 0.0, weight - mean)
    far = np.where(is_root, np.arange(size), onward)
    for _ in range(size.bit_length()):
        bias, far = bias + np.where(far == np.arange(size), 0.0, bias[far]), far[far]
    return mean, bias
