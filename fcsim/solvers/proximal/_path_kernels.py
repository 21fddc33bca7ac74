"""The contacts' own law behind a regularisation and where a straight path leaves its pieces, compiled; see `path`.

z (nc, d) = c - rho u: what the reaction would be if the contact stuck. Statuses: 0 open, 1 sticking, 2 sliding.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

AT_REST = 1e-12
"""Share of the largest reaction up to which a contact begins open."""
AT_LIMIT = 1e-10
"""Share of the friction's limit next to it from which on a contact begins as sliding."""
APART = 1e-4
"""Share of the largest reaction by which contacts begin beyond the border of their status: those that leave it together would take turns
for ever. Each has another, between once and twice as much."""
GOLDEN = 0.6180339887498949
"""Multiples of it, without their integers, are spread evenly."""
CHATTER = 0.2
"""Share of pieces without a length at which a path is no longer on its way."""
LONG, COME_ON = 500, 0.02
"""Pieces from which on a path that has not come on in the second half of them is given up, and by how much t has to. Of 751 paths of 35
steps of rigid masonry one of 538 that arrived would be, and a quarter of the pieces of lost ones saved; of 1403 of 75 other steps four of
1042, and a quarter."""
AHEAD = 2.0
"""Times the pieces that every path has which one on its way may still need, at the rate it shows."""


@njit(cache=True)
def _squared(z):
    """||z_T||^2 of z (d,)."""
    total = 0.0
    for i in range(1, len(z)):
        total += z[i] * z[i]
    return total


@njit(cache=True)
def statuses(z, mu):
    """Of each contact (nc,)."""
    found = np.zeros(len(mu), dtype=np.int64)
    for a in range(len(mu)):
        if z[a, 0] > 0:
            limit = mu[a] * z[a, 0]
            found[a] = 1 if mu[a] > 0 and _squared(z[a]) <= limit * limit else 2
    return found


@njit(cache=True)
def law(z, mu, rho, status):
    """r (nc, d) and K = rho dr/dz (nc, d, d) with these statuses (nc,): 0; z; (z_N, mu z_N z_T / ||z_T||)."""
    nc, d = z.shape
    r, K = np.zeros((nc, d)), np.zeros((nc, d, d))
    for a in range(nc):
        if status[a] == 0:
            continue
        r[a, 0] = z[a, 0]
        K[a, 0, 0] = rho[a]
        if status[a] == 1:
            for i in range(1, d):
                r[a, i] = z[a, i]
                K[a, i, i] = rho[a]
            continue
        size = np.sqrt(_squared(z[a]))
        if size == 0.0:
            continue
        share = mu[a] * z[a, 0] / size
        for i in range(1, d):
            t = z[a, i] / size
            r[a, i] = share * z[a, i]
            K[a, i, 0] = rho[a] * mu[a] * t
            for j in range(1, d):
                K[a, i, j] = rho[a] * share * ((1.0 if i == j else 0.0) - t * z[a, j] / size)
    return r, K


@njit(cache=True)
def beginning(r, u, mu, rho):
    """z (nc, d) that belongs to reactions r and velocities u (nc, d), both nearly those of a solution, and statuses (nc,).

    Open contacts keep their velocity, sliding ones their speed, where that is not nearly nothing (`APART`); what sticks is at rest.
    """
    nc, d = r.shape
    z, status = r.copy(), np.zeros(nc, dtype=np.int64)
    largest = np.abs(r[:, 0]).max() if nc > 0 else 0.0
    least = AT_REST * largest
    for a in range(nc):
        apart = APART * largest * (1.0 + (a + 1) * GOLDEN % 1.0)
        if r[a, 0] <= least:
            for i in range(d):
                z[a, i] = -rho[a] * u[a, i]
            z[a, 0] = min(z[a, 0], -apart)
            continue
        size, limit = np.sqrt(_squared(r[a])), mu[a] * r[a, 0]
        if size < (1 - AT_LIMIT) * limit:
            status[a] = 1
            continue
        status[a] = 2
        speed = np.sqrt(_squared(u[a]))
        for i in range(1, d):
            z[a, i] = (limit + max(rho[a] * speed, apart)) * r[a, i] / size if size > 0 else -rho[a] * u[a, i]
    return z, status


@njit(cache=True)
def end_of_piece(z, dz, mu, status, turn):
    """How far along dz (nc, d) the first contact leaves its status: (length, contact, its next status).

    Contact -1: none before the direction of one that slides has turned by `turn`, or none at all where the length is infinite.
    """
    least, which, following = np.inf, -1, -1
    for a in range(len(mu)):
        t, to, m = np.inf, -1, mu[a]
        if status[a] == 0:
            if dz[a, 0] > 0:
                t, to = max(-z[a, 0] / dz[a, 0], 0.0), 2
        else:
            if dz[a, 0] < 0:
                t, to = max(-z[a, 0] / dz[a, 0], 0.0), 0
            if m > 0:  # ||z_T||^2 - (mu z_N)^2 = A t^2 + 2 B t + C, of which the sign is to change
                A, C = _squared(dz[a]) - m * m * dz[a, 0] ** 2, _squared(z[a]) - m * m * z[a, 0] ** 2
                B = -m * m * z[a, 0] * dz[a, 0]
                for i in range(1, z.shape[1]):
                    B += z[a, i] * dz[a, i]
                if status[a] == 2:
                    A, B, C = -A, -B, -C
                C = min(C, 0.0)
                root = B * B - A * C
                if root >= 0:
                    crossing = np.inf
                    if B > 0:
                        crossing = -C / (B + np.sqrt(root))
                    elif A > 0:
                        crossing = (np.sqrt(root) - B) / A
                    if crossing < t:
                        t, to = crossing, 3 - status[a]
        if t < least:
            least, which, following = t, a, to
        if status[a] == 2 and z.shape[1] == 3:
            across = abs(z[a, 1] * dz[a, 2] - z[a, 2] * dz[a, 1])
            if across > 0 and turn * _squared(z[a]) < least * across:
                least, which, following = turn * _squared(z[a]) / across, -1, -1
    return least, which, following


@njit(cache=True)
def on_its_way(pieces, least, most, t, short, half):
    """Whether a path goes on after so many pieces, `short` of them without a length: each does for `least`, and up to `most` those that
    do not chatter, by the rate of t so far end soon, and have come on since half as many, when t was `half`."""
    if pieces < least:
        return True
    if pieces >= LONG and t - half < COME_ON:
        return False
    return pieces < most and t > 0 and short < CHATTER * pieces and (1 - t) * pieces <= t * (AHEAD * least + pieces)
