"""The coarse matrix by fronts, compiled: its fronts are many and small, and what goes from kernel to kernel took longer than they do.

values: of each front, with own unknowns o and border b, F_bo F_oo^-1, then F_oo^-1 and F_ob, by rows.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._front_kernels import dot


@njit(cache=True, nogil=True)
def eliminate(tree, indptr, indices, mirror, S, values):
    """Write the fronts of a matrix by blocks S (blocks, k, k) to `values`; raises LinAlgError where one is singular.

    tree: order, first, starts and rows of an `EliminationTree`; mirror (blocks,): the block in the place (j, i) of that in (i, j).
    """
    order, first, starts, rows = tree
    k, n_rows, at = S.shape[1], len(order), 0
    place, local = np.empty(n_rows, dtype=np.int64), np.full(n_rows, -1)
    for i in range(n_rows):
        place[order[i]] = i
    fronts = len(first) - 1
    waiting, begin_of_waiting, count = np.empty(fronts, dtype=np.int64), np.zeros(fronts + 1, dtype=np.int64), 0
    stack = np.empty(1, dtype=S.dtype)  # complements of fronts whose parents are to come, one after the other
    for f in range(fronts):
        border = rows[starts[f] : starts[f + 1]]
        own, wide = first[f + 1] - first[f], first[f + 1] - first[f] + len(border)
        for i in range(own):
            local[first[f] + i] = i
        for i in range(len(border)):
            local[border[i]] = own + i
        F = np.zeros((wide * k, wide * k), dtype=S.dtype)
        for i in range(own):
            row = order[first[f] + i]
            for e in range(indptr[row], indptr[row + 1]):
                j = local[place[indices[e]]]
                if j >= 0:
                    F[i * k : (i + 1) * k, j * k : (j + 1) * k] = S[e]
                    if j >= own:
                        F[j * k : (j + 1) * k, i * k : (i + 1) * k] = S[mirror[e]]
        # in postorder a front's children are those that came last
        while count and rows[starts[waiting[count - 1]]] < first[f + 1]:
            count -= 1
            below = rows[starts[waiting[count]] : starts[waiting[count] + 1]]
            b, begin = len(below) * k, begin_of_waiting[count]
            for i in range(len(below)):
                for p in range(k):
                    to, source = local[below[i]] * k + p, stack[begin + (i * k + p) * b : begin + (i * k + p + 1) * b]
                    for j in range(len(below)):
                        column = local[below[j]] * k
                        for q in range(k):
                            F[to, column + q] += source[j * k + q]
        n, b = own * k, len(border) * k
        inverse, right = np.linalg.inv(np.ascontiguousarray(F[:n, :n])), np.ascontiguousarray(F[:n, n:])
        left = np.dot(np.ascontiguousarray(F[n:, :n]), inverse)
        values[at : at + b * n] = left.ravel()
        values[at + b * n : at + b * n + n * n] = inverse.ravel()
        values[at + b * n + n * n : at + n * (n + 2 * b)] = right.ravel()
        at += n * (n + 2 * b)
        if b:
            waiting[count] = f
            begin, end = begin_of_waiting[count], begin_of_waiting[count] + b * b
            if end > len(stack):
                stack = np.concatenate((stack, np.empty(end, dtype=S.dtype)))
            stack[begin:end] = (F[n:, n:] - np.dot(left, right)).ravel()
            count += 1
            begin_of_waiting[count] = end
        for i in range(own):
            local[first[f] + i] = -1
        for i in range(len(border)):
            local[border[i]] = -1


@njit(cache=True, nogil=True)
def solve_fronts(values, sizes, borders, x):
    """Overwrite x with S^-1 x, in the order of the fronts.

    sizes (fronts, 2): each front's own unknowns and its border's; borders: the numbers of the latter, front after front.
    """
    gathered = np.empty(max(1, sizes.max()), dtype=x.dtype)
    first, at, edge = 0, 0, 0
    for f in range(len(sizes)):
        n, b = sizes[f]
        own = x[first : first + n]
        for i in range(b):
            x[borders[edge + i]] -= dot(values[at + i * n : at + (i + 1) * n], own)
        first, at, edge = first + n, at + n * (n + 2 * b), edge + b
    for f in range(len(sizes) - 1, -1, -1):
        n, b = sizes[f]
        first, at, edge = first - n, at - n * (n + 2 * b), edge - b
        own, inverse, above = x[first : first + n], at + b * n, gathered[:b]
        right = inverse + n * n
        for i in range(b):
            above[i] = x[borders[edge + i]]
        for i in range(n):
            own[i] -= dot(values[right + i * b : right + (i + 1) * b], above)
        below = gathered[:n]
        for i in range(n):
            below[i] = dot(values[inverse + i * n : inverse + (i + 1) * n], own)
        own[:] = below
