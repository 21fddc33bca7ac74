"""The pattern of an elimination: joints, tree, structure and fronts of a factor, compiled by numba; see `fcsim.linear.elimination_tree`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def has_symmetric_pattern(indptr, indices):
    """Whether with each block (a, b) there is a block (b, a); rows must be sorted by column."""
    following = indptr[:-1].copy()
    for a in range(len(indptr) - 1):
        for e in range(indptr[a], indptr[a + 1]):
            b = indices[e]
            k = following[b]  # rows ask for the entries of row b by rising a
            if k == indptr[b + 1] or indices[k] != a:
                return False
            following[b] = k + 1
    return True


@njit(cache=True)
def quotient(indptr, indices, joint, count):
    """The pattern of joints (starts, columns) of a pattern of contacts: the diagonal, and an entry where any of their contacts has one."""
    first = np.zeros(count + 1, dtype=np.int64)  # of a joint's contacts in `members`
    for j in joint:
        first[j + 1] += 1
    for j in range(count):
        first[j + 1] += first[j]
    members, free = np.empty(len(joint), dtype=np.int64), first[:-1].copy()
    for a in range(len(joint)):
        members[free[joint[a]]] = a
        free[joint[a]] += 1
    seen = np.full(count, -1)
    starts, columns = np.zeros(count + 1, dtype=np.int64), np.empty(count + len(indices), dtype=np.int64)
    size = 0
    for j in range(count):
        seen[j], columns[size] = j, j
        size += 1
        for a in members[first[j] : first[j + 1]]:
            for k in range(indptr[a], indptr[a + 1]):
                other = joint[indices[k]]
                if seen[other] != j:
                    seen[other] = j
                    columns[size] = other
                    size += 1
        columns[starts[j] : size].sort()
        starts[j + 1] = size
    return starts, columns[:size].copy()


@njit(cache=True)
def places_of(order):
    """Where each of the n numbers in `order` stands: place[order[j]] = j."""
    place = np.empty(len(order), dtype=np.int64)
    for j in range(len(order)):
        place[order[j]] = j
    return place


@njit(cache=True)
def elimination_tree(indptr, indices, order):
    """Parent of each column (-1: root) of the factor of the rows and columns in `order` (J. W. H. Liu, SIAM J. Matrix Anal. 11, 1990)."""
    n = len(order)
    place = places_of(order)
    parent = np.full(n, -1)
    ancestor = np.full(n, -1)
    for i in range(n):
        for k in range(indptr[order[i]], indptr[order[i] + 1]):
            j = place[indices[k]]
            while j != -1 and j < i:
                following = ancestor[j]
                ancestor[j] = i
                if following == -1:
                    parent[j] = i
                j = following
    return parent


@njit(cache=True)
def postorder(parent):
    """The columns in an order in which a column follows all below it in the tree and each subtree is consecutive."""
    n = len(parent)
    first, sibling = np.full(n, -1), np.full(n, -1)
    for j in range(n - 1, -1, -1):
        if parent[j] >= 0:
            sibling[j] = first[parent[j]]
            first[parent[j]] = j
    order = np.empty(n, dtype=np.int64)
    stack = np.empty(n, dtype=np.int64)
    done = 0
    for root in range(n):
        if parent[root] >= 0:
            continue
        stack[0] = root
        top = 0
        while top >= 0:
            j = stack[top]
            if first[j] >= 0:
                top += 1
                stack[top] = first[j]
                first[j] = -1
                continue
            order[done] = j
            done += 1
            if sibling[j] >= 0 and top > 0:
                stack[top] = sibling[j]
            else:
                top -= 1
    return order


@njit(cache=True)
def column_structure(indptr, indices, order, parent):
    """Starts (n + 1,) and row numbers, ascending, of the factor's columns below the diagonal: row i reaches the columns on its paths."""
    n = len(order)
    place = places_of(order)
    starts = np.zeros(n + 1, dtype=np.int64)
    rows = np.empty(0, dtype=np.int64)
    for fill in range(2):
        following = starts[:-1].copy()
        seen = np.full(n, -1)
        for i in range(n):
            seen[i] = i
            for k in range(indptr[order[i]], indptr[order[i] + 1]):
                j = place[indices[k]]
                while j < i and seen[j] != i:
                    seen[j] = i
                    if fill:
                        rows[following[j]] = i
                        following[j] += 1
                    else:
                        starts[j + 1] += 1
                    j = parent[j]
        if not fill:
            starts = np.cumsum(starts)
            rows = np.empty(starts[n], dtype=np.int64)
    return starts, rows


@njit(cache=True)
def fronts(parent, starts, rows, size, padding):
    """First columns (fronts + 1,) of runs of columns eliminated as one front, each of `size` contacts (n,).

    A column's only rows below are its parent's, up to zeros of a share of `padding` of the front.
    """
    n = len(parent)
    below = np.zeros(n)  # contacts below the diagonal of each column
    for j in range(n):
        for k in range(starts[j], starts[j + 1]):
            below[j] += size[rows[k]]
    first = np.empty(n + 1, dtype=np.int64)
    count, zeros, columns = 0, 0.0, 0.0
    for j in range(n):
        merged, added = False, 0.0
        if count > 0 and parent[j - 1] == j:
            added = columns * (below[j] + size[j] - below[j - 1])
            wide = columns + size[j]
            merged = zeros + added <= padding * wide * (below[j] + 0.5 * (wide + 1))
        if merged:
            zeros += added
            columns += size[j]
        else:
            first[count] = j
            count += 1
            zeros, columns = 0.0, float(size[j])
    first[count] = n
    return first[: count + 1].copy()
