"""Programs of frictional contact in conic form, min 0.5 x.P x + c.x with h - A x in half-lines and second-order cones; by Clarabel.

Source: Goulart, Chen, "Clarabel: an interior-point solver for conic programs with quadratic objectives", arXiv:2405.12762.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, Matrix
from fcsim.errors import MissingDependency
from fcsim.problem.problem import GlobalForm
from fcsim.solvers.base import Iterate, Status
from fcsim.solvers.variational.convex_sets import Cone, Disk, RollingCone
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import Watch


def clarabel_module() -> ModuleType:
    """Return the clarabel package; MissingDependency where it is absent."""
    try:
        import clarabel
    except ImportError as error:
        raise MissingDependency(f"Clarabel cannot be imported ({error}): pip install 'fcsim[optimisation]'") from None
    return clarabel


@dataclass(frozen=True, eq=False)
class ConicRows:
    """A set as h - A x in R_+^half_lines x (second-order cones of `cone_size`)^cones, x (free,) the unknowns that are not fixed to 0."""

    A: sp.csr_array
    h: FloatArray
    half_lines: int
    cones: int
    cone_size: int
    free: NDArray[np.int64]


def conic_rows(vi: Inequality) -> ConicRows:
    """The rows of a program's set; tangential unknowns without friction are fixed to 0."""
    k, n = vi.operator.dimension, len(vi.q)
    dofs = np.arange(n).reshape(-1, k)
    if isinstance(vi.convex_set, Cone):  # (mu r_N, r_T) in the cone; mu = 0: r_N >= 0
        mu = vi.convex_set.mu
        sliding = mu > 0 if k > 1 else np.zeros(len(mu), dtype=bool)
        lines, cones, size = dofs[~sliding, 0], dofs[sliding], k
        coefficients = np.ones(cones.shape)
        coefficients[:, 0] = mu[sliding]
        h = np.zeros(len(lines) + cones.size)
        rows = np.arange(len(lines), len(h))
        columns, values = cones.ravel(), coefficients.ravel()
        fixed = dofs[~sliding, 1:]
    else:  # r_N >= 0 and (radius, r_T) in the cone
        assert not isinstance(vi.convex_set, RollingCone)  # no cone program is made of it
        radius = vi.convex_set.radius
        tangents = dofs if isinstance(vi.convex_set, Disk) else dofs[:, 1:]
        lines = dofs[:0, 0] if isinstance(vi.convex_set, Disk) else dofs[:, 0]
        sliding = (radius > 0) & (tangents.shape[1] > 0)
        cones, size = tangents[sliding], tangents.shape[1] + 1
        h = np.zeros(len(lines) + len(cones) * size)
        h[len(lines) :: size] = radius[sliding]
        rows = len(lines) + (np.arange(len(cones))[:, None] * size + 1 + np.arange(size - 1)).ravel()
        columns, values = cones.ravel(), np.ones(cones.size)
        fixed = tangents[~sliding]
    is_free = np.ones(n, dtype=bool)
    is_free[fixed.ravel()] = False
    number = np.cumsum(is_free) - 1
    A = sp.csr_array(
        (
            -np.concatenate([np.ones(len(lines)), values]),
            (np.concatenate([np.arange(len(lines)), rows]), number[np.concatenate([lines, columns])]),
        ),
        shape=(len(h), int(is_free.sum())),
    )
    return ConicRows(A, h, len(lines), int(sliding.sum()), size, np.flatnonzero(is_free))


def scaled_program(vi: Inequality) -> tuple[ConicRows, Matrix, FloatArray, float]:
    """Rows, P, c and the scale of r that makes ||P|| = ||c|| = 1: engines have absolute tolerances."""
    rows = conic_rows(vi)
    operator = vi.operator
    P = operator.matrix if isinstance(operator.matrix, np.ndarray) else sp.csr_array(operator.matrix)
    if len(rows.free) < operator.size:
        P = P[rows.free][:, rows.free]
    size = float(np.linalg.norm(vi.q)) or 1.0
    scale = size / operator.norm
    return replace(rows, h=rows.h / scale), P / operator.norm, vi.q[rows.free] / size, scale


def _accuracy(watch: Watch, size: float, norm: float) -> float:
    """The tolerance of a scaled program for the natural residual of a watch, where ||q|| = size and ||W|| = norm."""
    largest = float(watch.compliance.max(initial=0.0)) or norm
    return float(np.clip(1e-3 * min(1.0, norm / largest) * watch.target / (size or 1.0), 1e-11, 1e-8))


