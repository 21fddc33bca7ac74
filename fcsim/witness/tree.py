"""Trees over the triangles of many skins at once."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray

_LEAF = 4


def build_trees(centres: FloatArray, counts: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Halve sets of triangles along their widest extent until _LEAF are left, all sets of a level at once.

    centres (n, 3) of the triangles, set after set of `counts`. Returns the triangles' order (n,), and for each node where its
    triangles begin and end and the number of its first child, -1 for a leaf; the second child follows it, children come after their
    parents, and the first nodes are the sets' roots.
    """
    order = np.arange(len(centres))
    last = np.cumsum(counts)
    begin, end = last - counts, last
    levels: list[tuple[IntArray, IntArray, IntArray]] = []
    nodes = 0
    while len(begin):
        large = end - begin > _LEAF
        nodes += len(begin)
        child = np.full(len(begin), -1)
        child[large] = nodes + 2 * np.arange(np.count_nonzero(large))
        levels.append((begin, end, child))
        begin, end = begin[large], end[large]
        if not len(begin):
            break
        size = end - begin
        segment = np.repeat(np.arange(len(begin)), size)
        rows = np.repeat(begin - np.concatenate([[0], np.cumsum(size)[:-1]]), size) + np.arange(len(segment))
        own = centres[order[rows]]
        start = np.concatenate([[0], np.cumsum(size)[:-1]])
        axis = np.argmax(np.maximum.reduceat(own, start) - np.minimum.reduceat(own, start), axis=1)
        sorted_ = np.lexsort((own[np.arange(len(own)), axis[segment]], segment))
        order[rows] = order[rows[sorted_]]
        middle = (begin + end) // 2
        begin, end = np.stack([begin, middle], axis=1).ravel(), np.stack([middle, end], axis=1).ravel()
    none = np.empty(0, dtype=np.int64)
    begin, end, child = (np.concatenate([none, *(level[i] for level in levels)]) for i in range(3))
    return order, begin, end, child
