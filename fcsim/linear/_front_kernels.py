"""Compiled pieces of the multifrontal and condensed eliminations: fronts filled, complements added, blocks gathered, vectors solved for."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def number(own, border, local):
    """Number the front's contacts in local (nc,): own ones first, then its border's."""
    for i in range(len(own)):
        local[own[i]] = i
    for j in range(len(border)):
        local[border[j]] = len(own) + j


@njit(cache=True)
def write_row(a, first, last, indices, local, low, high, W, A, d, out, i):
    """Write A[a] W[e] for the entries e of row a with low <= local < high to the rows d i of out.

    In 3D the loops are written out, since the compiler cannot know that `out` is neither A nor W: half the time. A and W are flat."""
    if d == 3:
        k, to = 9 * a, 3 * i
        a0, a1, a2, a3, a4, a5, a6, a7, a8 = A[k], A[k + 1], A[k + 2], A[k + 3], A[k + 4], A[k + 5], A[k + 6], A[k + 7], A[k + 8]
        for e in range(first, last):
            j = local[indices[e]]
            if low <= j < high:
                w, j = 9 * e, 3 * (j - low)
                w0, w1, w2, w3, w4, w5, w6, w7, w8 = W[w], W[w + 1], W[w + 2], W[w + 3], W[w + 4], W[w + 5], W[w + 6], W[w + 7], W[w + 8]
                x0, x1, x2 = a0 * w0 + a1 * w3 + a2 * w6, a0 * w1 + a1 * w4 + a2 * w7, a0 * w2 + a1 * w5 + a2 * w8
                y0, y1, y2 = a3 * w0 + a4 * w3 + a5 * w6, a3 * w1 + a4 * w4 + a5 * w7, a3 * w2 + a4 * w5 + a5 * w8
                z0, z1, z2 = a6 * w0 + a7 * w3 + a8 * w6, a6 * w1 + a7 * w4 + a8 * w7, a6 * w2 + a7 * w5 + a8 * w8
                out[to, j], out[to, j + 1], out[to, j + 2] = x0, x1, x2
                out[to + 1, j], out[to + 1, j + 1], out[to + 1, j + 2] = y0, y1, y2
                out[to + 2, j], out[to + 2, j + 1], out[to + 2, j + 2] = z0, z1, z2
        return
    for e in range(first, last):
        j = local[indices[e]]
        if low <= j < high:
            for p in range(d):
                for q in range(d):
                    s = 0.0
                    for c in range(d):
                        s += A[d * d * a + d * p + c] * W[d * d * e + d * c + q]
                    out[d * i + p, d * (j - low) + q] = s


@njit(cache=True)
def fill(own, border, local, indptr, indices, W, A, B, d, F11, F12, F21):
    """Write the blocks of A W + B with a row or a column in `own` and the other in `own` or `border` to the front's zeroed parts.

    The parts are in C order, empty ones too as numba sees them. A, B, W are flat; local (nc,) is scratch that is -1 everywhere before
    and after."""
    n, none = len(own), np.int64(0)  # 0 alone is a type of its own to numba, for which `write_row` is compiled once more
    number(own, border, local)
    for i in range(n):
        a = own[i]
        write_row(a, indptr[a], indptr[a + 1], indices, local, none, n, W, A, d, F11, i)
        write_row(a, indptr[a], indptr[a + 1], indices, local, n, len(local), W, A, d, F12, i)
        for p in range(d):
            for q in range(d):
                F11[d * i + p, d * i + q] += B[d * d * a + d * p + q]
    for i in range(len(border)):
        a = border[i]
        write_row(a, indptr[a], indptr[a + 1], indices, local, none, n, W, A, d, F21, i)
    local[own] = -1
    local[border] = -1


@njit(cache=True)
def write_blocks(first, last, indices, local, low, high, W, out, i):
    """Write the blocks W (nnz, d, d) of the entries first, ..., last - 1 with low <= local < high to the rows d i of out."""
    d = W.shape[1]
    for e in range(first, last):
        j = local[indices[e]]
        if low <= j < high:
            for p in range(d):
                target, source = out[d * i + p, d * (j - low) : d * (j - low + 1)], W[e, p]
                for q in range(len(target)):
                    target[q] = source[q]


@njit(cache=True)
def fill_blocks(own, border, local, indptr, indices, W, F11, F12, F21):
    """As `fill` for the blocks of W (nnz, d, d) themselves."""
    n, none = len(own), np.int64(0)  # as in `fill`
    number(own, border, local)
    for i in range(n):
        a = own[i]
        write_blocks(indptr[a], indptr[a + 1], indices, local, none, n, W, F11, i)
        write_blocks(indptr[a], indptr[a + 1], indices, local, n, len(local), W, F12, i)
    for i in range(len(border)):
        a = border[i]
        write_blocks(indptr[a], indptr[a + 1], indices, local, none, n, W, F21, i)
    local[own] = -1
    local[border] = -1


@njit(cache=True)
def add_part(S, row, place, first, last, shift, d, out, to):
    """Add blocks first to last of a row of S to the blocks place - shift of a row of out."""
    if d == 3:
        for j in range(first, last):
            column = 3 * (place[j] - shift)
            out[to, column] += S[row, 3 * j]
            out[to, column + 1] += S[row, 3 * j + 1]
            out[to, column + 2] += S[row, 3 * j + 2]
        return
    j = first
    while j < last:  # runs of places one after the other, long enough for vectors
        end = j + 1
        while end < last and place[end] == place[end - 1] + 1:
            end += 1
        column = d * (place[j] - shift)
        target, source = out[to, column : column + d * (end - j)], S[row, d * j : d * end]
        for q in range(len(target)):
            target[q] += source[q]
        j = end


@njit(cache=True)
def extend_add(S, place, n, d, F11, F12, F21, F22):
    """Add the complement S of a child to its parent; place[i] is the child's border contact i among the parent's own (< n) and border.

    `place` rises."""
    inside = np.searchsorted(place, n)
    none = np.int64(0)  # 0 alone is a type of its own to numba, for which `add_part` is compiled once more
    for i in range(len(place)):
        for p in range(d):
            row = d * i + p
            if i < inside:
                to = d * place[i] + p
                add_part(S, row, place, none, inside, none, d, F11, to)
                add_part(S, row, place, inside, len(place), n, d, F12, to)
            else:
                to = d * (place[i] - n) + p
                add_part(S, row, place, none, inside, none, d, F21, to)
                add_part(S, row, place, inside, len(place), n, d, F22, to)


@njit(cache=True)
def fill_symmetric(own, border, local, indptr, indices, W, F11, F12):
    """Write the blocks of W with a row in `own` and a column in `own` or `border` to the front's zeroed parts, which are in C order.

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
                        F11[d * i + p, d * j + q] = W[e, p, q]
                    else:
                        F12[d * i + p, d * (j - n) + q] = W[e, p, q]
    local[own] = -1
    local[border] = -1


