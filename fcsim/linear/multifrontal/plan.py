"""What a multifrontal LU is before any number is known: its fronts, where their entries stand, and what each takes from others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, IntArray
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.elimination_tree import EliminationTree


class Front(NamedTuple):
    """own, border: its contacts; beyond: the numbers of the latter; at: where its entries begin; number: of its first own contact;
    children: the fronts that it takes complements from, with the places of their rows among own and border."""

    own: IntArray
    border: IntArray
    beyond: IntArray
    at: int
    number: int
    children: list[tuple[int, IntArray]]


class Plan:
    """The fronts of a tree with the contacts that take part (nc,), before any number is known; all their entries stand in one array."""

    def __init__(self, tree: EliminationTree, taking_part: BoolArray, d: int) -> None:
        self.contacts = tree.order[taking_part[tree.order]]
        self.parent, self.front_of = tree.parent, np.empty(len(taking_part), dtype=np.int64)  # contacts' fronts
        self.fronts: list[Front] = []
        self.front_of[tree.order] = np.repeat(np.arange(len(tree)), np.diff(tree.first))
        number = np.empty(len(taking_part), dtype=np.int64)
        number[self.contacts] = np.arange(len(self.contacts))
        waiting: dict[int, list[int]] = {}
        begin = end = 0
        for f, (own, border, parent) in enumerate(tree):
            own, border = own[taking_part[own]], border[taking_part[border]]
            n, b, beyond = len(own), len(border), number[border]
            below = [(k, self.fronts[k].beyond) for k in waiting.pop(f, ())]
            children = [(k, np.where(rows < begin + n, rows - begin, n + np.searchsorted(beyond, rows))) for k, rows in below]
            self.fronts.append(Front(own, border, beyond, end, begin, children))
            if b:
                waiting.setdefault(parent, []).append(f)
            begin, end = begin + n, end + d * d * n * (n + 2 * b)
        self.ends = np.array([*(front.at for front in self.fronts), end])
        some = [front for front in self.fronts if len(front.own)]
        self.sizes = d * np.array([(len(front.own), len(front.border)) for front in some], dtype=np.int64).reshape(-1, 2)
        self.borders = np.concatenate([np.empty(0, dtype=np.int64), *(dofs_of(front.beyond, d) for front in some)])

    def with_others(self, indptr: IntArray, indices: IntArray, entries: IntArray) -> BoolArray:
        """Which fronts (fronts,) have one of these entries of block rows in what they eliminate, or another such front below them."""
        row = np.searchsorted(indptr, entries, side="right") - 1
        anew = np.zeros(len(self.fronts), dtype=bool)
        anew[np.minimum(self.front_of[row], self.front_of[indices[entries]])] = True
        for f, parent in enumerate(self.parent.tolist()):  # children before parents
            if parent >= 0 and anew[f]:
                anew[parent] = True
        return anew
