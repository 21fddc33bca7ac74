"""Loops over the nodes of turning bodies, compiled by numba: see `frames`.

Bodies of one part have their nodes' components in consecutive dofs from first (nb,) on. Columns (n_part, ...) have one column a body.
Vectors of two components count as three with a zero; J^-1 (nb, 3, 3) maps those as well. axes: range(d) as a tuple, whose length the
compiler knows, so that loops over components are none.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.assembly.forms._rotation_kernels import inverse


@njit(cache=True)
def turned_back(axes, x, first, Q, free, columns, begin):
    """Q_b^T x of the nodes of body b into the column begin + b; x (n_dofs,), Q (nb, d, d). free (n_part,): only these components of x
    count, and have a row in `columns`."""
    d = len(axes)
    for b in range(len(first)):
        row = 0
        for k in range(0, len(free), d):
            for j in range(d):
                if not free[k + j]:
                    continue
                value = 0.0
                for i in range(d):
                    if free[k + i]:
                        value += Q[b, i, j] * x[first[b] + k + i]
                columns[row, begin + b] = value
                row += 1


@njit(cache=True)
def turned_forth(axes, columns, first, Q, free, x):
    """Q_b y of the columns y (nfree, nb), one a body, into the free components of x (n_dofs,)."""
    d = len(axes)
    own = np.zeros(d)
    for b in range(len(first)):
        row = 0
        for k in range(0, len(free), d):
            for j in range(d):
                own[j] = 0.0
                if free[k + j]:
                    own[j] = columns[row, b]
                    row += 1
            for i in range(d):
                if free[k + i]:
                    value = 0.0
                    for j in range(d):
                        value += Q[b, i, j] * own[j]
                    x[first[b] + k + i] = value


@njit(cache=True)
def block_product(indptr, indices, blocks, columns):
    """K X (n, k) of K by blocks (nblocks, d, d) of compressed rows and X (n, k)."""
    d, k = blocks.shape[1], columns.shape[1]
    product = np.empty((d * (len(indptr) - 1), k))
    first, second, third = np.empty(k), np.empty(k), np.empty(k)  # rows of their own: sums go through the compiler as vectors
    for i in range(len(indptr) - 1):
        first[:], second[:], third[:] = 0.0, 0.0, 0.0
        for e in range(indptr[i], indptr[i + 1]):
            j, B = d * indices[e], blocks[e]
            if d == 3:
                b00, b01, b02, b10, b11, b12 = B[0, 0], B[0, 1], B[0, 2], B[1, 0], B[1, 1], B[1, 2]
                b20, b21, b22 = B[2, 0], B[2, 1], B[2, 2]
                for c in range(k):
                    x, y, z = columns[j, c], columns[j + 1, c], columns[j + 2, c]
                    first[c] += b00 * x + b01 * y + b02 * z
                    second[c] += b10 * x + b11 * y + b12 * z
                    third[c] += b20 * x + b21 * y + b22 * z
            else:
                b00, b01, b10, b11 = B[0, 0], B[0, 1], B[1, 0], B[1, 1]
                for c in range(k):
                    x, y = columns[j, c], columns[j + 1, c]
                    first[c] += b00 * x + b01 * y
                    second[c] += b10 * x + b11 * y
        for c in range(k):
            product[d * i, c], product[d * i + 1, c] = first[c], second[c]
            if d == 3:
                product[3 * i + 2, c] = third[c]
    return product


@njit(cache=True)
def spread_arms(axes, x, first, weight, arm, p, spread):
    """p = x - c (nb, nn, d) at the displacements x (n_dofs,) and A = sum_i w_i p_i X_i^T (nb, d, d), zero before."""
    nb, nn, d = p.shape[0], p.shape[1], len(axes)
    centre, own = np.zeros(d), np.zeros((d, d))
    for b in range(nb):
        centre[:] = 0.0
        own[:] = 0.0
        for n in range(nn):
            for i in range(d):
                centre[i] += weight[n] * x[first[b] + d * n + i]
        for n in range(nn):
            for i in range(d):
                p[b, n, i] = arm[n, i] + (x[first[b] + d * n + i] - centre[i])
                for j in range(d):
                    own[i, j] += weight[n] * p[b, n, i] * arm[n, j]
        for i in range(d):
            for j in range(d):
                spread[b, i, j] = own[i, j]


@njit(cache=True)
def strained(axes, p, R, arm, y):
    """y = R^T p - X (nb, nn, d)."""
    nb, nn, d = p.shape[0], p.shape[1], len(axes)
    for b in range(nb):
        for n in range(nn):
            for j in range(d):
                value = -arm[n, j]
                for i in range(d):
                    value += p[b, n, i] * R[b, i, j]
                y[b, n, j] = value


@njit(cache=True)
def mean_strains(axes, y0, y1, share, columns):
    """share y_1 + (1 - share) y_0 of y (nb, nn, d) into the first nb columns."""
    nb, nn, d = y0.shape[0], y0.shape[1], len(axes)
    for b in range(nb):
        for n in range(nn):
            for j in range(d):
                columns[d * n + j, b] = share * y1[b, n, j] + (1 - share) * y0[b, n, j]


@njit(cache=True)
def add_strain_rates(axes, v, first, weight, arm, p0, p1, R, inverse, J_inverse, factor, columns):
    """factor D v added to the first nb columns; v (n_dofs,), weight (nn,), arm X (nn, d), p x - c at both ends (nb, nn, d), R and its
    inverse (nb, d, d) of the mean."""
    nb, nn, d = p0.shape[0], p0.shape[1], len(axes)
    centre, rate, q, m = np.zeros(d), np.zeros(3), np.zeros(3), np.zeros(3)
    for b in range(nb):
        centre[:] = 0.0
        for n in range(nn):
            for i in range(d):
                centre[i] += weight[n] * v[first[b] + d * n + i]
        m[:] = 0.0
        for n in range(nn):
            for j in range(d):
                rate[j] = 0.0
                for i in range(d):
                    rate[j] += (v[first[b] + d * n + i] - centre[i]) * R[b, i, j]
            a2 = arm[n, 2] if d == 3 else 0.0
            m[0] += weight[n] * (arm[n, 1] * rate[2] - a2 * rate[1])
            m[1] += weight[n] * (a2 * rate[0] - arm[n, 0] * rate[2])
            m[2] += weight[n] * (arm[n, 0] * rate[1] - arm[n, 1] * rate[0])
        phi = J_inverse[b] @ m
        for n in range(nn):
            for j in range(d):
                rate[j] = q[j] = 0.0
                for i in range(d):
                    rate[j] += (v[first[b] + d * n + i] - centre[i]) * R[b, i, j]
                    q[j] += inverse[b, j, i] * 0.5 * (p0[b, n, i] + p1[b, n, i])
            rate[0] -= phi[1] * q[2] - phi[2] * q[1]
            rate[1] -= phi[2] * q[0] - phi[0] * q[2]
            rate[2] -= phi[0] * q[1] - phi[1] * q[0]
            for j in range(d):
                columns[d * n + j, b] += factor * rate[j]


@njit(cache=True)
def mean_forces(axes, columns, first, weight, arm, p0, p1, R, inverse, J_inverse, factor, x):
    """factor D^T f of the first nb columns f into x (n_dofs,); the other arguments as in `add_strain_rates`."""
    nb, nn, d = p0.shape[0], p0.shape[1], len(axes)
    f, q, m = np.zeros(3), np.zeros(3), np.zeros(3)
    for b in range(nb):
        m[:] = 0.0
        for n in range(nn):
            for j in range(d):
                f[j], q[j] = columns[d * n + j, b], 0.0
                for i in range(d):
                    q[j] += inverse[b, j, i] * 0.5 * (p0[b, n, i] + p1[b, n, i])
            m[0] += q[1] * f[2] - q[2] * f[1]
            m[1] += q[2] * f[0] - q[0] * f[2]
            m[2] += q[0] * f[1] - q[1] * f[0]
        tau = J_inverse[b].T @ m
        for n in range(nn):
            a2 = arm[n, 2] if d == 3 else 0.0
            q[0] = weight[n] * (tau[1] * a2 - tau[2] * arm[n, 1])
            q[1] = weight[n] * (tau[2] * arm[n, 0] - tau[0] * a2)
            q[2] = weight[n] * (tau[0] * arm[n, 1] - tau[1] * arm[n, 0])
            for i in range(d):
                value = 0.0
                for j in range(d):
                    value += R[b, i, j] * (columns[d * n + j, b] - q[j])
                x[first[b] + d * n + i] = factor * value


@njit(cache=True)
def less_turned(axes, columns, begin, first, Q, factor, x):
    """factor Q_b y of the columns y from `begin` on taken from x (n_dofs,)."""
    d = len(axes)
    for b in range(len(first)):
        for k in range(0, len(columns), d):
            for i in range(d):
                value = 0.0
                for j in range(d):
                    value += Q[b, i, j] * columns[k + j, begin + b]
                x[first[b] + k + i] -= factor * value


@njit(cache=True, error_model="numpy")
def means(R0, R1, A0, A1):
    """R_ = (R_0 + R_1) / 2, R_^-1 (nb, d, d) and J^-1 (nb, 3, 3) of J = tr N I - N, N = R_^-1 A_; in 2D J^-1 is 1 / tr N about the third
    axis."""
    nb, d = R0.shape[:2]
    R, R_inverse, J_inverse = np.empty((nb, d, d)), np.empty((nb, d, d)), np.zeros((nb, 3, 3))
    J = np.empty((3, 3))
    for b in range(nb):
        for i in range(d):
            for j in range(d):
                R[b, i, j] = 0.5 * (R0[b, i, j] + R1[b, i, j])
        inverse(R[b], d, R_inverse[b])
        trace = 0.0
        for i in range(d):
            for j in range(d):
                N = 0.0
                for k in range(d):
                    N += R_inverse[b, i, k] * 0.5 * (A0[b, k, j] + A1[b, k, j])
                J[i, j] = -N
                trace += N if i == j else 0.0
        if d == 2:
            J_inverse[b, 2, 2] = 1 / trace
            continue
        for i in range(3):
            J[i, i] += trace
        inverse(J, d, J_inverse[b])
    return R, R_inverse, J_inverse


@njit(cache=True)
def columns_between(axes, first, weight, arm, ends, share, rate, less):
    """What K is multiplied by in `forces_between`, (nn d, nb), of a second term (nn d, 2 nb); and the three matrices of `means`."""
    R0, A0, p0, y0, R1, A1, p1, y1 = ends
    damping, v = rate
    twice, _, _, Q, x = less
    nb, nn, d = p0.shape[0], p0.shape[1], len(axes)
    mean = means(R0, R1, A0, A1)
    columns = np.empty((nn * d, 2 * nb if twice else nb))
    mean_strains(axes, y0, y1, share, columns)
    if damping != 0.0:
        add_strain_rates(axes, v, first, weight, arm, p0, p1, mean[0], mean[1], mean[2], damping, columns)
    if twice:
        turned_back(axes, x, first, Q, np.ones(nn * d, dtype=np.bool_), columns, nb)
    return columns, mean


@njit(cache=True)
def forces_of(axes, products, mean, first, weight, arm, ends, less, into):
    """The forces of `forces_between` from K times its columns."""
    twice, w, s, Q, _ = less
    mean_forces(axes, products, first, weight, arm, ends[2], ends[6], mean[0], mean[1], mean[2], w, into)
    if twice:
        less_turned(axes, products, len(first), first, Q, s, into)


@njit(cache=True)
def forces_between(axes, first, weight, arm, ends, share, rate, K, less, into):
    """w D^T K (share y_1 + (1 - share) y_0 + damping D v) - s T K T^T x of each body into a vector (n_dofs,); K is read once.

    ends: R, A, p, y at both; rate: damping and v (n_dofs,), damping 0: none; K: indptr, indices and blocks of its rows; less: whether
    there is a second term, and w, s, Q (nb, d, d) and x (n_dofs,) of it.
    """
    columns, mean = columns_between(axes, first, weight, arm, ends, share, rate, less)
    forces_of(axes, block_product(K[0], K[1], K[2], columns), mean, first, weight, arm, ends, less, into)
