"""Loops over the entries of sparse matrices, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def transposed_times_rows(indptr, indices, data, x, size):
    """A^T x (size,) of A (n, size) by rows for x (n,)."""
    y = np.zeros(size)
    for i in range(len(indptr) - 1):
        for k in range(indptr[i], indptr[i + 1]):
            y[indices[k]] += data[k] * x[i]
    return y


@njit(cache=True)
def transposed_times_columns(indptr, indices, data, x):
    """A^T x (m,) of A (n, m) by columns for x (n,); three columns of one length at a time, a contact's, so that no sum waits for itself."""
    m = len(indptr) - 1
    y, j = np.empty(m), 0
    while j < m:
        a = indptr[j]
        n = indptr[j + 1] - a
        if j + 2 < m and indptr[j + 2] - a == 2 * n and indptr[j + 3] - a == 3 * n:
            r, s, t = 0.0, 0.0, 0.0
            for k in range(a, a + n):
                e, f, g = np.uint64(k), np.uint64(k + n), np.uint64(k + 2 * n)
                r += data[e] * x[np.uint64(indices[e])]
                s += data[f] * x[np.uint64(indices[f])]
                t += data[g] * x[np.uint64(indices[g])]
            y[j], y[j + 1], y[j + 2] = r, s, t
            j += 3
            continue
        s = 0.0
        for k in range(a, a + n):
            s += data[k] * x[indices[k]]
        y[j] = s
        j += 1
    return y


@njit(cache=True)
def times_columns(indptr, indices, data, x, size):
    """A x (size,) of A (size, m) by columns for x (m,); three columns with entries in the same rows, a contact's, go through them once."""
    m = len(indptr) - 1
    y, j = np.zeros(size), 0
    while j < m:
        a = indptr[j]
        n = indptr[j + 1] - a
        alike = j + 2 < m and indptr[j + 2] - a == 2 * n and indptr[j + 3] - a == 3 * n
        k = a
        while alike and k < a + n:
            alike = indices[k] == indices[k + n] and indices[k] == indices[k + 2 * n]
            k += 1
        if alike:
            r, s, t = x[j], x[j + 1], x[j + 2]
            for k in range(a, a + n):
                e, i = np.uint64(k), np.uint64(indices[k])
                y[i] = ((y[i] + data[e] * r) + data[np.uint64(k + n)] * s) + data[np.uint64(k + 2 * n)] * t
            j += 3
            continue
        for k in range(a, a + n):
            y[indices[k]] += data[k] * x[j]
        j += 1
    return y


@njit(cache=True)
def columns_between(indptr, indices, first, last):
    """Which columns of A (n, m), whose rows ascend, have rows among first, ..., last - 1: j where these are all of its rows, and of the two
    columns after it, which are left out; else -j - 1."""
    m, j, count = len(indptr) - 1, 0, 0
    found = np.empty(m, dtype=np.int64)
    while j < m:
        a = indptr[j]
        n = indptr[j + 1] - a
        if n == 0 or indices[a] >= last or indices[a + n - 1] < first:
            j += 1
            continue
        within = first <= indices[a] and indices[a + n - 1] < last
        alike = within and j + 2 < m and indptr[j + 2] - a == 2 * n and indptr[j + 3] - a == 3 * n
        k = a
        while alike and k < a + n:
            alike = indices[k] == indices[k + n] and indices[k] == indices[k + 2 * n]
            k += 1
        found[count] = j if alike else -j - 1
        count += 1
        j += 3 if alike else 1
    return found[:count].copy()


@njit(cache=True)
def times_columns_between(which, indptr, indices, data, x, first, last, y):
    """Add to y (n,) the rows first, ..., last - 1 of A x of A (n, m) by columns for x (m,), in the order of `times_columns`; which: the
    columns as `columns_between` has them."""
    for j in which:
        if j >= 0:
            a = indptr[j]
            n = indptr[j + 1] - a
            r, s, t = x[j], x[j + 1], x[j + 2]
            for k in range(a, a + n):
                e, i = np.uint64(k), np.uint64(indices[k])
                y[i] = ((y[i] + data[e] * r) + data[np.uint64(k + n)] * s) + data[np.uint64(k + 2 * n)] * t
            continue
        j = -j - 1
        for k in range(indptr[j], indptr[j + 1]):
            if first <= indices[k] < last:
                y[indices[k]] += data[k] * x[j]