@njit(cache=True)
def extend_add_upper(S, place, n, d, F11, F12, F22):
    """As `extend_add` for the upper triangle of a symmetric S; `place` rises, so it stays an upper triangle."""
    for i in range(len(place)):
        for p in range(d):
            row = d * i + p
            for j in range(i, len(place)):
                for q in range(d):
                    if place[j] < n:
                        F11[d * place[i] + p, d * place[j] + q] += S[row, d * j + q]
                    elif place[i] < n:
                        F12[d * place[i] + p, d * (place[j] - n) + q] += S[row, d * j + q]
                    else:
                        F22[d * (place[i] - n) + p, d * (place[j] - n) + q] += S[row, d * j + q]


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


@njit(cache=True, nogil=True)
def border_matrix(G, outer, inner, dofs, d, begin, end, J):
    """The rows begin, ..., end - 1 of J = (outer G + inner) on the rows and columns `dofs`; outer and inner block diagonal, flat."""
    n, gathered, last = len(dofs), np.empty((d, len(dofs)), dtype=J.dtype), -1
    for u in range(begin, end):
        a, i = divmod(dofs[u], d)
        if a != last:  # once for all rows of a contact, in order, so that the sums below go through the compiler as vectors
            for j in range(d):
                response, chosen = G[d * a + j], gathered[j]
                for v in range(n):
                    chosen[v] = response[dofs[v]]
            last = a
        row = J[u]
        row[:] = 0
        for j in range(d):
            factor, chosen = outer[d * d * a + d * i + j], gathered[j]
            if factor != 0:
                for v in range(len(row)):
                    row[v] += factor * chosen[v]
        for v in range(max(0, u - d), min(n, u + d + 1)):  # dofs rises: those of the same contact are near
            if dofs[v] // d == a:
                row[v] += inner[d * d * a + d * i + dofs[v] % d]


