"""What contacts touch of the bodies' velocities, their own equations, and adding their shares h^T K h to a matrix of those; compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def contacts_eliminated(A, B, shift, rhs):
    """K = C^-1 A (nc, d, d) and c = C^-1 rhs (nc, d) with C = A diag(shift) + B of each contact, by elimination of [C, A, rhs] with row
    pivoting.

    Returns (K, c, the first contact whose C is singular or -1); A, B (nc, d, d), shift and rhs (nc, d).
    """
    nc, d = rhs.shape
    K, c, rows = np.empty((nc, d, d)), np.empty((nc, d)), np.empty((d, 2 * d + 1))
    for a in range(nc):
        for i in range(d):
            for j in range(d):
                rows[i, j] = A[a, i, j] * shift[a, j] + B[a, i, j]
                rows[i, d + j] = A[a, i, j]
            rows[i, 2 * d] = rhs[a, i]
        for k in range(d):
            pivot = k
            for i in range(k + 1, d):
                if abs(rows[i, k]) > abs(rows[pivot, k]):
                    pivot = i
            if rows[pivot, k] == 0.0:
                return K, c, a
            if pivot != k:
                for j in range(k, 2 * d + 1):
                    rows[k, j], rows[pivot, j] = rows[pivot, j], rows[k, j]
            for i in range(k + 1, d):
                factor = rows[i, k] / rows[k, k]
                if factor != 0.0:
                    for j in range(k + 1, 2 * d + 1):
                        rows[i, j] -= factor * rows[k, j]
        for j in range(d, 2 * d + 1):
            for i in range(d - 1, -1, -1):
                total = rows[i, j]
                for l in range(i + 1, d):
                    total -= rows[i, l] * rows[l, j]
                rows[i, j] = total / rows[i, i]
        for i in range(d):
            for j in range(d):
                K[a, i, j] = rows[i, d + j]
            c[a, i] = rows[i, 2 * d]
    return K, c, -1


@njit(cache=True)
def _closed(K, a):
    """Whether the contact a has a share: its K (d, d) is not zero."""
    closed = False
    for i in range(K.shape[1]):
        for j in range(K.shape[2]):
            closed = closed or K[a, i, j] != 0.0
    return closed


@njit(cache=True)
def _times(K, h, a, Kh):
    """Kh (d, k) = K_a h_a, row by row, so that the compiler makes vectors."""
    _, d, k = h.shape
    for i in range(d):
        f = K[a, i, 0]
        for j in range(k):
            Kh[i, j] = f * h[a, 0, j]
        for l in range(1, d):
            f = K[a, i, l]
            for j in range(k):
                Kh[i, j] += f * h[a, l, j]


@njit(cache=True)
def _row_of_share(h, a, i, Kh, share):
    """share (k,): row i of h_a^T K_a h_a."""
    _, d, k = h.shape
    f = h[a, 0, i]
    for j in range(k):
        share[j] = f * Kh[0, j]
    for l in range(1, d):
        f = h[a, l, i]
        for j in range(k):
            share[j] += f * Kh[l, j]


@njit(cache=True)
def add_shares(S, unknowns, h, K):
    """Add h_a^T K_a h_a of every contact to S (n, n): h (nc, d, k) on the unknowns (nc, k), -1 where a contact has fewer; K (nc, d, d)."""
    nc, d, k = h.shape
    Kh, share = np.empty((d, k)), np.empty(k)
    for a in range(nc):
        if not _closed(K, a):
            continue
        _times(K, h, a, Kh)
        count = 0
        while count < k and unknowns[a, count] >= 0:
            count += 1
        for i in range(count):
            _row_of_share(h, a, i, Kh, share)
            out, to = S[unknowns[a, i]], unknowns[a]
            for j in range(count):
                out[np.uint64(to[j])] += share[j]  # without a sign: no index counts from the end


@njit(cache=True)
def places(indptr, indices, unknowns):
    """Where the pattern (sorted rows) stores the pairs (nc, k, k) of each contact's unknowns (nc, k); -1 for absent ones."""
    nc, k = unknowns.shape
    found = np.full((nc, k, k), -1)
    for a in range(nc):
        for i in range(k):
            row = unknowns[a, i]
            if row < 0:
                break
            columns, at = indices[indptr[row] : indptr[row + 1]], -1
            for j in range(k):
                if unknowns[a, j] < 0:
                    break
                at += 1  # a body's unknowns stand one after the other
                if at == len(columns) or columns[at] != unknowns[a, j]:
                    at = np.searchsorted(columns, unknowns[a, j])
                found[a, i, j] = indptr[row] + at
    return found


@njit(cache=True)
def _as_before(places, a):
    """Whether contact a > 0 has the unknowns of contact a - 1, as the points of one face do: those of its first row say it."""
    same = True
    for j in range(places.shape[2]):
        same = same and places[a, 0, j] == places[a - 1, 0, j]
    return same


