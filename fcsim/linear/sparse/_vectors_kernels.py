"""Numbers of the bodies of one part in vectors of all degrees of freedom, compiled: each body's stand in a row, and lists of them take
several times as long."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def rows_of(first, x, out):
    """out (nb, n): row b is x[first[b]], x[first[b] + 1], ..."""
    for b in range(len(out)):
        begin = np.uint64(first[b])
        row = out[b]
        for j in range(out.shape[1]):
            row[j] = x[begin + np.uint64(j)]


@njit(cache=True, nogil=True)
def put_rows(first, rows, x):
    """The other way round: x from rows (nb, n)."""
    for b in range(len(rows)):
        begin = np.uint64(first[b])
        row = rows[b]
        for j in range(rows.shape[1]):
            x[begin + np.uint64(j)] = row[j]


@njit(cache=True, nogil=True)
def put_lumped(first, lumped, x, y):
    """y = m x on each body's degrees of freedom, lumped (n,): m."""
    for b in range(len(first)):
        begin = np.uint64(first[b])
        for j in range(len(lumped)):
            y[begin + np.uint64(j)] = lumped[j] * x[begin + np.uint64(j)]


@njit(cache=True, nogil=True)
def blended(first, x0, x1, share, out):
    """out (nb, n): share x1 + (1 - share) x0 of each body."""
    for b in range(len(out)):
        begin = np.uint64(first[b])
        row = out[b]
        for j in range(out.shape[1]):
            row[j] = share * x1[begin + np.uint64(j)] + (1 - share) * x0[begin + np.uint64(j)]


@njit(cache=True, nogil=True)
def weighted_sum(a, x, b, y):
    """a x + b y (n,) in one pass, as NumPy rounds it."""
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = a * x[i] + b * y[i]
    return out


@njit(cache=True, nogil=True)
def columns_of(first, some, x, out):
    """out (k, nb): x[first[b] + some[p]] at [p, b]; some (k,)."""
    for p in range(len(some)):
        row = out[p]
        for b in range(len(first)):
            row[b] = x[np.uint64(first[b] + some[p])]


@njit(cache=True, nogil=True)
def put_columns(first, some, columns, x):
    """The other way round: x from columns (k, nb)."""
    for p in range(len(some)):
        row = columns[p]
        for b in range(len(first)):
            x[np.uint64(first[b] + some[p])] = row[b]


@njit(cache=True, nogil=True)
def farthest(h, v, way, end, reference, begin):
    """The largest (3,) in size of h v - way, 0 where way (0,) is none, of the displacement reference + end - begin beside h v, and of h v;
    all others (n,)."""
    aside = off = far = 0.0
    for i in range(len(v)):
        straight = h * v[i]
        if len(way):
            aside = max(aside, abs(straight - way[i]))
        off = max(off, abs((reference[i] + end[i]) - begin[i] - straight))
        far = max(far, abs(straight))
    return np.array([aside, off, far])