@njit(cache=True, nogil=True)
def forward(values, sizes, borders, x):
    """Overwrite x with L^-1 x, L by fronts: one call for all, since one of BLAS and two of NumPy a front take longer than its numbers.

    values: front by front the columns of L11 (n entries each, those above the diagonal not used), then those of L21 (b entries each); sizes
    (fronts, 2): n and b; borders: of all fronts, the unknowns of L21's rows. Own unknowns are numbered in the fronts' order.
    """
    first, at, edge = 0, 0, 0
    below = np.empty(sizes[:, 1].max() if len(sizes) else 0, dtype=x.dtype)
    for f in range(len(sizes)):
        n, b = sizes[f]
        own, border, L21 = x[first : first + n], borders[edge : edge + b], at + n * n
        below[:b] = 0
        for j in range(n):
            column, beside = values[at + j * n : at + j * n + n], values[L21 + j * b : L21 + j * b + b]
            t = own[j] / column[j]
            own[j] = t
            for i in range(j + 1, n):
                own[i] -= column[i] * t
            for i in range(b):
                below[i] += beside[i] * t
        for i in range(b):
            x[border[i]] -= below[i]
        first, at, edge = first + n, L21 + n * b, edge + b


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})  # so that the compiler makes vectors of the sum's parts
def dot(a, b):
    """a . b in their precision."""
    total = a.dtype.type(0)
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@njit(cache=True, nogil=True)
def backward(values, sizes, borders, x):
    """Overwrite x with L^-T x, L as in `forward`."""
    first, at, edge = np.int64(0), np.int64(0), len(borders)
    for f in range(len(sizes)):
        first, at = first + sizes[f, 0], at + sizes[f, 0] * (sizes[f, 0] + sizes[f, 1])
    gathered = np.empty(sizes[:, 1].max() if len(sizes) else 0, dtype=x.dtype)
    for f in range(len(sizes) - 1, -1, -1):
        n, b = sizes[f]
        first, at, edge = first - n, at - n * (n + b), edge - b
        own, border, L21, above = x[first : first + n], borders[edge : edge + b], at + n * n, gathered[:b]
        for i in range(b):
            above[i] = x[border[i]]
        for j in range(n - 1, -1, -1):
            column, beside = values[at + j * n : at + j * n + n], values[L21 + j * b : L21 + j * b + b]
            own[j] = (own[j] - dot(column[j + 1 :], own[j + 1 :]) - dot(beside, above)) / column[j]


@njit(cache=True, nogil=True)
def times_blocks(blocks, cuts, which, x):
    """Overwrite x on the unknowns cuts[k], ..., cuts[k + 1] - 1 of each k in `which` by its block of `blocks`, one after the other by rows,
    times x there."""
    most = 0
    for k in which:
        most = max(most, cuts[k + 1] - cuts[k])
    image, at = np.empty(most, dtype=x.dtype), 0
    for k in which:
        n = cuts[k + 1] - cuts[k]
        own = x[cuts[k] : cuts[k + 1]]
        for i in range(n):
            image[i] = dot(blocks[at + i * n : at + (i + 1) * n], own)
        for i in range(n):
            own[i] = image[i]
        at += n * n


@njit(cache=True, nogil=True)
def solve_by_fronts(values, sizes, pivots, borders, x):
    """Overwrite x with (A W + B)^-1 x, by the fronts of `fronts.Multifrontal`: one call for all, as in `forward`.

    values: front by front LU of F11^T by columns, with its pivots as SciPy counts them, then the rows of F21 F11^-1 and those of F12.
    """
    first, at, edge = 0, 0, 0
    for f in range(len(sizes)):
        n, b = sizes[f]
        own, border, F21 = x[first : first + n], borders[edge : edge + b], at + n * n
        for i in range(b):
            x[border[i]] -= dot(values[F21 + i * n : F21 + (i + 1) * n], own)
        first, at, edge = first + n, at + n * (n + 2 * b), edge + b
    above = np.empty(sizes[:, 1].max() if len(sizes) else 0, dtype=x.dtype)
    for f in range(len(sizes) - 1, -1, -1):
        n, b = sizes[f]
        first, at, edge = first - n, at - n * (n + 2 * b), edge - b
        own, border, F12 = x[first : first + n], borders[edge : edge + b], at + n * (n + b)
        for i in range(b):
            above[i] = x[border[i]]
        for i in range(n):  # F11 = U^T L^T P^T: row i of what is stored is column i of LU
            row = values[at + i * n : at + (i + 1) * n]
            own[i] = (own[i] - dot(values[F12 + i * b : F12 + (i + 1) * b], above[:b]) - dot(row[:i], own[:i])) / row[i]
        for i in range(n - 1, -1, -1):
            own[i] -= dot(values[at + i * n + i + 1 : at + (i + 1) * n], own[i + 1 :])
        for i in range(n - 1, -1, -1):
            other = pivots[first + i]
            own[i], own[other] = own[other], own[i]
