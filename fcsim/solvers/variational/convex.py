"""Convex quadratic programs of frictional contact, min 0.5 r.W r + q.r over cones, cylinders or disks, by an engine chosen by name.

An engine takes the program as a variational inequality, a starting point and a watch that knows the natural residual to reach.
Sources: projected gradient with Nesterov's acceleration and restart as in Mazhar, Heyn, Negrut, Tasora, ACM Trans. Graph. 34, 2015;
Gauss-Seidel on convex programs as in Acary, Brémond, Huber 2018; the others in their own modules.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.linear.block_rows import block_rows
from fcsim.problem import Delassus
from fcsim.solvers.base import Iterate, Status
from fcsim.solvers.variational._set_kernels import sweep_cone, sweep_cylinder
from fcsim.solvers.variational.admm import AdmmOptions, split
from fcsim.solvers.variational.conic import clarabel_program
from fcsim.solvers.variational.convex_sets import Cone, Disk, RollingCone
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.interior_point import primal_dual
from fcsim.solvers.variational.projection import ProjectionOptions, project
from fcsim.solvers.variational.watches import LightCriterion, Watch, least_residual

Engine = Callable[[Inequality, FloatArray, Watch], Iterate]


def projected_gradient(vi: Inequality, r: FloatArray, watch: Watch, accelerated: bool = False) -> Iterate:
    """r <- P_C(y - rho (W y + q)), y = r or Nesterov's extrapolation of it, restarted where it points uphill.

    rho starts at 1 / ||W|| and is halved where the quadratic model fails, ||W|| being an estimate from below.
    """
    rho = 1 / vi.operator.norm
    least = 0.4 * rho
    x = vi.project(r)
    u = vi.velocity(x)
    y, u_y, theta = x, u, 1.0
    status = watch.visit(x, u, True)
    while status is None:
        new, change = vi.step(y, u_y, rho)
        u_new = vi.velocity(new)
        watch.tick()
        if float((new - y) @ (u_new - u_y)) > change**2 / rho and rho > least:
            rho *= 0.5
            continue
        residual = vi.step(new, u_new, rho)[1]
        status = watch.visit(new, u_new, least_residual(watch, rho, residual) <= watch.target or not np.isfinite(residual))
        if residual == 0 and status is None:
            status = Status.STAGNATED
        beta = 0.0
        if accelerated and float((y - new) @ (new - x)) <= 0:
            last, theta = theta, 0.5 * (1 + np.sqrt(1 + 4 * theta**2))
            beta = (last - 1) / theta
        else:
            theta = 1.0
        y, u_y = new + beta * (new - x), u_new + beta * (u_new - u)
        x, u = new, u_new
    return Iterate(x, status)


def accelerated_projected_gradient(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
    """The projected gradient with Nesterov's acceleration."""
    return projected_gradient(vi, r, watch, accelerated=True)


def gauss_seidel(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
    """Sweeps over the contacts (PGS for normal reactions alone); a cone's contact by local projections, others exactly."""
    k = vi.operator.dimension
    offset = 1 if isinstance(vi.convex_set, Disk) else 0
    indptr, indices, blocks = vi.operator.derived(_embedded_rows, offset)
    q, x = _embedded(vi.q, k, offset), _embedded(vi.project(r), k, offset)
    diagonal = vi.operator.diagonal_blocks
    norms = np.linalg.norm(diagonal, ord=2, axis=(1, 2))
    largest = float(norms.max(initial=0.0)) or 1.0
    rho = 1 / np.where(norms > 0, norms, largest)
    light = LightCriterion(10 * watch.target)

    def flat() -> FloatArray:
        return x[:, offset : offset + k].ravel()

    status = watch.visit(flat(), None, True)
    while status is None:
        if isinstance(vi.convex_set, Cone):
            change, _ = sweep_cone(indptr, indices, blocks, q, vi.convex_set.mu, rho, x, 1e-14, 100)
        else:
            assert not isinstance(vi.convex_set, RollingCone)  # no convex program is made of it
            change, _ = sweep_cylinder(indptr, indices, blocks, q, vi.convex_set.radius, x, offset == 0, k > 1 or offset == 1)
        watch.tick()
        status = watch.visit(flat(), None, light.due(largest * float(np.sqrt(change))))
        if change == 0 and status is None:
            status = Status.STAGNATED
    return Iterate(flat(), status)


def _embedded(x: FloatArray, k: int, offset: int) -> FloatArray:
    rows = np.zeros((len(x) // k, 3))
    rows[:, offset : offset + k] = x.reshape(-1, k)
    return rows


def _embedded_rows(operator: Delassus, offset: int) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """W by block rows with blocks (3, 3): N, T1, T2; what a program does not have gets a unit diagonal."""
    k = operator.dimension
    if k > 1 and offset == 0:
        return block_rows(operator.matrix, k)
    bsr = sp.bsr_array(operator.matrix, blocksize=(k, k))
    bsr.sum_duplicates()
    blocks = np.zeros((len(bsr.data), 3, 3))
    blocks[:, offset : offset + k, offset : offset + k] = bsr.data
    own = np.repeat(np.arange(len(bsr.indptr) - 1), np.diff(bsr.indptr)) == bsr.indices
    for i in {0, 1, 2} - set(range(offset, offset + k)):
        blocks[own, i, i] = 1
    return bsr.indptr.astype(np.int64), bsr.indices.astype(np.int64), blocks


def self_adaptive_projection(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
    """FP-VI-UPK on the program."""
    return project(vi, r, watch, ProjectionOptions(step_rule="Khobotov"), corrector=False)


def self_adaptive_extragradient(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
    """EG-VI-UPK on the program."""
    return project(vi, r, watch, ProjectionOptions(step_rule="Khobotov"), corrector=True)


def splitting(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
    """ADMM on the program."""
    return split(vi, r, watch, AdmmOptions())


class _Capped:
    """A watch that ends a polish after a number of its own iterations."""

    def __init__(self, watch: Watch, iterations: int) -> None:
        self._watch, self._left = watch, iterations
        self.target, self.compliance, self.speed = watch.target, watch.compliance, watch.speed

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        return self._watch.visit(r, u, due) or (Status.STAGNATED if self._left <= 0 else None)

    def tick(self) -> None:
        self._left -= 1
        self._watch.tick()


def polished(interior_point: Engine) -> Engine:
    """An interior-point engine whose answer, where its residual is still too large, gets up to 200 accelerated gradient steps.

    An interior point is accurate in the gap r . u; where a contact both grazes and slides its r is known to the root of that only.
    """

    def engine(vi: Inequality, r: FloatArray, watch: Watch) -> Iterate:
        iterate = interior_point(vi, r, watch)
        if iterate.status is not Status.STAGNATED:
            return iterate
        return accelerated_projected_gradient(vi, iterate.r, _Capped(watch, 200))

    return engine


ENGINES: dict[str, Engine] = {
    "NSGS": gauss_seidel,
    "projected gradient": projected_gradient,
    "accelerated projected gradient": accelerated_projected_gradient,
    "FP-VI-UPK": self_adaptive_projection,
    "EG-VI-UPK": self_adaptive_extragradient,
    "ADMM": splitting,
    "Clarabel": polished(clarabel_program),
    "primal-dual": polished(primal_dual),
}
