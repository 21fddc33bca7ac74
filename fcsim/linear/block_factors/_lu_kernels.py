"""The multifrontal LU factorisation of a block-sparse matrix, compiled by numba; see `fcsim.linear.block_factors.lu`."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._elimination_tree_kernels import places_of

WIDTH = 32
"""Columns that are eliminated before the rest of a front is updated."""
BY_BLAS = 100_000
"""Multiplications of an update from which BLAS' product is worth its copies."""


@njit(cache=True)
def mirrored(indptr, indices):
    """For each entry (a, b) of a symmetric pattern with sorted rows the place of (b, a)."""
    following = indptr[:-1].copy()
    mirror = np.empty(len(indices), dtype=np.int64)
    for a in range(len(indptr) - 1):
        for e in range(indptr[a], indptr[a + 1]):
            b = indices[e]
            mirror[e] = following[b]  # rows ask for the entries of row b by rising a
            following[b] += 1
    return mirror


@njit(cache=True)
def pivoted(F, n1, k, pivots):
    """Exchange row k of a front, n1 rows of which are its own, with the row pivots[k] >= k of these whose entry in column k is largest;
    False: singular."""
    p, largest = k, abs(F[k, k])
    for i in range(k + 1, n1):
        if abs(F[i, k]) > largest:
            p, largest = i, abs(F[i, k])
    if not 0.0 < largest < np.inf:
        return False
    pivots[k] = p
    if p != k:
        for j in range(F.shape[1]):
            F[k, j], F[p, j] = F[p, j], F[k, j]
    return True


@njit(cache=True, fastmath={"contract"})
def eliminate(F, n1, pivots):
    """LU of the first n1 columns of a front F (n, n) in place, rows n1 on less their products; False: singular.

    Rows are exchanged among the first n1 alone: row k with row pivots[k] >= k.
    """
    n = len(F)
    for k0 in range(0, n1, WIDTH):
        k1 = min(k0 + WIDTH, n1)
        for k in range(k0, k1):
            if not pivoted(F, n1, k, pivots):
                return False
            row, scale = F[k], 1.0 / F[k, k]
            for i in range(k + 1, n):
                f = F[i, k] * scale
                F[i, k] = f
                if f != 0.0:
                    out, ahead = F[i, k + 1 : k1], row[k + 1 : k1]
                    for j in range(len(out)):  # from 0 on, so that the compiler makes vectors
                        out[j] -= f * ahead[j]
        if k1 == n:
            return True
        for k in range(k0, k1):
            row = F[k, k1:]
            for i in range(k + 1, k1):
                f = F[i, k]
                if f != 0.0:
                    out = F[i, k1:]
                    for j in range(n - k1):
                        out[j] -= f * row[j]
        if (n - k1) * (n - k1) * (k1 - k0) > BY_BLAS:
            product = np.dot(F[k1:, k0:k1].copy(), F[k0:k1, k1:].copy())
            for i in range(k1, n):
                out, own = F[i], product[i - k1]
                for j in range(k1, n):
                    out[j] -= own[j - k1]
            continue
        for i in range(k1, n):
            out, left = F[i, k1:], F[i, :k1]
            k = k0
            while k + 4 <= k1:
                a, b, c, e = F[k, k1:], F[k + 1, k1:], F[k + 2, k1:], F[k + 3, k1:]
                fa, fb, fc, fe = left[k], left[k + 1], left[k + 2], left[k + 3]
                for j in range(n - k1):
                    out[j] -= fa * a[j] + fb * b[j] + fc * c[j] + fe * e[j]
                k += 4
            while k < k1:
                a, fa = F[k, k1:], left[k]
                for j in range(n - k1):
                    out[j] -= fa * a[j]
                k += 1
    return True


@njit(cache=True)
def taking_part(order, first, starts, rows, active, d):
    """Of the fronts, what is left on the active contacts (nc,): places -1 or counted (nc,), own and border counts, and where the
    values begin (fronts + 1,)."""
    number = np.full(len(order), -1)
    count = 0
    for j in range(len(order)):
        if active[order[j]]:
            number[j] = count
            count += 1
    ns = len(first) - 1
    own, border, offsets = np.zeros(ns, dtype=np.int64), np.zeros(ns, dtype=np.int64), np.zeros(ns + 1, dtype=np.int64)
    for s in range(ns):
        for j in range(first[s], first[s + 1]):
            own[s] += number[j] >= 0
        if own[s] > 0:
            for i in range(starts[s], starts[s + 1]):
                border[s] += number[rows[i]] >= 0
        offsets[s + 1] = offsets[s] + d * d * own[s] * (own[s] + 2 * border[s])
    return number, own, border, offsets