@njit(cache=True, fastmath={"contract"})
def add_shares_to_rows(values, places, h, K):
    """As `add_shares` to a sparse matrix whose `values` have these places (nc, k, k); contacts that are open (K = 0) are passed over.
    Contacts that follow one another and have the same unknowns are summed first."""
    nc, d, k = h.shape
    Kh, shares, waiting = np.empty((3, k)), np.zeros((k, k)), -1
    for a in range(nc + 1):
        if waiting >= 0 and (a == nc or not _as_before(places, a)):
            for i in range(k):
                if places[waiting, i, 0] < 0:
                    break
                for j in range(k):
                    if places[waiting, i, j] < 0:
                        break
                    values[np.uint64(places[waiting, i, j])] += shares[i, j]
            shares[:] = 0.0
            waiting = -1
        if a == nc or (K[a, 0, 0] == 0.0 and not _closed(K, a)):
            continue
        waiting = a
        if d == 3:
            for i in range(3):
                f0, f1, f2 = K[a, i, 0], K[a, i, 1], K[a, i, 2]
                for j in range(k):
                    Kh[i, j] = f0 * h[a, 0, j] + f1 * h[a, 1, j] + f2 * h[a, 2, j]
            for i in range(k):
                f0, f1, f2 = h[a, 0, i], h[a, 1, i], h[a, 2, i]
                for j in range(k):
                    shares[i, j] += f0 * Kh[0, j] + f1 * Kh[1, j] + f2 * Kh[2, j]
            continue
        for i in range(2):
            f0, f1 = K[a, i, 0], K[a, i, 1]
            for j in range(k):
                Kh[i, j] = f0 * h[a, 0, j] + f1 * h[a, 1, j]
        for i in range(k):
            f0, f1 = h[a, 0, i], h[a, 1, i]
            for j in range(k):
                shares[i, j] += f0 * Kh[0, j] + f1 * Kh[1, j]


@njit(cache=True)
def by_contacts(starts, columns, values, d, n):
    """H^T (m, n) by contacts: the unknowns (nc, k) that each touches, in rising order and filled up with -1, and h (nc, d, k) on them."""
    nc = (len(starts) - 1) // d
    seen, largest = np.full(n, -1), 0
    for a in range(nc):
        count = 0
        for e in range(starts[d * a], starts[d * (a + 1)]):
            if seen[columns[e]] != a:
                seen[columns[e]] = a
                count += 1
        largest = max(largest, count)
    unknowns, h = np.full((nc, largest), -1), np.zeros((nc, d, largest))
    place = np.empty(n, dtype=np.int64)
    seen[:] = -1
    for a in range(nc):
        count = 0
        for e in range(starts[d * a], starts[d * (a + 1)]):
            if seen[columns[e]] != a:
                seen[columns[e]] = a
                unknowns[a, count] = columns[e]
                count += 1
        unknowns[a, :count].sort()
        for j in range(count):
            place[unknowns[a, j]] = j
        for i in range(d):
            for e in range(starts[d * a + i], starts[d * a + i + 1]):
                h[a, i, place[columns[e]]] += values[e]
    return unknowns, h


@njit(cache=True)
def graph_of(unknowns, starts, columns, values, n):
    """Sorted rows (n + 1,), columns and values of M, given by rows (`starts`, `columns`, `values`), in the pattern of M + H K H^T and I.

    unknowns (nc, k): those of each contact, -1 where it has fewer. Entries of M that are stored twice are added.
    """
    nc, k = unknowns.shape
    count = np.zeros(n + 1, dtype=np.int64)
    for a in range(nc):
        for j in range(k):
            if unknowns[a, j] < 0:
                break
            count[unknowns[a, j] + 1] += 1
    first = np.cumsum(count)
    contacts, following = np.empty(first[n], dtype=np.int64), first[:-1].copy()
    for a in range(nc):
        for j in range(k):
            if unknowns[a, j] < 0:
                break
            contacts[following[unknowns[a, j]]] = a
            following[unknowns[a, j]] += 1
    most = n + len(columns)
    for i in range(n):
        most += min(n, k * (first[i + 1] - first[i]))
    indptr, indices, mass = np.zeros(n + 1, dtype=np.int64), np.empty(most, dtype=np.int64), np.zeros(most)
    seen, end = np.full(n, -1), 0
    for i in range(n):
        begin = end
        seen[i], indices[end] = i, i
        end += 1
        for e in range(first[i], first[i + 1]):
            for j in range(k):
                b = unknowns[contacts[e], j]
                if b < 0:
                    break
                if seen[b] != i:
                    seen[b], indices[end] = i, b
                    end += 1
        for e in range(starts[i], starts[i + 1]):
            if seen[columns[e]] != i and values[e] != 0.0:
                seen[columns[e]], indices[end] = i, columns[e]
                end += 1
        row = indices[begin:end]
        row.sort()
        for e in range(starts[i], starts[i + 1]):
            if values[e] != 0.0:
                mass[begin + np.searchsorted(row, columns[e])] += values[e]
        indptr[i + 1] = end
    return indptr, indices[:end].copy(), mass[:end].copy()


@njit(cache=True)
def velocities_held(r, mu, sticking, d):
    """Velocities that contacts with reactions r (m,) hold: all of their own where they stick, the normal one where they slide.

    sticking: share of the cone's radius up to which a contact is said to stick.
    """
    held = 0
    for a in range(len(mu)):
        if r[d * a] > 0.0:
            square = 0.0
            for i in range(1, d):
                square += r[d * a + i] * r[d * a + i]
            held += d if np.sqrt(square) < sticking * mu[a] * r[d * a] else 1
    return held