@njit(cache=True)
def entries_kept(indptr, indices, ordered, place, moved):
    """How many entries of the columns of A (n, m) are in rows i with place[i] >= 0; ordered: whether rows ascend in each column; rows below
    `moved` are all kept."""
    count = 0
    for j in range(len(indptr) - 1):
        begin, end = indptr[j], indptr[j + 1]
        if ordered and (begin == end or indices[end - 1] < moved):
            count += end - begin
            continue
        for k in range(begin, end):
            count += place[np.uint64(indices[np.uint64(k)])] >= 0
    return count


@njit(cache=True)
def first_moved(place):
    """The first row that does not stay where it is."""
    moved = 0
    while moved < len(place) and place[moved] == moved:
        moved += 1
    return moved


@njit(cache=True)
def rows_kept(indptr, indices, data, ordered, place, moved, at, end, starts, rows, values):
    """Write some columns of A (n, m), to rows[at], ... and before rows[end], with its rows i at place[i], those with place[i] < 0 left
    out, one after the other; where they end: starts (m,). ordered: whether rows ascend in each column; rows below `moved` stay."""
    for j in range(len(indptr) - 1):
        begin, size = np.uint64(indptr[j]), indptr[j + 1] - indptr[j]
        if ordered and (size == 0 or indices[indptr[j + 1] - 1] < moved):
            for k in range(np.uint64(size)):
                rows[np.uint64(at) + k] = indices[begin + k]
            for k in range(np.uint64(size)):
                values[np.uint64(at) + k] = data[begin + k]
            at += size
            starts[j] = at
            continue
        for k in range(indptr[j], indptr[j + 1]):
            i, to = place[np.uint64(indices[np.uint64(k)])], np.uint64(at)
            if at < end:
                rows[to], values[to] = i, data[np.uint64(k)]  # written over by the next where this row is left out
            at += i >= 0
        starts[j] = at


@njit(cache=True)
def values_kept(indptr, indices, data, ordered, place, moved, starts, values):
    """Write the values of `rows_kept` where it is known where its columns begin and end, starts (m + 1,)."""
    for j in range(len(indptr) - 1):
        begin, end, at = indptr[j], indptr[j + 1], np.uint64(starts[j])
        if ordered and (begin == end or indices[end - 1] < moved):
            for k in range(np.uint64(end - begin)):
                values[at + k] = data[np.uint64(begin) + k]
            continue
        for k in range(begin, end):
            if place[np.uint64(indices[np.uint64(k)])] >= 0:
                values[at] = data[np.uint64(k)]
                at += np.uint64(1)


@njit(cache=True)
def squares_of_touched(indptr, indices, data, weight, some, step, count):
    """See `normals_of_some`, by columns."""
    whole, others, touched = np.zeros(count), np.zeros(count), np.zeros(count, dtype=np.bool_)
    for c in range(count):
        begin, end = indptr[c * step], indptr[c * step + 1]
        for k in range(begin, end):
            if some[indices[k]]:
                touched[c] = True
                break
        if touched[c]:
            for k in range(begin, end):
                square = weight[indices[k]] * data[k] ** 2
                whole[c] += square
                if not some[indices[k]]:
                    others[c] += square
    return whole, others, touched


@njit(cache=True)
def squares_of_touched_columns(indptr, indices, data, weight, some, step, count):
    """See `normals_of_some`, by rows: columns that `some` rows have no entry in, most of them, are passed over."""
    whole, others, touched = np.zeros(count), np.zeros(count), np.zeros((count + 1) * step, dtype=np.bool_)
    for i in range(len(indptr) - 1):
        if some[i]:
            for k in range(indptr[i], indptr[i + 1]):
                if indices[k] % step == 0:
                    touched[indices[k]] = True
    for i in range(len(indptr) - 1):
        for k in range(indptr[i], indptr[i + 1]):
            if touched[indices[k]]:
                square = weight[i] * data[k] ** 2
                whole[indices[k] // step] += square
                if not some[i]:
                    others[indices[k] // step] += square
    return whole, others, touched[: count * step : step].copy()


@njit(cache=True)
def entries_of_rows(indices, count):
    """How many entries each row (count,) has of a matrix by columns."""
    found = np.zeros(count, dtype=np.int32)
    for k in range(len(indices)):
        found[np.uint64(indices[np.uint64(k)])] += 1
    return found


@njit(cache=True)
def met_twice_beyond(indices, count, few):
    """Whether more than `few` of the rows (count,) of a matrix by columns have two entries or more."""
    met, twice = np.zeros(count, dtype=np.uint8), 0
    for k in range(len(indices)):
        i = np.uint64(indices[np.uint64(k)])
        if met[i] == 1:
            twice += 1
            if twice > few:
                return True
        if met[i] < 2:
            met[i] += 1
    return False
