"""Solutions with the fronts of a matrix of single unknowns that all take part, as those of rigid bodies: 0.6 of the time of
`_lu_kernels.solve`, or 0.4 where most of the right side is zero. A path through a hundred changes of a matrix asks for as many.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"})
def solve_single(order, first, starts, rows, offsets, values, borders, pivots, rhs, x, buffer, out):
    """Into out (n,) or longer the solution of L U out = rhs: the fronts' arrays as `factorise_single` has and fills them;
    x, buffer (n,) are room.

    Long because it is both substitutions over the same fronts.
    """
    n, ns, at = len(order), len(first) - 1, 0
    for j in range(n):
        x[j] = rhs[order[j]]
    for s in range(ns):
        done, n1, r0 = first[s], first[s + 1] - first[s], starts[s]
        n2 = starts[s + 1] - r0
        part, some = x[done : done + n1], False
        for k in range(n1):
            some = some or part[k] != 0.0
        if not some:
            at += n1 * n2
            continue
        own = values[offsets[s] : offsets[s] + n1 * (n1 + n2)].reshape(n1, n1 + n2)
        for k in range(n1):
            p = pivots[done + k]
            part[k], part[p] = part[p], part[k]
        for k in range(1, n1):
            total, row = 0.0, own[k]
            for j in range(k):
                total += row[j] * part[j]
            part[k] -= total
        rest, k = buffer[:n2], 0
        rest[:] = 0.0
        while k + 4 <= n1:
            a, b, c, e = borders[at : at + n2], borders[at + n2 : at + 2 * n2], borders[at + 2 * n2 : at + 3 * n2], borders[at + 3 * n2 :]
            fa, fb, fc, fe = part[k], part[k + 1], part[k + 2], part[k + 3]
            for i in range(n2):
                rest[i] += a[i] * fa + b[i] * fb + c[i] * fc + e[i] * fe
            at += 4 * n2
            k += 4
        while k < n1:
            a, fa = borders[at : at + n2], part[k]
            for i in range(n2):
                rest[i] += a[i] * fa
            at += n2
            k += 1
        for i in range(n2):
            x[np.uint64(rows[r0 + i])] -= rest[i]  # without a sign: no index counts from the end
    for s in range(ns - 1, -1, -1):
        done, n1, r0 = first[s], first[s + 1] - first[s], starts[s]
        n2 = starts[s + 1] - r0
        n12 = n1 + n2
        own, part, rest = values[offsets[s] : offsets[s] + n1 * n12].reshape(n1, n12), x[done : done + n1], buffer[:n2]
        for i in range(n2):
            rest[i] = x[np.uint64(rows[r0 + i])]
        k = 0
        while k + 3 <= n1:  # three rows at a time: their sums, and what no vector takes, do not wait for each other
            a, b, c, ta, tb, tc = own[k, n1:], own[k + 1, n1:], own[k + 2, n1:], 0.0, 0.0, 0.0
            for i in range(n2):
                ta += a[i] * rest[i]
                tb += b[i] * rest[i]
                tc += c[i] * rest[i]
            part[k] -= ta
            part[k + 1] -= tb
            part[k + 2] -= tc
            k += 3
        while k < n1:
            a, ta = own[k, n1:], 0.0
            for i in range(n2):
                ta += a[i] * rest[i]
            part[k] -= ta
            k += 1
        for k in range(n1 - 1, -1, -1):
            f = part[k] / own[k, k]
            part[k] = f
            for j in range(k):
                part[j] -= own[j, k] * f
    for j in range(n):
        out[order[j]] = x[j]
