"""Newton's method on single joints, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.solvers.newton._formulation_kernels import disk_equations


@njit(cache=True, nogil=True)
def joint_compliance(E, G):
    """W (n d, n d) of a joint's own contacts, the first n of E (wide d, wide d), with the modes G (n, d, 2 k) of its bodies."""
    n, d = len(G), G.shape[1]
    g = np.ascontiguousarray(G).reshape(n * d, -1)
    return np.ascontiguousarray(E[: n * d, : n * d]).astype(np.float64) + np.dot(g, np.ascontiguousarray(g.T))


@njit(cache=True, nogil=True)
def weighted(F, weight):
    """||weight F|| for F (n, d) and weight (n,)."""
    total = 0.0
    for a in range(len(F)):
        for i in range(F.shape[1]):
            total += (weight[a] * F[a, i]) ** 2
    return np.sqrt(total)


@njit(cache=True, nogil=True)
def settle_joint(W, u, r, mu, rho, weight, most, falls):
    """Reactions (n, d) from (u, r) with u moving by W times what they move by, by at most `most` iterations of Newton's method on Alart and
    Curnier's F; steps are halved until ||weight F|| falls by a hundredth of them, it ends where that is `falls` of what it was."""
    n, d = u.shape
    F, A, B = disk_equations(u, r, mu, rho, False)
    size = weighted(F, weight)
    enough = falls * size
    for _ in range(most):
        if size <= enough:
            break
        J = np.zeros((n, d, n * d))
        for a in range(n):
            for p in range(d):
                row = J[a, p]
                for q in range(d):
                    x = A[a, p, q]
                    if x != 0:
                        for c in range(n * d):
                            row[c] += x * W[a * d + q, c]
                    row[a * d + q] += B[a, p, q]
        try:
            step = np.linalg.solve(J.reshape(n * d, n * d), -F.ravel())
        except Exception:  # all that compiled code can name: the joint is singular
            break
        dr, du, t = step.reshape(n, d), np.dot(W, step).reshape(n, d), 1.0
        found = False
        while t > 1e-3 and not found:
            F, A, B = disk_equations(u + t * du, r + t * dr, mu, rho, False)
            after = weighted(F, weight)
            found = after <= (1 - 0.01 * t) * size
            if not found:
                t *= 0.5
        if not found:
            break
        u, r, size = u + t * du, r + t * dr, after
    return r


@njit(cache=True, nogil=True)
def settle_joints(E, starts, cuts, begins, order, G, u, r, mu, rho, weight, limit, most, falls, first, last, out):
    """Write to `out` (nc, d) the reactions of the joints first, ..., last - 1 in which ||weight F|| is above `limit`; u, r, mu, rho and
    weight by contact, E and what follows as in `Joints`. Returns the number of these joints."""
    d, count = u.shape[1], 0
    for k in range(first, last):
        own = order[cuts[k] : cuts[k + 1]]
        own_u, own_r, own_mu, own_rho, own_weight = u[own], r[own], mu[own], rho[own], weight[own]
        if weighted(disk_equations(own_u, own_r, own_mu, own_rho, False)[0], own_weight) <= limit:
            continue
        wide = d * (begins[k + 1] - begins[k])
        W = joint_compliance(E[starts[k] : starts[k + 1]].reshape(wide, wide), G[cuts[k] : cuts[k + 1]])
        out[own] = settle_joint(W, own_u, own_r, own_mu, own_rho, own_weight, most, falls)
        count += 1
    return count
