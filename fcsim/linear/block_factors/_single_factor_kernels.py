"""The multifrontal LU of a matrix of single unknowns that all take part and whose pattern stays, as that of rigid bodies in Newton's
iterations: `_lu_kernels.factorise` in half of the time and less.

Where each entry and each child's complement goes is planned once. Rows are exchanged among a front's own alone, so that its own rows are
eliminated by their whole length first, what is below them column by column after that: all inner loops run over whole rows of memory. The
columns below are left as `_single_kernels.solve_single` reads them.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.linear._elimination_tree_kernels import places_of
from fcsim.linear.block_factors._lu_kernels import BY_BLAS, pivoted


@njit(cache=True, nogil=True)
def planned(indptr, indices, mirror, order, first, starts, rows):
    """(begins (2 fronts + 1,), to, of, children (fronts,), run_begins (fronts + 1,), runs (., 3), room) of the fronts of a pattern.

    Entry `of` of the matrix stands at place `to` of a front's own rows (n1, n1 + n2) for e from begins[2 s] to begins[2 s + 1], of its
    columns below (n1, n2) from there to begins[2 s + 2]. children: complements that a front takes; runs of one's rows: where they begin in
    it, in the front that takes it, and their length, which never goes beyond that front's own; room: of all that wait at a time.
    """
    n, ns = len(order), len(first) - 1
    place, front = places_of(order), np.empty(n, dtype=np.int64)
    for s in range(ns):
        front[first[s] : first[s + 1]] = s
    begins, to, of = np.zeros(2 * ns + 1, dtype=np.int64), np.empty(len(indices), np.int64), np.empty(len(indices), np.int64)
    children, run_begins, runs = np.zeros(ns, np.int64), np.zeros(ns + 1, np.int64), np.empty((len(rows), 3), np.int64)
    local, waiting = np.full(n, -1), np.empty(ns, dtype=np.int64)
    count = top = room = put = run = 0
    for s in range(ns):
        c0, c1, below = first[s], first[s + 1], rows[starts[s] : starts[s + 1]]
        n1, n2 = c1 - c0, len(below)
        for i in range(n1):
            local[c0 + i] = i
        for i in range(n2):
            local[below[i]] = n1 + i
        for part in range(2):
            for j in range(c0, c1):
                for e in range(indptr[order[j]], indptr[order[j] + 1]):
                    i = place[indices[e]]
                    if i < c0 or (part == 1 and i < c1):
                        continue
                    to[put] = local[j] * (n1 + n2) + local[i] if part == 0 else local[j] * n2 + local[i] - n1
                    of[put] = e if part == 0 else mirror[e]
                    put += 1
            begins[2 * s + part + 1] = put
        room = max(room, top + n2 * n2)
        while count > 0 and front[rows[starts[waiting[count - 1]]]] == s:
            count -= 1
            children[s] += 1
            top -= (starts[waiting[count] + 1] - starts[waiting[count]]) ** 2
        parent_end = first[front[below[0]] + 1] if n2 > 0 else 0
        parent_rows = rows[starts[front[below[0]]] : starts[front[below[0]] + 1]] if n2 > 0 else rows[:0]
        last, last_place = -2, -2
        for i in range(n2):
            inside = below[i] < parent_end
            at = below[i] - first[front[below[0]]] if inside else np.searchsorted(parent_rows, below[i])
            now = at if inside else parent_end - first[front[below[0]]] + at
            if now != last + 1 or (not inside and last_place < parent_end):
                runs[run, 0], runs[run, 1], runs[run, 2] = i, now, 0
                run += 1
            runs[run - 1, 2] += 1
            last, last_place = now, below[i]
        run_begins[s + 1] = run
        if n2 > 0:
            waiting[count] = s
            count += 1
            top += n2 * n2
    return begins, to[:put].copy(), of[:put].copy(), children, run_begins, runs[:run].copy(), room


@njit(cache=True, nogil=True, fastmath={"contract"})
def eliminate_own(own, below, rest, pivots):
    """LU in place of a front whose own rows are own (n1, n1 + n2), whose columns below these are below (n1, n2), and rest (n2, n2) less
    their products; False: singular. Own row k is exchanged with row pivots[k] >= k.

    Long because it has its loops written out, for two and four rows at a time: these are loaded and stored less often.
    """
    n1, n2 = below.shape
    for k in range(n1):
        if not pivoted(own, n1, k, pivots):
            return False
        scale, row = 1.0 / own[k, k], own[k, k + 1 :]
        for i in range(k + 1, n1):
            f = own[i, k] * scale
            own[i, k] = f
            if f != 0.0:
                out = own[i, k + 1 :]
                for j in range(len(row)):  # from 0 on, so that the compiler makes vectors
                    out[j] -= f * row[j]
    if n2 == 0:
        return True
    for k in range(n1):
        out, j = below[k], 0
        while j + 4 <= k:
            a, b, c, e = below[j], below[j + 1], below[j + 2], below[j + 3]
            fa, fb, fc, fe = own[j, k], own[j + 1, k], own[j + 2, k], own[j + 3, k]
            for i in range(n2):
                out[i] -= fa * a[i] + fb * b[i] + fc * c[i] + fe * e[i]
            j += 4
        while j < k:
            a, fa = below[j], own[j, k]
            for i in range(n2):
                out[i] -= fa * a[i]
            j += 1
        scale = 1.0 / own[k, k]
        for i in range(n2):
            out[i] *= scale
    if n1 * n2 * n2 > BY_BLAS:
        product = np.dot(below.T.copy(), own[:, n1:].copy())
        for i in range(n2):
            out, part = rest[i], product[i]
            for j in range(n2):
                out[j] -= part[j]
        return True
    i = 0
    while i < n2:
        two = i + 1 < n2
        out, second = rest[i], rest[i + 1 if two else i]
        k = 0
        while k + 4 <= n1:
            a, b, c, e = own[k, n1:], own[k + 1, n1:], own[k + 2, n1:], own[k + 3, n1:]
            fa, fb, fc, fe = below[k, i], below[k + 1, i], below[k + 2, i], below[k + 3, i]
            if two:
                ga, gb, gc, ge = below[k, i + 1], below[k + 1, i + 1], below[k + 2, i + 1], below[k + 3, i + 1]
                for j in range(n2):
                    out[j] -= fa * a[j] + fb * b[j] + fc * c[j] + fe * e[j]
                    second[j] -= ga * a[j] + gb * b[j] + gc * c[j] + ge * e[j]
            else:
                for j in range(n2):
                    out[j] -= fa * a[j] + fb * b[j] + fc * c[j] + fe * e[j]
            k += 4
        while k < n1:
            a, fa = own[k, n1:], below[k, i]
            for j in range(n2):
                out[j] -= fa * a[j]
            if two:
                ga = below[k, i + 1]
                for j in range(n2):
                    second[j] -= ga * a[j]
            k += 1
        i += 2
    return True


@njit(cache=True, nogil=True)
def take_complement(V, runs, n1, own, below, rest):
    """Add a child's complement V (b, b) to the front that takes it: its own rows (n1, n1 + n2), columns below (n1, n2) and rest."""
    for g in range(len(runs)):
        i0, ti, rows = runs[g]
        for i in range(rows):
            row = V[i0 + i]
            for l in range(len(runs)):
                j0, tj, columns = runs[l]
                part = row[j0 : j0 + columns]
                if ti < n1:
                    out = own[ti + i, tj : tj + columns]
                    for j in range(columns):
                        out[j] += part[j]
                elif tj >= n1:
                    out = rest[ti - n1 + i, tj - n1 : tj - n1 + columns]
                    for j in range(columns):
                        out[j] += part[j]
                else:
                    for j in range(columns):
                        below[tj + j, ti - n1 + i] += part[j]


