"""Loops over contacts, compiled by numba, behind `fcsim.problem.judge`: error, checks, diagonal blocks; d components a contact."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.problem._cone_kernels import natural_map

ROUGH = 10.0
"""Friction coefficient with which a contact's penetration counts at most: the natural map sees it divided by sqrt(1 + mu^2)."""


@njit(cache=True)
def _square(r0, r1, r2, u0, u1, u2, m, s, rough):
    """The part of `squared_natural_residual` of a contact with friction m and compliance s."""
    f0 = u0 + m * np.sqrt(u1 * u1 + u2 * u2)
    x, y, z = natural_map(s * r0, s * r1, s * r2, f0, u1, u2, m)
    part = x * x + y * y + z * z
    if rough and u0 < 0.0:
        least = min(m, ROUGH)
        part = np.maximum(part, u0 * u0 / (1.0 + least * least))  # np.maximum hands NaN on
    return part


@njit(cache=True)
def squared_natural_residual(r, u, mu, compliance, d, rough=True):
    """||s r - P_K(s r - (u + g(u)))||^2 with s the compliance (nc,); if rough, each contact at least as `ROUGH` says: see
    `natural_map_residual`."""
    total = 0.0
    for a in range(len(mu)):
        i = d * a
        r2, u2 = r[i + 2] if d == 3 else 0.0, u[i + 2] if d == 3 else 0.0
        total += _square(r[i], r[i + 1], r2, u[i], u[i + 1], u2, mu[a], compliance[a], rough)
    return total


@njit(cache=True)
def violations(r, u, q, mu, d):
    """Largest violations of K by r, of K* by u + g(u) and of u_N >= 0 (none negative), r.(u + g(u)); max and norm of r, and of u or q.

    Of u and q the larger counts, for max and norm each.
    """
    cone = dual_cone = penetration = product = r_max = u_max = r_square = u_square = q_square = 0.0
    for a in range(len(mu)):
        i, m = d * a, mu[a]
        r0, r1, r2 = r[i], r[i + 1], r[i + 2] if d == 3 else 0.0
        u0, u1, u2 = u[i], u[i + 1], u[i + 2] if d == 3 else 0.0
        q0, q1, q2 = q[i], q[i + 1], q[i + 2] if d == 3 else 0.0
        sliding = m * np.sqrt(u1 * u1 + u2 * u2)
        modified = u0 + sliding
        cone = np.maximum(cone, np.sqrt(r1 * r1 + r2 * r2) - m * r0)  # np.maximum hands NaN on
        dual_cone = np.maximum(dual_cone, sliding - modified)
        penetration = np.maximum(penetration, -u0)
        product += r0 * modified + r1 * u1 + r2 * u2
        r_max = np.maximum(r_max, np.maximum(abs(r0), np.maximum(abs(r1), abs(r2))))
        u_max = np.maximum(u_max, np.maximum(abs(u0), np.maximum(abs(u1), abs(u2))))
        u_max = np.maximum(u_max, np.maximum(abs(q0), np.maximum(abs(q1), abs(q2))))
        r_square += r0 * r0 + r1 * r1 + r2 * r2
        u_square += u0 * u0 + u1 * u1 + u2 * u2
        q_square += q0 * q0 + q1 * q1 + q2 * q2
    return cone, dual_cone, penetration, product, r_max, u_max, np.sqrt(r_square), np.sqrt(np.maximum(u_square, q_square))


@njit(cache=True)
def diagonal_blocks_of_rows(starts, columns, values, d):
    """The blocks (nc, d, d) on the diagonal of a matrix by compressed rows, repeated entries added; of columns, each block transposed."""
    nc = (len(starts) - 1) // d
    blocks = np.zeros((nc, d, d))
    for a in range(nc):
        for i in range(d):
            for k in range(starts[d * a + i], starts[d * a + i + 1]):
                j = columns[k] - d * a
                if 0 <= j < d:
                    blocks[a, i, j] += values[k]
    return blocks
