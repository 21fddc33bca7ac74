"""A masonry wall on ranks of MPI, counted without assembling it: bodies, contacts, blocks of W, fronts and interfaces, and from them the
seconds of an iteration of ADMM. See `benchmarks/ranks.py`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.linear.elimination_tree import elimination_tree
from fcsim.linear.joints import PADDING
from fcsim.ranks.partition import partition

WALLS = {48: (6, 7), 192: (12, 15), 768: (24, 31), 2565: (45, 56), 20160: (126, 159)}
"""Bricks: courses, whole bricks a course (a half one closes it)."""
HEAD, BED, PLATEN = 16, 16, 45
"""Contacts of a head joint, of half a brick on another, of a whole brick on a platen, of 8 x 4 x 4 elements a brick; 25 of half a brick."""
NODES, HALF = 225, 125
"""Nodes of a whole and of half a brick."""
D, REAL, SINGLE = 3, 8, 4
ITERATIONS = 120
"""Of ADMM a step at 1e-4: 118 to 124 in the median of 768 and 2565 bricks (docs/speed.md)."""
SEPARATE = 3
"""Exchanges of a solution on the interface and of its joining; a product has one more, and each of both one to agree."""


@dataclass(frozen=True)
class Rates:
    """product, fronts, interface [bytes/s]; vectors: [s] an iteration and unknown; factor [flops/s]; latency [s]; network [bytes/s]."""

    product: float = 7.8e9
    fronts: float = 1.1e10
    interface: float = 1.0e10
    vectors: float = 1.0e-7
    factor: float = 6.0e10
    latency: float = 2e-6
    network: float = 1e10


@dataclass(frozen=True)
class Wall:
    """Bodies (courses of bricks, the held platen, the free one) at centres with costs, joints (nj, 2) of bodies and contacts (nj,);
    still (nb,): bodies without a share in W."""

    centres: np.ndarray
    costs: np.ndarray
    joints: np.ndarray
    contacts: np.ndarray
    still: np.ndarray


def wall(courses: int, whole: int) -> Wall:
    """A running bond; lengths in half bricks, the half brick of every other course at the other end."""
    n = whole + 1
    length = np.array([[2] * whole + [1] if c % 2 else [1] + [2] * whole for c in range(courses)])
    begin = np.cumsum(length, axis=1) - length
    number = np.arange(courses * n).reshape(courses, n)
    joints = [np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1)]
    counts = [np.full(courses * (n - 1), HEAD)]
    for c in range(courses - 1):  # a joint for every half brick of a course's length
        of = [np.searchsorted(begin[k], np.arange(2 * whole + 1), side="right") - 1 for k in (c, c + 1)]
        joints.append(np.stack([number[c][of[0]], number[c + 1][of[1]]], axis=1))
        counts.append(np.full(2 * whole + 1, BED))
    bottom, top = courses * n, courses * n + 1
    for course, platen in ((0, bottom), (courses - 1, top)):
        joints.append(np.stack([number[course], np.full(n, platen)], axis=1))
        counts.append(np.where(length[course] == 2, PLATEN, 25))
    middle = np.stack(
        [0.1 * (begin + length / 2), np.full_like(begin, 0.05, dtype=float), 0.1 * np.indices(length.shape)[0] + 0.05], axis=2
    )
    ends = np.array([[0.1 * whole + 0.05, 0.05, 0.1 * courses + 0.05], [0.1 * whole + 0.05, 0.05, -0.05]])
    costs = np.concatenate([np.where(length.ravel() == 2, NODES, HALF).astype(float), [10.0, 10.0]])
    still = np.arange(len(costs)) == bottom
    return Wall(np.concatenate([middle.reshape(-1, 3), ends]), costs, np.concatenate(joints), np.concatenate(counts), still)


def blocks_of(own: np.ndarray, wall: Wall) -> int:
    """Blocks of a rank's share of W: contacts that share one of its bodies; own (nb,): which bodies are its."""
    moving = own & ~wall.still
    of_body = np.zeros(len(own))
    for side in (0, 1):
        np.add.at(of_body, wall.joints[:, side], wall.contacts)
    both = moving[wall.joints].all(axis=1)
    return int(np.sum(of_body[moving] ** 2) - np.sum(wall.contacts[both].astype(float) ** 2))


@dataclass(frozen=True)
class Share:
    """What a rank has: contacts and those at the interface, blocks of W, numbers in its fronts, flops of their Cholesky factorisation."""

    contacts: int
    interface: int
    blocks: int
    entries: float
    flops: float


def share(wall: Wall, owner: np.ndarray, rank: int) -> Share:
    own = owner == rank
    moving = own & ~wall.still
    mine = np.flatnonzero(moving[wall.joints].any(axis=1))
    pairs, counts = wall.joints[mine], wall.contacts[mine]
    ranks = np.where(wall.still[wall.joints], rank, owner[wall.joints])[mine]
    between = (ranks != rank).any(axis=1)
    entries, flops = fronts(pairs, moving, counts, between)
    return Share(int(counts.sum()), int(counts[between].sum()), blocks_of(own, wall), entries, flops)


