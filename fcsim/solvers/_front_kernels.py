"""Compiled pieces of the multifrontal eliminations: filling a front with entries of the matrix and adding a child's complement to it."""

from __future__ import annotations

from numba import njit


@njit(cache=True)
def transposed_entries(indptr, indices, transposed):
    """Fill transposed[e] with the entry of block (b, a) for entry e of block (a, b); False where the pattern is not symmetric.

    Rows must be sorted by column."""
    following = indptr[:-1].copy()
    for a in range(len(indptr) - 1):
        for e in range(indptr[a], indptr[a + 1]):
            b = indices[e]
            k = following[b]  # rows ask for the entries of row b by rising a
            if k == indptr[b + 1] or indices[k] != a:
                return False
            transposed[e] = k
            following[b] = k + 1
    return True


@njit(cache=True)
def number(own, border, local):
    """Number the front's contacts in local (nc,): own ones first, then its border's."""
    for i in range(len(own)):
        local[own[i]] = i
    for j in range(len(border)):
        local[border[j]] = len(own) + j


@njit(cache=True)
def fill(own, border, local, indptr, indices, transposed, W, A, B, F11, F12, F21):
    """Write the blocks of A W + B with a row or a column in `own` and the other in `own` or `border` to the front's zeroed parts.

    local (nc,) is scratch that is -1 everywhere before and after."""
    n, d = len(own), A.shape[1]
    number(own, border, local)
    for i in range(n):
        a = own[i]
        for e in range(indptr[a], indptr[a + 1]):
            b = indices[e]
            j = local[b]
            if j < 0:
                continue
            if j < n:
                for q in range(d):
                    for p in range(d):
                        s = 0.0
                        for k in range(d):
                            s += A[a, p, k] * W[e, k, q]
                        F11[d * i + p, d * j + q] = s
                continue
            j -= n
            t = transposed[e]
            for q in range(d):
                for p in range(d):
                    s = 0.0
                    for k in range(d):
                        s += A[a, p, k] * W[e, k, q]
                    F12[d * i + p, d * j + q] = s
                    s = 0.0
                    for k in range(d):
                        s += A[b, p, k] * W[t, k, q]
                    F21[d * j + p, d * i + q] = s
        for q in range(d):
            for p in range(d):
                F11[d * i + p, d * i + q] += B[a, p, q]
    local[own] = -1
    local[border] = -1


@njit(cache=True)
def extend_add(S, place, n, d, F11, F12, F21, F22):
    """Add the complement S of a child to its parent; place[i] is the child's border contact i among the parent's own (< n) and border."""
    for j in range(len(place)):
        for q in range(d):
            column = d * j + q
            if place[j] < n:
                to = d * place[j] + q
                for i in range(len(place)):
                    for p in range(d):
                        if place[i] < n:
                            F11[d * place[i] + p, to] += S[d * i + p, column]
                        else:
                            F21[d * (place[i] - n) + p, to] += S[d * i + p, column]
            else:
                to = d * (place[j] - n) + q
                for i in range(len(place)):
                    for p in range(d):
                        if place[i] < n:
                            F12[d * place[i] + p, to] += S[d * i + p, column]
                        else:
                            F22[d * (place[i] - n) + p, to] += S[d * i + p, column]


@njit(cache=True)
def fill_lower(own, border, local, indptr, indices, W, F11, F21):
    """Write the blocks of a symmetric W with a column in `own` and a row in `own` or `border` to the front's zeroed parts.

    local (nc,) is scratch that is -1 everywhere before and after."""
    n, d = len(own), W.shape[1]
    number(own, border, local)
    for i in range(n):
        for e in range(indptr[own[i]], indptr[own[i] + 1]):
            j = local[indices[e]]
            if j < 0:
                continue
            for p in range(d):
                for q in range(d):
                    if j < n:
                        F11[d * j + q, d * i + p] = W[e, p, q]
                    else:
                        F21[d * (j - n) + q, d * i + p] = W[e, p, q]
    local[own] = -1
    local[border] = -1


@njit(cache=True)
def extend_add_lower(S, place, n, d, F11, F21, F22):
    """As `extend_add` for the lower triangle of a symmetric S; `place` rises, so it stays a lower triangle."""
    for j in range(len(place)):
        for q in range(d):
            column = d * j + q
            for i in range(j, len(place)):
                for p in range(d):
                    if place[i] < n:
                        F11[d * place[i] + p, d * place[j] + q] += S[d * i + p, column]
                    elif place[j] < n:
                        F21[d * (place[i] - n) + p, d * place[j] + q] += S[d * i + p, column]
                    else:
                        F22[d * (place[i] - n) + p, d * (place[j] - n) + q] += S[d * i + p, column]


@njit(cache=True)
def gather_blocks(indptr, indices, W, rows, place, out):
    """Write the blocks of W in the rows of contacts `rows` and the columns with place >= 0 to the zeroed dense `out`."""
    d = W.shape[1]
    for i in range(len(rows)):
        for e in range(indptr[rows[i]], indptr[rows[i] + 1]):
            j = place[indices[e]]
            if j >= 0:
                for p in range(d):
                    for q in range(d):
                        out[d * i + p, d * j + q] = W[e, p, q]