def clarabel_solve(
    P: Matrix, c: FloatArray, A: sp.sparray, h: FloatArray, cones: list[object], accuracy: float
) -> tuple[FloatArray, FloatArray]:
    """Solve min 0.5 x.P x + c.x, h - A x in the cones, by Clarabel; return x and the multipliers of the rows."""
    clarabel = clarabel_module()
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = accuracy
    solver = clarabel.DefaultSolver(sp.csc_matrix(sp.triu(sp.csc_array(P))), c, sp.csc_matrix(A), h, cones, settings)
    solution = solver.solve()
    return np.array(solution.x), np.array(solution.z)


def clarabel_program(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
    """The program by Clarabel; its answer counts by its natural residual, whatever Clarabel says of it.

    Clarabel takes a symmetric W: the skew part acts on the last answer, again and again until the residual is met.
    """
    answer = vi.project(r)
    status = watch.visit(answer, None, True)
    clarabel = clarabel_module()
    symmetric = vi.operator.symmetric_part
    rows, P, c, scale = scaled_program(Inequality(symmetric, vi.q, vi.convex_set))
    size = float(np.linalg.norm(vi.q)) or 1.0
    accuracy = _accuracy(watch, size, vi.operator.norm)
    cones = [clarabel.NonnegativeConeT(rows.half_lines)] if rows.half_lines else []
    cones += [clarabel.SecondOrderConeT(rows.cone_size)] * rows.cones
    change = np.inf
    while status is None:
        last, change_last = answer, change
        if symmetric is not vi.operator:
            c = (vi.velocity(last) - symmetric.W @ last)[rows.free] / size
        x, _ = clarabel_solve(P, c, rows.A, rows.h, cones, accuracy)
        watch.tick()
        answer = np.zeros_like(r)
        answer[rows.free] = scale * x
        answer = vi.project(answer)
        if not np.all(np.isfinite(answer)):
            return Iterate(last, Status.DIVERGED)
        status = watch.visit(answer, None, True)
        change = float(np.linalg.norm(answer - last))
        if status is None and (symmetric is vi.operator or change > 0.5 * change_last):
            status = Status.STAGNATED
    return Iterate(answer, status)


def clarabel_global(p: GlobalForm, v: FloatArray, g: FloatArray, accuracy: float, velocity_scale: float) -> FloatArray:
    """r of the SOCP min 0.5 v.M v - f.v, H^T v + w + g in K*, G^T v + b = 0, by Clarabel: r are the multipliers of the cones.

    Of an unsymmetric M the skew part acts on the last v.
    """
    clarabel = clarabel_module()
    d = p.dimension
    dofs = np.arange(p.m).reshape(-1, d)
    sliding = p.mu > 0
    lines, cones = dofs[~sliding, 0], dofs[sliding].ravel()
    weight = np.ones(p.m)  # (u_N, mu u_T) in the self-dual cone
    weight.reshape(-1, d)[:, 1:] = p.mu[:, None]
    order = np.concatenate([lines, cones])
    HT = sp.csr_array(p.H.T)[order]
    equalities = 0 if p.G is None else p.G.shape[1]
    blocks = [-sp.diags_array(weight[order]) @ HT]
    h = [(weight * (p.w + g))[order]]
    kinds = [clarabel.NonnegativeConeT(len(lines))] if len(lines) else []
    kinds += [clarabel.SecondOrderConeT(d)] * int(sliding.sum())
    if p.G is not None and p.b is not None:
        blocks.insert(0, sp.csr_array(p.G).T)
        h.insert(0, -p.b)
        kinds.insert(0, clarabel.ZeroConeT(equalities))
    M = sp.csr_array(p.entries)
    symmetric = 0.5 * (M + M.T)
    f = p.f - (M @ v - symmetric @ v)
    force = float(np.linalg.norm(f)) or velocity_scale * float(abs(M).max())
    _, z = clarabel_solve(
        symmetric * (velocity_scale / force), -f / force, sp.vstack(blocks), np.concatenate(h) / velocity_scale, kinds, accuracy
    )
    r = np.zeros(p.m)
    r[order] = weight[order] * z[equalities:] * force
    return r
