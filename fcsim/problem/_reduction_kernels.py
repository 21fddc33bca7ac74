"""Loops over the entries of M, compiled by numba: its connected components, which of their blocks are equal, single blocks, and a
diagonal added to those of W."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def connected_components(indptr, indices):
    """The connected components of the graph of a square matrix (csr or csc), in the order of their first unknowns.

    Returns the unknowns by component (n,), where each component begins (count + 1,) and each unknown's place in its own (n,).
    """
    n = len(indptr) - 1
    parent = np.arange(n)  # of two joined trees the smaller root stays: parent[i] <= i
    for i in range(n):
        own = i
        for e in range(indptr[i], indptr[i + 1]):
            other = indices[e]
            if parent[other] == own:
                continue
            while parent[own] != own:
                parent[own] = parent[parent[own]]
                own = parent[own]
            while parent[other] != other:
                parent[other] = parent[parent[other]]
                other = parent[other]
            if own < other:
                parent[other] = own
            else:
                parent[own] = other
                own = other
    count = 0
    label, place, size = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64), np.zeros(n + 1, dtype=np.int64)
    for i in range(n):
        label[i] = count if parent[i] == i else label[parent[i]]
        count += parent[i] == i
        place[i] = size[label[i]]
        size[label[i]] += 1
    start = np.empty(count + 1, dtype=np.int64)
    start[0] = 0
    for c in range(count):
        start[c + 1] = start[c] + size[c]
    order = np.empty(n, dtype=np.int64)
    for i in range(n):
        order[start[label[i]] + place[i]] = i
    return order, start, place


@njit(cache=True)
def difference(indptr, indices, data, first, second, place, limit):
    """max |A - B| of the blocks A on the unknowns first (s,) and B on second (s,) of one matrix, or some number above limit."""
    largest = 0.0
    for row in range(len(first)):
        e, e_end = indptr[first[row]], indptr[first[row] + 1]
        f, f_end = indptr[second[row]], indptr[second[row] + 1]
        while e < e_end and f < f_end and place[indices[e]] == place[indices[f]]:
            apart = abs(data[e] - data[f])
            if apart > largest:
                largest = apart
            e += 1
            f += 1
        while e < e_end or f < f_end:  # an entry that only one of them stores
            column = place[indices[e]] if e < e_end else len(first)
            other = place[indices[f]] if f < f_end else len(first)
            value = 0.0
            if column <= other:
                value += data[e]
                e += 1
            if other <= column:
                value -= data[f]
                f += 1
            largest = max(largest, abs(value))
        if largest > limit:
            break
    return largest


@njit(cache=True)
def equal_blocks(indptr, indices, data, order, start, place, wanted, tolerance):
    """Number the kinds of diagonal blocks that differ by at most tolerance times their largest entry, in a csr or csc matrix
    with sorted indices.

    order, start, place: the `connected_components`; wanted (count,): which of them are numbered. Returns the kind of each component
    (count,), -1 for the others, and whether the blocks of a kind are equal to the last bit.
    """
    count, exact = len(start) - 1, True
    kind = np.full(count, -1)
    example, largest, kinds = np.empty(count, dtype=np.int64), np.empty(count), 0
    for c in range(count):
        if not wanted[c]:
            continue
        own = order[start[c] : start[c + 1]]
        greatest = 0.0
        for i in own:
            for e in range(indptr[i], indptr[i + 1]):
                greatest = max(greatest, abs(data[e]))
        for k in range(kinds):
            limit = tolerance * largest[k]
            if abs(greatest - largest[k]) > limit:  # then some entry differs by more: the blocks themselves need not be read
                continue
            first = order[start[example[k]] : start[example[k] + 1]]
            if len(first) == len(own):
                apart = difference(indptr, indices, data, first, own, place, limit)
                if apart <= limit:
                    kind[c] = k
                    exact = exact and apart == 0
                    break
        if kind[c] < 0:
            kind[c], example[kinds], largest[kinds] = kinds, c, greatest
            kinds += 1
    return kind, exact


@njit(cache=True)
def block_of(indptr, indices, data, unknowns, place):
    """The block on the unknowns (s,) of a component, in their order and stored as the matrix is (csr or csc): starts, indices, values.

    place (n,) of these unknowns becomes that order.
    """
    starts = np.zeros(len(unknowns) + 1, dtype=indptr.dtype)
    for row in range(len(unknowns)):
        place[unknowns[row]] = row
        starts[row + 1] = starts[row] + indptr[unknowns[row] + 1] - indptr[unknowns[row]]
    columns, values = np.empty(starts[-1], dtype=indices.dtype), np.empty(starts[-1])
    for row in range(len(unknowns)):
        begin = indptr[unknowns[row]] - starts[row]
        for e in range(starts[row], starts[row + 1]):
            columns[e], values[e] = place[indices[begin + e]], data[begin + e]
    return starts, columns, values


@njit(cache=True)
def asymmetry(indptr, indices, data, dense):
    """max |A_ij - A_ji| / max |A_ij| of a csr or csc matrix A (n, n) that is given dense as well."""
    largest, apart = 0.0, 0.0
    for i in range(len(indptr) - 1):
        for e in range(indptr[i], indptr[i + 1]):
            largest = max(largest, abs(data[e]))
            apart = max(apart, abs(dense[i, indices[e]] - dense[indices[e], i]))
    return apart / largest if largest > 0 else 0.0


@njit(cache=True)
def added_to_own_blocks(indptr, indices, blocks, diagonal):
    """Add diag(diagonal) to block rows (indptr, indices, blocks (n, d, d)); False, and nothing added, where a contact's own block is not
    there once or a block is zero: a sum of matrices leaves such out."""
    nc, d = len(indptr) - 1, blocks.shape[1]
    own = np.full(nc, -1)
    for a in range(nc):
        for e in range(indptr[a], indptr[a + 1]):
            if indices[e] == a:
                if own[a] >= 0:
                    return False
                own[a] = e
            some = False
            for i in range(d):
                for j in range(d):
                    some = some or blocks[e, i, j] != 0.0
            if not some:
                return False
        if own[a] < 0:
            return False
    for a in range(nc):
        for i in range(d):
            blocks[own[a], i, i] += diagonal[d * a + i]
    return True


@njit(cache=True)
def alike_in_contacts(indptr, indices, n, unknowns, d):
    """Where a new group begins in the unknowns (k,) so that those of a group touch the same contacts of H (n, d nc; csc): (groups + 1,).

    Neighbours alone are compared, and by a hash: what is grouped by mistake only makes the group's share of W larger.
    """
    signature, last = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)  # last: 1 + the last contact
    for a in range((len(indptr) - 1) // d):
        for e in range(indptr[a * d], indptr[a * d + d]):
            if last[indices[e]] <= a:
                last[indices[e]] = a + 1
                signature[indices[e]] = 1000003 * (signature[indices[e]] ^ (a + 1))
    begin, groups = np.empty(len(unknowns) + 1, dtype=np.int64), 0
    for k in range(len(unknowns)):
        if k == 0 or signature[unknowns[k]] != signature[unknowns[k - 1]]:
            begin[groups] = k
            groups += 1
    begin[groups] = len(unknowns)
    return begin[: groups + 1]