@njit(cache=True, nogil=True)
def factorise_single(plan, first, starts, offsets, entries, values, borders, pivots):
    """Fill `values` with the fronts' own rows, factored, `borders` with their columns below and `pivots` with the exchanges, as
    `solve_single` reads them, for the matrix of these entries; False where a front is singular. plan: `planned`."""
    begins, to, of, children, run_begins, runs, room = plan
    ns = len(first) - 1
    stack, waiting, begin = np.empty(room), np.empty(ns, dtype=np.int64), np.empty(ns, dtype=np.int64)
    count = top = at = 0
    for s in range(ns):
        n1, n2 = first[s + 1] - first[s], starts[s + 1] - starts[s]
        own_rows, columns = values[offsets[s] : offsets[s] + n1 * (n1 + n2)], borders[at : at + n1 * n2]
        complement = stack[top : top + n2 * n2]
        own_rows[:] = 0.0
        columns[:] = 0.0
        complement[:] = 0.0
        for e in range(begins[2 * s], begins[2 * s + 1]):
            own_rows[np.uint64(to[e])] = entries[np.uint64(of[e])]  # without a sign: no index counts from the end
        for e in range(begins[2 * s + 1], begins[2 * s + 2]):
            columns[np.uint64(to[e])] = entries[np.uint64(of[e])]
        own, below, rest = own_rows.reshape(n1, n1 + n2), columns.reshape(n1, n2), complement.reshape(n2, n2)
        base = top
        for _ in range(children[s]):
            count -= 1
            child, base = waiting[count], begin[count]
            size = starts[child + 1] - starts[child]
            V = stack[base : base + size * size].reshape(size, size)
            take_complement(V, runs[run_begins[child] : run_begins[child + 1]], n1, own, below, rest)
        if not eliminate_own(own, below, rest, pivots[first[s] : first[s + 1]]):
            return False
        at += n1 * n2
        if n2 > 0:
            if base < top:
                for i in range(n2 * n2):  # down over the children's complements
                    stack[base + i] = stack[top + i]
            waiting[count], begin[count] = s, base
            count += 1
        top = base + n2 * n2
    return True


@njit(cache=True, nogil=True)
def sign_single(first, starts, offsets, values, pivots):
    """Of the determinant: that of the pivots' product, turned by each exchange of rows."""
    found = 1
    for s in range(len(first) - 1):
        n1 = first[s + 1] - first[s]
        n = n1 + starts[s + 1] - starts[s]
        for k in range(n1):
            if values[offsets[s] + k * n + k] < 0:
                found = -found
            if pivots[first[s] + k] != k:
                found = -found
    return found
