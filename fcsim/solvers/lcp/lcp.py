"""Linear complementarity problems: 0 <= z ⊥ w = M z + q >= 0, by Lemke's method and by enumeration.

Sources: Lemke, Management Science 11, 1965; Cottle, Pang, Stone, The Linear Complementarity Problem, 1992 (algorithm 4.4.5 with the
lexicographic ratio test of section 4.9); Murty, Linear Complementarity, Linear and Nonlinear Programming, 1988 (complementary cones).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
import scipy  # whose optimize is loaded where it is used: a tenth of a second of every start
import scipy.linalg as sla

from fcsim.arrays import BoolArray, FloatArray
from fcsim.linear.factors import SingularMatrix
from fcsim.solvers.lcp._lcp_kernels import GOING, RAY, exchange, pivots


class LCPStatus(Enum):
    """Why a pivoting method stopped; a ray is a proof that there is no solution for many classes of M (copositive-plus, P, ...)."""

    SOLVED = "solved"
    RAY = "secondary ray"
    MAX_PIVOTS = "maximum number of pivots reached"
    STOPPED = "stopped by the caller"


@dataclass(frozen=True, eq=False)
class LCPSolution:
    """z and w = M z + q (n,), the basis as support (n,): where z is basic; the pivots made and why they ended."""

    z: FloatArray
    w: FloatArray
    support: BoolArray
    status: LCPStatus
    pivots: int


def lemke(
    M: FloatArray,
    q: FloatArray,
    *,
    covering: FloatArray | None = None,
    start: BoolArray | None = None,
    max_pivots: int | None = None,
    stop: Callable[[], bool] | None = None,
    tolerance: float = 1e-11,
) -> LCPSolution:
    """Lemke's method with the lexicographic ratio test, which does not cycle on degenerate problems.

    M (n, n), q (n,)  dense, entries of the order of one (scale before): `tolerance` tells a pivot from zero
    covering          d (n,) > 0 of the artificial variable; default between 1 and 2 at random (seeded): ties that round-off would decide
                      are then rare
    start             support (n,) of a complementary basis to begin with instead of z = 0, as a nearby problem's (SingularMatrix where
                      its block of M is singular)
    max_pivots        default 10 n + 100; `stop` is asked every few pivots

    z and w are recomputed from the last basis by LU, so that the pivots' round-off does not stay in them.
    """
    n = len(q)
    if start is not None and start.any():
        M_at, q_at = _principal_pivot(M, q, start)
        q_at = np.where(np.abs(q_at) <= tolerance * np.abs(q).max(), 0, q_at)  # round-off of a degenerate basis is not infeasible
    else:
        M_at, q_at, start = M, q, np.zeros(n, dtype=bool)
    d = np.random.default_rng(0).uniform(1, 2, n) if covering is None else covering
    count, status = 0, LCPStatus.SOLVED
    moved = np.zeros(n, dtype=bool)
    if np.any(q_at < 0):
        T = np.column_stack([M_at, d, q_at])
        basic, nonbasic, place = np.arange(n), np.append(np.arange(n, 2 * n), 2 * n), np.arange(n)
        # (0) the artificial variable enters; of equal rows the lexicographically least is the last, whose unit vector comes latest
        ratio = q_at / d
        row = int(np.flatnonzero(ratio <= ratio.min() * (1 - 1e-14))[-1])
        exchange(T, row, n)
        basic[row], nonbasic[n], place[row] = 2 * n, row, -n - 1
        column, state = row, GOING
        limit = 10 * n + 100 if max_pivots is None else max_pivots
        chunk = max(1, min(1000, int(2e8 / (n * n + 1))))
        while state == GOING and count < limit and not (stop is not None and stop()):
            state, column, made = pivots(T, basic, nonbasic, place, column, min(chunk, limit - count), tolerance)
            count += made
        moved[basic[(basic >= n) & (basic < 2 * n)] - n] = True
        if state == RAY:
            status = LCPStatus.RAY
        elif state == GOING:
            status = LCPStatus.MAX_PIVOTS if count >= limit else LCPStatus.STOPPED
    support = start ^ moved
    z = np.zeros(n)
    if status is LCPStatus.SOLVED:
        z[support] = np.maximum(_principal_solution(M, q, support)[0], 0)
    w = M @ z + q
    return LCPSolution(z, w, support, status, count)


def _principal_pivot(M: FloatArray, q: FloatArray, support: BoolArray) -> tuple[FloatArray, FloatArray]:
    """The same problem seen from a complementary basis: there w and z of the support have changed places."""
    a, b = np.flatnonzero(support), np.flatnonzero(~support)
    lu, swaps, info = sla.lapack.dgetrf(M[np.ix_(a, a)])
    if info != 0 or np.abs(np.diag(lu)).min() < 1e-13 * np.abs(np.diag(lu)).max():
        raise SingularMatrix(f"the basis of {len(a)} positive variables is singular")
    right = np.column_stack([np.eye(len(a)), -M[np.ix_(a, b)], -q[a]])
    solved = sla.lu_solve((lu, swaps), right, check_finite=False)
    pivoted, q_pivoted = np.empty_like(M), np.empty_like(q)
    pivoted[np.ix_(a, a)], pivoted[np.ix_(a, b)], q_pivoted[a] = solved[:, : len(a)], solved[:, len(a) : -1], solved[:, -1]
    M_ba = M[np.ix_(b, a)]
    pivoted[np.ix_(b, a)] = M_ba @ solved[:, : len(a)]
    pivoted[np.ix_(b, b)] = M[np.ix_(b, b)] + M_ba @ solved[:, len(a) : -1]
    q_pivoted[b] = q[b] + M_ba @ solved[:, -1]
    return pivoted, q_pivoted


def _principal_solution(M: FloatArray, q: FloatArray, a: BoolArray) -> tuple[FloatArray, bool]:
    """z_a of M_aa z_a = -q_a, and whether M_aa is regular: by least squares where it is not."""
    if not a.any():
        return np.zeros(0), True
    block = M[np.ix_(a, a)]
    lu, swaps, info = sla.lapack.dgetrf(block)
    if info == 0 and np.abs(np.diag(lu)).min() > 1e-13 * np.abs(np.diag(lu)).max():
        return sla.lu_solve((lu, swaps), -q[a], check_finite=False), True
    return sla.lstsq(block, -q[a], lapack_driver="gelsy", check_finite=False)[0], False


def all_supports(n: int) -> Iterator[BoolArray]:
    """The 2^n complementary bases in chunks (k, n), from the empty one on."""
    bits = np.arange(n)
    for first in range(0, 2**n, 4096):
        number = np.arange(first, min(first + 4096, 2**n))
        yield (number[:, None] >> bits & 1).astype(bool)


def complementary_solutions(
    M: FloatArray, q: FloatArray, supports: Iterable[BoolArray] | None = None, tolerance: float = 1e-10
) -> Iterator[LCPSolution]:
    """Visit complementary bases and yield the solutions among them, in the order of the bases; `pivots` counts the bases visited.

    supports  chunks (k, n) of supports of z; default all 2^n
    A basis solves where C x = q has x >= 0, C made of the columns I_j (w_j basic) and -M_j (z_j basic). Where C is singular, q may
    still lie in its cone: nonnegative least squares tells. `tolerance` is relative to the largest x of its kind (w or z).
    """
    n, visited = len(q), 0
    scale = float(np.abs(q).max(initial=0.0)) or 1.0
    for chunk in all_supports(n) if supports is None else supports:
        for support in np.array_split(chunk, max(1, len(chunk) * n * n // 4_000_000)):
            x = _basic_values(M, q, support, tolerance * scale)
            w, z = np.where(support, 0, x), np.where(support, x, 0)
            good = (w.min(axis=1) >= -tolerance * (scale + w.max(axis=1))) & (z.min(axis=1) >= -tolerance * z.max(axis=1))
            for k in np.flatnonzero(good):
                yield LCPSolution(np.maximum(z[k], 0), np.maximum(w[k], 0), support[k], LCPStatus.SOLVED, visited + int(k) + 1)
            visited += len(support)


def _basic_values(M: FloatArray, q: FloatArray, support: BoolArray, tolerance: float) -> FloatArray:
    """x (k, n) of the bases: z where the support holds, w elsewhere; NaN for a basis without solution."""
    count, n = support.shape
    x = np.full((count, n), np.nan)
    if count == 1:  # large: only M_aa z_a = -q_a is solved
        a = support[0]
        x[0, a], exact = _principal_solution(M, q, a)
        x[0, ~a] = q[~a] + M[np.ix_(~a, a)] @ x[0, a]
        if exact or (np.abs(M[a] @ np.where(a, x[0], 0) + q[a]).max() <= tolerance and x.min() >= -tolerance):
            return x
    C = np.where(support[:, None, :], -M, np.eye(n))
    sign, logarithm = np.linalg.slogdet(C)
    regular = (sign != 0) & (logarithm > np.log(1e-13) * n)
    x[regular] = np.linalg.solve(C[regular], np.tile(q, (int(np.count_nonzero(regular)), 1))[:, :, None])[:, :, 0]
    for k in np.flatnonzero(~regular):
        if not (np.all(np.isfinite(C[k])) and np.all(np.isfinite(q))):
            continue
        try:
            nearest, distance = scipy.optimize.nnls(C[k], q)
        except RuntimeError:  # it does not come to an end within its own limit: this basis is passed over
            continue
        if distance <= tolerance:
            x[k] = nearest
    return x