@njit(cache=True)
def factorise(indptr, indices, mirror, blocks, order, first, starts, rows, number, own, border, offsets, values, pivots):
    """Fill `values` with the factors of the fronts and `pivots` with their exchanges; False where a front is singular.

    Long because the front, and what waits for its parent, stay in buffers between its stages.
    """
    n, ns, d = len(order), len(first) - 1, blocks.shape[1]
    place = places_of(order)
    local = np.full(n, -1)
    front = np.empty(n, dtype=np.int64)
    largest = 0
    for s in range(ns):
        front[first[s] : first[s + 1]] = s
        largest = max(largest, d * (own[s] + border[s]))
    scratch, target = np.empty(largest * largest), np.empty(largest, dtype=np.int64)
    stack = np.empty(1 << 12)
    begin = np.empty(ns, dtype=np.int64)  # of a waiting complement in the stack
    waiting, taker = np.empty(ns, dtype=np.int64), np.empty(ns, dtype=np.int64)  # fronts with a waiting complement, and who takes it
    count = top = done = 0
    for s in range(ns):
        c0, c1 = first[s], first[s + 1]
        below = rows[starts[s] : starts[s + 1]]
        parent = front[below[0]] if len(below) > 0 else ns
        if own[s] == 0:  # nothing of it takes part: what waits for it falls on its border, so that its parent takes it
            for k in range(count - 1, -1, -1):
                if taker[k] != s:
                    break
                taker[k] = parent
            continue
        n1, n2 = d * own[s], d * border[s]
        k = 0
        for j in range(c0, c1):
            if number[j] >= 0:
                local[j] = k
                k += 1
        for i in below:
            if number[i] >= 0:
                local[i] = k
                k += 1
        F = scratch[: (n1 + n2) * (n1 + n2)].reshape(n1 + n2, n1 + n2)
        F[:] = 0.0
        for j in range(c0, c1):
            if number[j] < 0:
                continue
            row = d * local[j]
            for e in range(indptr[order[j]], indptr[order[j] + 1]):
                i = place[indices[e]]
                if i < c0 or number[i] < 0:
                    continue
                column = d * local[i]
                if d == 1:
                    F[row, column] = blocks[e, 0, 0]
                    if i >= c1:
                        F[column, row] = blocks[mirror[e], 0, 0]
                    continue
                w, back = blocks[e], blocks[mirror[e]]
                for p in range(d):
                    for q in range(d):
                        F[row + p, column + q] = w[p, q]
                        if i >= c1:
                            F[column + p, row + q] = back[p, q]
        while count > 0 and taker[count - 1] == s:
            child = waiting[count - 1]
            child_rows = rows[starts[child] : starts[child + 1]]
            count -= 1
            top = begin[count]
            size = d * border[child]
            V = stack[top : top + size * size].reshape(size, size)
            k = 0
            for i in child_rows:
                if number[i] >= 0:
                    for p in range(d):
                        target[k] = d * local[i] + p
                        k += 1
            for ib in range(size):
                out, own_row = F[target[ib]], V[ib]
                for jb in range(size):
                    out[np.uint64(target[jb])] += own_row[jb]
        if not eliminate(F, n1, pivots[done : done + n1]):
            return False
        done += n1
        at, m = offsets[s], n1 * (n1 + n2)
        for e in range(m):
            values[at + e] = scratch[e]
        at += m
        for i in range(n1, n1 + n2):
            for e in range(n1):
                values[at + e] = F[i, e]
            at += n1
        if n2 > 0:
            if top + n2 * n2 > len(stack):
                longer = np.empty(2 * (top + n2 * n2))
                for e in range(top):
                    longer[e] = stack[e]
                stack = longer
            begin[count], waiting[count], taker[count] = top, s, parent
            count += 1
            for i in range(n1, n1 + n2):
                for e in range(n2):
                    stack[top + e] = F[i, n1 + e]
                top += n2
    return True


@njit(cache=True)
def sign(own, border, offsets, values, pivots, d):
    """Of the determinant: that of the pivots' product, turned by each exchange of rows."""
    found, done = 1, 0
    for s in range(len(own)):
        n1, n = d * own[s], d * (own[s] + border[s])
        for k in range(n1):
            if values[offsets[s] + k * n + k] < 0:
                found = -found
            if pivots[done + k] != k:
                found = -found
        done += n1
    return found


@njit(cache=True, fastmath={"contract", "reassoc"})
def solve(order, first, starts, rows, number, own, border, offsets, values, pivots, d, rhs):
    """Return x (nc d,) of L U x = rhs (nc d,), zero for contacts that take no part."""
    n, ns = len(order), len(first) - 1
    x, out, rest = np.empty(len(pivots)), np.zeros(n * d), np.empty(len(pivots))
    for j in range(n):
        if number[j] >= 0:
            for a in range(d):
                x[d * number[j] + a] = rhs[d * order[j] + a]
    done = 0
    for s in range(ns):
        n1, n2 = d * own[s], d * border[s]
        if n1 == 0:
            continue
        upper = values[offsets[s] : offsets[s] + n1 * (n1 + n2)].reshape(n1, n1 + n2)
        left = values[offsets[s] + n1 * (n1 + n2) : offsets[s + 1]].reshape(n2, n1)
        part = x[done : done + n1]
        for k in range(n1):
            p = pivots[done + k]
            part[k], part[p] = part[p], part[k]
        for k in range(1, n1):
            total, row = 0.0, upper[k]
            for j in range(k):
                total += row[j] * part[j]
            part[k] -= total
        k = 0
        for i in rows[starts[s] : starts[s + 1]]:
            if number[i] < 0:
                continue
            for a in range(d):
                total, row = 0.0, left[k]
                for j in range(n1):
                    total += row[j] * part[j]
                x[d * number[i] + a] -= total
                k += 1
        done += n1
    for s in range(ns - 1, -1, -1):
        n1, n2 = d * own[s], d * border[s]
        if n1 == 0:
            continue
        done -= n1
        upper = values[offsets[s] : offsets[s] + n1 * (n1 + n2)].reshape(n1, n1 + n2)
        part = x[done : done + n1]
        k = 0
        for i in rows[starts[s] : starts[s + 1]]:
            if number[i] >= 0:
                for a in range(d):
                    rest[k] = x[d * number[i] + a]
                    k += 1
        for k in range(n1 - 1, -1, -1):
            total, row = 0.0, upper[k]
            for j in range(k + 1, n1):
                total += row[j] * part[j]
            for j in range(n2):
                total += row[n1 + j] * rest[j]
            part[k] = (part[k] - total) / row[k]
    for j in range(n):
        if number[j] >= 0:
            for a in range(d):
                out[d * order[j] + a] = x[d * number[j] + a]
    return out
