"""The multifrontal Cholesky factorisation of a block-sparse matrix, compiled by numba; see `fcsim.linear.block_factors.cholesky`.

Dense fronts are stored by columns: P[p, i] is entry (i, p), so that inner loops run over contiguous rows.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._elimination_tree_kernels import places_of


@njit(cache=True, fastmath={"contract"})
def eliminate(P, U):
    """Cholesky of the first columns P (n1, n1 + n2) of a front, and U (n2, n2) less their outer product; False: not positive definite.

    Four columns at a time are subtracted from the others, so that these are loaded and stored four times less often.
    """
    n1, n = P.shape
    for p0 in range(0, n1, 4):
        width = min(4, n1 - p0)
        for p in range(p0, p0 + width):
            out = P[p]
            for s in range(p0, p):
                a, f = P[s], P[s, p]
                for i in range(p, n):
                    out[i] -= f * a[i]
            if not 0.0 < out[p] < np.inf:
                return False
            scale = 1.0 / np.sqrt(out[p])
            for i in range(p, n):
                out[i] *= scale
        if width < 4:
            break
        a, b, c, e = P[p0], P[p0 + 1], P[p0 + 2], P[p0 + 3]
        for q in range(p0 + 4, n1):
            out = P[q]
            fa, fb, fc, fe = a[q], b[q], c[q], e[q]
            for i in range(q, n):
                out[i] -= fa * a[i] + fb * b[i] + fc * c[i] + fe * e[i]
    for q in range(n - n1):
        out = U[q]
        p = 0
        while p + 4 <= n1:
            a, b, c, e = P[p, n1:], P[p + 1, n1:], P[p + 2, n1:], P[p + 3, n1:]
            fa, fb, fc, fe = a[q], b[q], c[q], e[q]
            for i in range(q, n - n1):
                out[i] -= fa * a[i] + fb * b[i] + fc * c[i] + fe * e[i]
            p += 4
        while p < n1:
            a = P[p, n1:]
            fa = a[q]
            for i in range(q, n - n1):
                out[i] -= fa * a[i]
            p += 1
    return True


@njit(cache=True)
def factorise(indptr, indices, blocks, shift, order, first, starts, rows, offsets, values):
    """Fill the panels `values` with the Cholesky factor of the block rows + shift I; False where that is not possible.

    Long because the panels stay in registers and buffers between its stages.
    """
    n, ns, d = len(order), len(first) - 1, blocks.shape[1]
    place = places_of(order)
    local = np.full(n, -1)
    owner = np.full(n, -1)  # the supernode that `local` refers to
    stack = np.empty(1 << 12)
    begin = np.empty(ns, dtype=np.int64)  # of a waiting update in the stack
    waiting = np.empty(ns, dtype=np.int64)  # supernodes with a waiting update
    count = top = 0
    for s in range(ns):
        c0, c1 = first[s], first[s + 1]
        below = rows[starts[s] : starts[s + 1]]
        k, n1, n2 = c1 - c0, d * (c1 - c0), d * len(below)
        for j in range(c0, c1):
            local[j], owner[j] = j - c0, s
        for i in range(len(below)):
            local[below[i]], owner[below[i]] = k + i, s
        P = values[offsets[s] : offsets[s + 1]].reshape(n1, n1 + n2)
        P[:] = 0.0
        if top + n2 * n2 > len(stack):
            longer = np.empty(2 * (top + n2 * n2))
            for e in range(top):
                longer[e] = stack[e]
            stack = longer
        U = stack[top : top + n2 * n2].reshape(n2, n2)
        U[:] = 0.0
        for j in range(c0, c1):
            for m in range(indptr[order[j]], indptr[order[j] + 1]):
                i = place[indices[m]]
                if i < j:
                    continue
                w = blocks[m]
                if owner[i] != s:  # its mirror image is not stored
                    if np.any(w != 0.0):
                        return False
                    continue
                row, column = d * local[i], d * (j - c0)
                for b in range(d):
                    for a in range(d):
                        P[column + b, row + a] += w[b, a]  # the block of row j, transposed: column j of a symmetric matrix
            for b in range(d):
                P[d * (j - c0) + b, d * (j - c0) + b] += shift
        base = top
        while count > 0:
            child = waiting[count - 1]
            child_rows = rows[starts[child] : starts[child + 1]]
            if child_rows[0] >= c1:  # the nearest row below is the parent
                break
            count -= 1
            base = begin[count]
            size = d * len(child_rows)
            V = stack[base : base + size * size].reshape(size, size)
            for jb in range(len(child_rows)):
                lj = d * local[child_rows[jb]]
                for b in range(d):
                    source = V[d * jb + b]
                    target, back = (P[lj + b], 0) if lj < n1 else (U[lj - n1 + b], n1)
                    for ib in range(jb, len(child_rows)):
                        li = d * local[child_rows[ib]] - back
                        for a in range(d):
                            target[li + a] += source[d * ib + a]
        if not eliminate(P, U):
            return False
        if n2 > 0:
            for i in range(n2 * n2):  # down over the children's updates
                stack[base + i] = stack[top + i]
            waiting[count], begin[count] = s, base
            count += 1
            top = base + n2 * n2
        else:
            top = base
    return True


@njit(cache=True, fastmath={"contract", "reassoc"})
def solve(order, first, starts, rows, offsets, values, d, rhs):
    """Return x of L L^T x = rhs (n d,), given and returned in the matrix' own order."""
    n, ns = len(order), len(first) - 1
    x = np.empty(n * d)
    for j in range(n):
        for a in range(d):
            x[d * j + a] = rhs[d * order[j] + a]
    work = np.empty(n * d)
    for s in range(ns):
        c0, c1 = first[s], first[s + 1]
        below = rows[starts[s] : starts[s + 1]]
        n1, n2 = d * (c1 - c0), d * len(below)
        P = values[offsets[s] : offsets[s + 1]].reshape(n1, n1 + n2)
        own, rest = x[d * c0 : d * c1], work[:n2]
        rest[:] = 0.0
        for p in range(n1):
            column = P[p]
            f = own[p] / column[p]
            own[p] = f
            for i in range(p + 1, n1):
                own[i] -= f * column[i]
            tail = column[n1:]
            for i in range(n2):
                rest[i] += f * tail[i]
        for i in range(len(below)):
            for a in range(d):
                x[d * below[i] + a] -= rest[d * i + a]
    for s in range(ns - 1, -1, -1):
        c0, c1 = first[s], first[s + 1]
        below = rows[starts[s] : starts[s + 1]]
        n1, n2 = d * (c1 - c0), d * len(below)
        P = values[offsets[s] : offsets[s + 1]].reshape(n1, n1 + n2)
        own, rest = x[d * c0 : d * c1], work[:n2]
        for i in range(len(below)):
            for a in range(d):
                rest[d * i + a] = x[d * below[i] + a]
        for p in range(n1 - 1, -1, -1):
            column = P[p]
            total = 0.0
            tail = column[n1:]
            for i in range(n2):
                total += tail[i] * rest[i]
            for i in range(p + 1, n1):
                total += column[i] * own[i]
            own[p] = (own[p] - total) / column[p]
    out = np.empty(n * d)
    for j in range(n):
        for a in range(d):
            out[d * order[j] + a] = x[d * j + a]
    return out