def fronts(pairs: np.ndarray, moving: np.ndarray, counts: np.ndarray, last: np.ndarray) -> tuple[float, float]:
    """Numbers and flops of the fronts of joints (nj, 2), neighbours where they share a moving body, those that are last left out."""
    joint, body = np.repeat(np.arange(len(pairs)), 2), pairs.ravel()
    on = moving[body]
    touch = sp.csr_array((np.ones(on.sum()), (joint[on], body[on])), shape=(len(pairs), len(moving)))
    graph = sp.csr_array(touch @ touch.T)
    graph.sort_indices()
    tree = elimination_tree(graph.indptr, graph.indices, PADDING, last)
    entries = flops = 0.0
    for own, border, _ in tree:
        n = D * float(counts[own[~last[own]]].sum())
        b = D * float(counts[border].sum() + counts[own[last[own]]].sum())
        entries += n * n + n * b
        flops += n**3 / 3 + n * n * b + n * b * b
    return entries, flops


@dataclass(frozen=True)
class Counted:
    """A wall on so many ranks: the busiest rank's share by entries, the interface's contacts, all contacts; nested: see `nested`."""

    ranks: int
    share: Share
    interface: int
    contacts: int
    nested: tuple[float, float, int]


def counted(wall: Wall, ranks: int) -> Counted:
    owner = partition(wall.centres, wall.costs, ranks)
    contacts = int(wall.contacts.sum())
    bricks = len(owner) - 2
    some = {int(owner[body]) for body in (0, bricks // 2, bricks - 1, bricks + 1)} | {int(np.argmax(np.bincount(owner[:bricks])))}
    looked_at = range(ranks) if ranks <= 16 else some
    shares = [share(wall, owner, rank) for rank in looked_at]
    busiest = max(shares, key=lambda one: one.entries + one.blocks * D * D)
    between = owner[wall.joints[:, 0]] != owner[wall.joints[:, 1]]
    between &= ~wall.still[wall.joints].any(axis=1)
    return Counted(ranks, busiest, int(wall.contacts[between].sum()), contacts, nested(wall, owner, ranks))


def nested(wall: Wall, owner: np.ndarray, ranks: int) -> tuple[float, float, int]:
    """Numbers and flops a rank in the separators' fronts, each shared by the ranks of its group, on the most burdened way to the root;
    levels. ranks: a power of two, else nothing."""
    levels = ranks.bit_length() - 1
    if ranks != 2**levels:
        return math.nan, math.nan, 0
    a, b = (owner[wall.joints[:, side]] for side in (0, 1))
    held = wall.still[wall.joints].any(axis=1)
    entries, flops = np.zeros(1), np.zeros(1)
    for level in range(levels):  # of groups of 2^(levels - level) ranks, from the root
        group, half = levels - level, levels - level - 1
        same = ~held & (a >> group == b >> group)
        splits = same & (a >> half != b >> half)
        n = D * np.bincount(a[splits] >> group, wall.contacts[splits], 2**level)
        out = ~held & (a >> group != b >> group)
        border = D * sum(np.bincount(side[out] >> group, wall.contacts[out], 2**level) for side in (a, b))
        size = 2**group
        entries = entries + (n * n + n * border) / size
        flops = flops + (n**3 / 3 + n * n * border + n * border**2) / size
        entries, flops = np.repeat(entries, 2), np.repeat(flops, 2)
    return float(entries.max()), float(flops.max()), levels


def seconds(c: Counted, rates: Rates, *, as_built: bool) -> dict[str, float]:
    """The parts of an iteration [s] of the busiest rank, the factorisation [s], memory of W and factor [MB], bytes received and exchanges
    of an iteration."""
    m, k, P = D * c.contacts, D * c.interface, c.ranks
    own = D * c.share.contacts
    part = {"W": c.share.blocks * (D * D * REAL + 4) / rates.product, "fronts": 2 * SINGLE * c.share.entries / rates.fronts}
    stages = math.ceil(math.log2(P)) if P > 1 else 0
    memory = c.share.blocks * (D * D * REAL + 4) + SINGLE * c.share.entries
    flops = c.share.flops
    if as_built:
        part["interface"] = SINGLE * k * k / P / rates.interface
        part["vectors"] = rates.vectors * m
        received = REAL * (2 * m + 3 * k) if P > 1 else 0  # W x and x whole, sums and solution on the interface
        part["network"] = (SEPARATE + 3) * stages * rates.latency + received / rates.network
        memory += (REAL + SINGLE) * k * k / P + REAL * k * k if P > 1 else 0  # the complement is whole while it is factored
        flops += k**3 * (1 / 3 + 2 / P) if P > 1 else 0
    else:
        entries, more, levels = c.nested
        part["interface"] = 2 * SINGLE * entries / rates.interface
        part["vectors"] = rates.vectors * own
        received = 4 * REAL * D * c.share.interface
        part["network"] = (2 * sum(range(1, levels + 1)) + 2 * 4 + 3 * stages) * rates.latency + received / rates.network
        memory += SINGLE * entries
        flops += more
    total = sum(part.values())
    exchanges = (SEPARATE + 3 if as_built else 2 * c.nested[2] + 3) if P > 1 else 0
    found = {"iteration": total, "factor": flops / rates.factor, "memory": memory / 1e6}
    return {**part, **found, "bytes": float(received), "exchanges": float(exchanges)}
