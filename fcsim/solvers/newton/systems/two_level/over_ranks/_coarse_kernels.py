"""The coarse matrix by fronts, compiled: its fronts are many and small, and what goes from kernel to kernel took longer than they do.

tree: order, first, starts and rows of an `EliminationTree`, `which` of its fronts are meant, children before parents; values: of each of
them, with own unknowns o and border b, F_bo F_oo^-1, then F_oo^-1 and F_ob, by rows.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._front_kernels import dot, extend_add
from fcsim.solvers.newton.systems.two_level._joint_kernels import put


@njit(cache=True)
def separators(begins, columns, rank, first):
    """Return which bodies (n,) are to be taken away so that none is next to one of another rank: those that are `first` (n,), then again
    and again the one that is next to most of these, of equal ones the one before (V. Chvatal, Math. Oper. Res. 4, 1979).
    begins, columns: of a symmetric pattern; rank (n,)."""
    n = len(begins) - 1
    taken, beside = first.copy(), np.zeros(n, dtype=np.int64)  # of other ranks that are not taken
    for b in range(n):
        if not taken[b]:
            for e in range(begins[b], begins[b + 1]):
                beside[b] += rank[columns[e]] != rank[b] and not taken[columns[e]]
    while True:
        most = np.argmax(beside)
        if beside[most] == 0:
            return taken
        taken[most], beside[most] = True, 0
        for e in range(begins[most], begins[most + 1]):
            other = columns[e]
            if rank[other] != rank[most] and not taken[other]:
                beside[other] -= 1


@njit(cache=True, nogil=True)
def eliminate(tree, which, indptr, indices, mirror, S, changed, top, values, complements, T):
    """Write the fronts of a matrix by blocks S (blocks, k, k) to `values`, in the precision of these, and add what they leave on the rows
    top[place] >= 0, which none of them has for its own, to T; raises LinAlgError where one is singular.

    Fronts of which no block is `changed` (blocks,), nor one below them, are in `values` and `complements`, front after front, from before.
    place: in the order of elimination; mirror (blocks,): the block in the place (j, i) of that in (i, j).
    """
    order, first, starts, rows = tree
    k, n_rows, at, end = S.shape[1], len(order), 0, 0
    place, local = np.empty(n_rows, dtype=np.int64), np.full(n_rows, -1)
    for i in range(n_rows):
        place[order[i]] = i
    waiting, begins, count = np.empty(len(which), dtype=np.int64), np.empty(len(which), dtype=np.int64), 0
    anew = np.empty(len(which), dtype=np.bool_)  # of those that wait for their parents
    work, none = _work(first, starts, which, k), np.int64(0)  # as in `fcsim.linear._front_kernels.extend_add`
    of_top = np.empty((0, 0))
    for f in which:
        border = rows[starts[f] : starts[f + 1]]
        own = first[f + 1] - first[f]
        n, b = own * k, len(border) * k
        begin, end = end, end + b * b
        children = count  # in postorder they are those that came last
        while children and rows[starts[waiting[children - 1]]] < first[f + 1]:
            children -= 1
        if np.any(anew[children:count]) or _has_changed(f, order, first, place, indptr, indices, mirror, changed):
            for i in range(own):
                local[first[f] + i] = i
            for i in range(len(border)):
                local[border[i]] = own + i
            F11, F12, F21, left, product = work[0][: n * n], work[1][: n * b], work[2][: n * b], work[3][: n * b], work[4][: b * b]
            F22 = complements[begin:end]
            for part in (F11, F12, F21, F22):
                part[:] = 0
            parts = F11.reshape(n, n), F12.reshape(n, b), F21.reshape(b, n), F22.reshape(b, b)
            _fill_front(f, order, first, place, local, indptr, indices, mirror, S, parts)
            for c in range(count - 1, children - 1, -1):
                below = rows[starts[waiting[c]] : starts[waiting[c] + 1]]
                size = len(below) * k
                extend_add(complements[begins[c] : begins[c] + size * size].reshape(size, size), local[below], own, k, *parts)
            inverse = np.linalg.inv(parts[0])
            np.dot(parts[2], inverse, left.reshape(b, n))
            np.dot(left.reshape(b, n), parts[1], product.reshape(b, b))
            for e in range(b * b):
                F22[e] -= product[e]
            put(left, values, at)
            put(inverse.ravel(), values, at + b * n)
            put(F12, values, at + b * n + n * n)
            local[first[f] : first[f + 1]] = -1
            for i in range(len(border)):
                local[border[i]] = -1
            is_anew = True
        else:
            is_anew = False
        at += n * (n + 2 * b)
        count = children
        if b and top[border[0]] >= 0:  # and so are the others, which follow
            extend_add(complements[begin:end].reshape(b, b), top[border], none, k, of_top, of_top, of_top, T)
        elif b:
            waiting[count], begins[count], anew[count] = f, begin, is_anew
            count += 1


@njit(cache=True, nogil=True)
def _work(first, starts, which, k):
    """Memory for the largest front's F11, F12, F21, F21 F11^-1 and F21 F11^-1 F12: to ask for what each front takes costs a large one as
    much as its products do."""
    n, b, nb = 0, 0, 0
    for f in which:
        own, border = k * (first[f + 1] - first[f]), k * (starts[f + 1] - starts[f])
        n, b, nb = max(n, own), max(b, border), max(nb, own * border)
    return np.empty(n * n), np.empty(nb), np.empty(nb), np.empty(nb), np.empty(b * b)


@njit(cache=True, nogil=True)
def _has_changed(f, order, first, place, indptr, indices, mirror, changed):
    """Whether a block that the front f takes is `changed`."""
    for i in range(first[f], first[f + 1]):
        for e in range(indptr[order[i]], indptr[order[i] + 1]):
            if place[indices[e]] >= first[f] and (changed[e] or changed[mirror[e]]):
                return True
    return False


@njit(cache=True, nogil=True)
def _fill_front(f, order, first, place, local, indptr, indices, mirror, S, parts):
    """Write the blocks of the front f's own rows and columns to its parts F11, F12, F21; local: the numbers of its places in it, -1 of
    others."""
    F11, F12, F21, _ = parts
    own, k = first[f + 1] - first[f], S.shape[1]
    for i in range(own):
        row = order[first[f] + i]
        for e in range(indptr[row], indptr[row + 1]):
            j = local[place[indices[e]]]
            if j < 0:
                continue
            for p in range(k):
                for q in range(k):
                    if j < own:
                        F11[i * k + p, j * k + q] = S[e, p, q]
                    else:
                        F12[i * k + p, (j - own) * k + q] = S[e, p, q]
                        F21[(j - own) * k + p, i * k + q] = S[mirror[e], p, q]


@njit(cache=True, nogil=True)
def forward(values, sizes, firsts, borders, x):
    """Eliminate the fronts' own unknowns, from firsts[f] on, from x; sizes (fronts, 2): each front's own unknowns and its border's;
    borders: the numbers of the latter, front after front."""
    at, edge = 0, 0
    for f in range(len(sizes)):
        n, b = sizes[f]
        own = x[firsts[f] : firsts[f] + n]
        for i in range(b):
            x[borders[edge + i]] -= dot(values[at + i * n : at + (i + 1) * n], own)
        at, edge = at + n * (n + 2 * b), edge + b


@njit(cache=True, nogil=True)
def backward(values, sizes, firsts, borders, x):
    """Solve for the fronts' own unknowns after `forward`, where x is known on what is not theirs."""
    at, edge, most = len(values), len(borders), 1
    for f in range(len(sizes)):
        most = max(most, sizes[f, 0], sizes[f, 1])
    gathered = np.empty(most, dtype=x.dtype)
    for f in range(len(sizes) - 1, -1, -1):
        n, b = sizes[f]
        at, edge = at - n * (n + 2 * b), edge - b
        own, inverse, right, above = x[firsts[f] : firsts[f] + n], at + b * n, at + b * n + n * n, gathered[:b]
        for i in range(b):
            above[i] = x[borders[edge + i]]
        for i in range(n):
            own[i] -= dot(values[right + i * b : right + (i + 1) * b], above)
        below = gathered[:n]
        for i in range(n):
            below[i] = dot(values[inverse + i * n : inverse + (i + 1) * n], own)
        for i in range(n):
            own[i] = below[i]


@njit(cache=True, nogil=True)
def eliminated(c, order, fronts, of_top, z, rows, x, left, sent):
    """x = c (n,) in the `order` of elimination after `forward`; what is `left` of_top; to `sent` the rows of z (k, d) that go with it."""
    for i in range(len(order)):
        x[i] = c[order[i]]
    forward(*fronts, x)
    for i in range(len(of_top)):
        left[i] = x[of_top[i]]
    d = z.shape[1]
    for i in range(len(rows)):
        for p in range(d):
            sent[i * d + p] = z[rows[i], p]


@njit(cache=True, nogil=True)
def solved(fronts, x, of_top, total, known, to, told, solution, sent):
    """`backward` from x and its part `total` of the top; x at the places `known` to the numbers `to` of the solution, `told` to `sent`."""
    for i in range(len(of_top)):
        x[of_top[i]] = total[i]
    backward(*fronts, x)
    for i in range(len(known)):
        solution[to[i]] = x[known[i]]
    for i in range(len(told)):
        sent[i] = x[told[i]]
