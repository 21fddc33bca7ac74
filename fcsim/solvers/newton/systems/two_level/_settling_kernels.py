"""Newton's method on patches of joints, and which patches, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.solvers.newton._formulation_kernels import ALART_CURNIER, disk_equations
from fcsim.solvers.newton.systems.two_level._held_kernels import may_slide, newton_step, slides, without_held


@njit(cache=True, nogil=True)
def weighted(F, weight):
    """||weight F|| for F (n, d) and weight (n,)."""
    total = 0.0
    for a in range(len(F)):
        for i in range(F.shape[1]):
            total += (weight[a] * F[a, i]) ** 2
    return np.sqrt(total)


@njit(cache=True, nogil=True)
def went(x, t, dx):
    """x + t dx for x and dx (n, d), in a loop: an expression of arrays is compiled anew at each place, with the text of its refusals."""
    to = np.empty(x.shape)
    for a in range(x.shape[0]):
        for i in range(x.shape[1]):
            to[a, i] = x[a, i] + t * dx[a, i]
    return to


@njit(cache=True, nogil=True)
def settle_patch(W, u, r, mu, rho, weight, most, falls, leaps, edge, eased):
    """Reactions (n, d) from (u, r) with u moving by W times what they move by, by at most `most` iterations of Newton's method on Alart and
    Curnier's F; steps are halved until ||weight F|| falls by a hundredth of them, it ends where that is `falls` of what it was. Where no
    part of a step is enough the whole one is taken, `leaps` times at most; the best of all that were met are returned. edge: see
    `may_slide`; eased: `without_held`."""
    n, d = u.shape
    F, A, B = disk_equations(u, r, mu, rho, ALART_CURNIER)
    size = weighted(F, weight)
    enough, best, least = falls * size, r, size
    free, known = np.zeros(n, dtype=np.bool_), False
    L, Y, S = np.empty((0, 0)).T, np.empty((0, 0)), np.empty((0, 0))
    held, others = np.flatnonzero(free), np.flatnonzero(free)
    for _ in range(most):
        if size <= enough:
            break
        try:
            if not known or slides(B, held):
                may_slide(u, r, mu, rho, B, edge, free)
                held, others = np.flatnonzero(~free), np.flatnonzero(free)
                L, Y, S = without_held(W, held, others, d, eased)
                known = True
            step = newton_step(F, A, B, held, others, L, Y, S)
        except Exception:  # all that compiled code can name: the patch is singular
            break
        dr, du, t = step.reshape(n, d), np.dot(W, step).reshape(n, d), 1.0
        found = False
        while t > 1e-3 and not found:
            F, A, B = disk_equations(went(u, t, du), went(r, t, dr), mu, rho, ALART_CURNIER)
            after = weighted(F, weight)
            found = after <= (1 - 0.01 * t) * size
            if not found:
                t *= 0.5
        if not found:
            if leaps == 0:
                break
            leaps, t = leaps - 1, 1.0
            F, A, B = disk_equations(went(u, t, du), went(r, t, dr), mu, rho, ALART_CURNIER)
            after = weighted(F, weight)
        u, r, size = went(u, t, du), went(r, t, dr), after
        if size < least:
            best, least = r, size
    return best


@njit(cache=True)
def choose_patches(worst, begins, beside, cuts, most, enough):
    """Return starts (patches + 1,) and the joints of the patches: each one of `worst` that is in none so far, nor next to one that is, with
    the joints `beside` it; at most `most` contacts a patch but for a joint alone, and no more patches from `enough` contacts on."""
    taken = np.zeros(len(cuts) - 1, dtype=np.bool_)
    starts, which = np.zeros(len(worst) + 1, dtype=np.int64), np.empty(len(cuts) - 1, dtype=np.int64)
    patches, at, contacts = 0, 0, 0
    for k in worst:
        if contacts >= enough:
            break
        free = not taken[k]
        for j in beside[begins[k] : begins[k + 1]]:
            free = free and not taken[j]
        if not free:
            continue
        size = cuts[k + 1] - cuts[k]
        which[at], taken[k] = k, True
        at += 1
        for j in beside[begins[k] : begins[k + 1]]:
            own = cuts[j + 1] - cuts[j]
            if size + own <= most:
                which[at], taken[j] = j, True
                at += 1
                size += own
        contacts += size
        patches += 1
        starts[patches] = at
    return starts[: patches + 1], which[:at]
