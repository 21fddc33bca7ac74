"""Gauss-Seidel sweeps over block-sparse rows (d = 3), compiled once for each one-contact solver, and the product by those rows.

A sweep is a template: `compiled` binds the global name `one_contact` to a one-contact solver before numba sees it, so that the solver
is inlined and each sweep has its own entry in numba's cache on disk. (A closure would not: numba keys it by its callee's random identity.)
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from fcsim.solvers.gauss_seidel._one_contact_kernels import natural_residual

if TYPE_CHECKING:
    from numba.core.dispatcher import Dispatcher

one_contact: Dispatcher
"""Stands for the one-contact solver in the templates below."""


def compiled(template: Callable[..., object], name: str, solver: Dispatcher) -> Dispatcher:
    """Return the sweep `template` for the one-contact solver `solver`, compiled at its first call; `name` tells the cache entries apart."""
    assert isinstance(template, FunctionType)
    sweep = FunctionType(template.__code__, {**globals(), "one_contact": solver}, f"{template.__name__}_{name}")
    sweep.__qualname__ = sweep.__name__
    return njit(cache=True, nogil=True)(sweep)


@njit(cache=True, forceinline=True)
def off_diagonal(indptr, indices, blocks, a, q0, q1, q2, r):
    """q_a + sum_{b != a} W_ab r_b."""
    for k in range(indptr[a], indptr[a + 1]):
        b = indices[k]
        if b != a:
            s0, s1, s2 = r[b, 0], r[b, 1], r[b, 2]
            q0 += blocks[k, 0, 0] * s0 + blocks[k, 0, 1] * s1 + blocks[k, 0, 2] * s2
            q1 += blocks[k, 1, 0] * s0 + blocks[k, 1, 1] * s1 + blocks[k, 1, 2] * s2
            q2 += blocks[k, 2, 0] * s0 + blocks[k, 2, 1] * s1 + blocks[k, 2, 2] * s2
    return q0, q1, q2


def change_to_await(awaited, change, share):
    """The relative change of the next sweep that is small enough for a look at the error, after one of `change` <= awaited at which the
    error was the tolerance over `share`: in proportion, but from a half to a thousandth of the last."""
    return min(0.5 * awaited, max(change * share, 1e-3 * awaited))


change_to_await_next = njit(cache=True)(change_to_await)


@njit(cache=True, forceinline=True)
def block(blocks, k):
    """blocks[k] as a tuple of rows, which stays in registers; a view of the array would be counted and freed at every visit."""
    return (
        (blocks[k, 0, 0], blocks[k, 0, 1], blocks[k, 0, 2]),
        (blocks[k, 1, 0], blocks[k, 1, 1], blocks[k, 1, 2]),
        (blocks[k, 2, 0], blocks[k, 2, 1], blocks[k, 2, 2]),
    )


def sweep(
    indptr,
    indices,
    blocks,
    diagonal,
    shift,
    q,
    mu,
    rho,
    order,
    r,
    frozen,
    tolerance,
    iterations,
    relaxation,
    filtered,
    freezing,
    settled,
    sweeps,
    enough,
):
    """Gauss-Seidel sweeps over the contacts in `order`, in place on r (nc, 3): at most `sweeps`, ended by ||change|| <= enough ||r||.

    Return (||change||^2, ||r||^2, local failures) of the last one, and how many there were.

    indptr, indices, blocks (nnz, 3, 3): W by block rows; diagonal (nc, 3, 3): W_aa + shift_a I, where shift_a (nc,) is the contact's
    proximal regularisation, balanced by q_a - shift_a r_a; rho (nc, 2): rho_N, rho_T. tolerance is relative to ||r_a|| + rho_N ||q_a||.
    relaxation: r_a <- r_a + omega (new - r_a). filtered: keep r_a where the new one is not finite or has a larger natural-map residual.
    freezing: a contact that changed by less than `settled` (unit of r) is left out of the next `freezing` sweeps, counted in frozen (nc,).

    Long because a template is specialised as a whole for each one-contact solver.
    """
    change = 0.0
    size = 0.0
    failures = 0
    done = 0
    while done < sweeps:
        done += 1
        change = 0.0
        size = 0.0
        failures = 0
        for a in order:
            old0, old1, old2 = r[a, 0], r[a, 1], r[a, 2]
            if frozen[a] > 0:
                frozen[a] -= 1
                size += old0 * old0 + old1 * old1 + old2 * old2
                continue
            s, W, m, rho_N, rho_T = shift[a], block(diagonal, a), mu[a], rho[a, 0], rho[a, 1]
            q0, q1, q2 = off_diagonal(indptr, indices, blocks, a, q[a, 0] - s * old0, q[a, 1] - s * old1, q[a, 2] - s * old2, r)
            square = old0 * old0 + old1 * old1 + old2 * old2
            if square == 0.0 and q0 >= 0.0:  # open, and stays so
                r[a, 0], r[a, 1], r[a, 2] = 0.0, 0.0, 0.0
                if freezing > 0:
                    frozen[a] = freezing
                continue
            tol = tolerance * (np.sqrt(square) + rho_N * np.sqrt(q0 * q0 + q1 * q1 + q2 * q2))
            r0, r1, r2, solved = one_contact(W, q0, q1, q2, m, rho_N, rho_T, old0, old1, old2, tol, iterations)  # noqa: F821
            if not solved:
                failures += 1
            if filtered:
                rho_a = min(rho_N, rho_T)
                before = natural_residual(W, q0, q1, q2, m, rho_a, old0, old1, old2)
                if not (natural_residual(W, q0, q1, q2, m, rho_a, r0, r1, r2) <= before and np.isfinite(r0 + r1 + r2)):
                    r0, r1, r2 = old0, old1, old2
            if relaxation != 1.0:
                r0, r1, r2 = old0 + relaxation * (r0 - old0), old1 + relaxation * (r1 - old1), old2 + relaxation * (r2 - old2)
            r[a, 0], r[a, 1], r[a, 2] = r0, r1, r2
            own = (r0 - old0) ** 2 + (r1 - old1) ** 2 + (r2 - old2) ** 2
            if freezing > 0 and own <= settled * settled:
                frozen[a] = freezing
            change += own
            size += r0 * r0 + r1 * r1 + r2 * r2
        if not change > enough * enough * size:  # NaN ends it too
            break
    return change, size, failures, done


def sweep_velocities(indptr, indices, blocks, inverse, p, mu, rho, order, u, r, tolerance, iterations, relaxation):
    """One Gauss-Seidel sweep on velocities, in place on u and r (nc, 3): r = M u + p with M = W^-1 by block rows, p = -M q.

    inverse (nc, 3, 3): M_aa^-1, so that contact a alone is the problem u_a = M_aa^-1 r_a + q_a, q_a = -M_aa^-1 (p_a + sum M_ab u_b).
    Return (||change of u||^2, ||u||^2, local failures).
    """
    change = 0.0
    size = 0.0
    failures = 0
    for a in order:
        b0, b1, b2 = off_diagonal(indptr, indices, blocks, a, p[a, 0], p[a, 1], p[a, 2], u)
        W = block(inverse, a)
        q0 = -(W[0][0] * b0 + W[0][1] * b1 + W[0][2] * b2)
        q1 = -(W[1][0] * b0 + W[1][1] * b1 + W[1][2] * b2)
        q2 = -(W[2][0] * b0 + W[2][1] * b1 + W[2][2] * b2)
        r0, r1, r2 = r[a, 0], r[a, 1], r[a, 2]
        tol = tolerance * (np.sqrt(r0 * r0 + r1 * r1 + r2 * r2) + rho[a, 0] * np.sqrt(q0 * q0 + q1 * q1 + q2 * q2))
        r0, r1, r2, solved = one_contact(W, q0, q1, q2, mu[a], rho[a, 0], rho[a, 1], r0, r1, r2, tol, iterations)  # noqa: F821
        if not solved:
            failures += 1
        r[a, 0], r[a, 1], r[a, 2] = r0, r1, r2
        old0, old1, old2 = u[a, 0], u[a, 1], u[a, 2]
        d0 = relaxation * (W[0][0] * r0 + W[0][1] * r1 + W[0][2] * r2 + q0 - old0)
        d1 = relaxation * (W[1][0] * r0 + W[1][1] * r1 + W[1][2] * r2 + q1 - old1)
        d2 = relaxation * (W[2][0] * r0 + W[2][1] * r1 + W[2][2] * r2 + q2 - old2)
        u[a, 0], u[a, 1], u[a, 2] = old0 + d0, old1 + d1, old2 + d2
        change += d0 * d0 + d1 * d1 + d2 * d2
        size += u[a, 0] ** 2 + u[a, 1] ** 2 + u[a, 2] ** 2
    return change, size, failures
