"""Primal-dual interior-point method for programs in conic form, with Nesterov-Todd scaling and Mehrotra's predictor and corrector.

Sources: Nesterov, Todd, SIAM J. Optim. 8, 1998; Andersen, Dahl, Liu, Vandenberghe, "Interior-point methods for large-scale cone
programming", 2011; Acary, Armand, Nguyen, Shpakovych, Optim. Methods Softw. 2023 (friction).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.linear.factors import Factor, SingularMatrix, factorise
from fcsim.problem.shifted_factor import ShiftedInverse
from fcsim.solvers.base import Iterate, Status
from fcsim.solvers.interior_point.cones import ConeAlgebra, NesterovTodd
from fcsim.solvers.variational.conic import scaled_program
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import Watch


def _direction(
    system: Factor,
    V: NesterovTodd,
    algebra: ConeAlgebra,
    program: tuple[Matrix, sp.csr_array, sp.csr_array],
    rx: FloatArray,
    rz: FloatArray,
    target: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """dx and the scaled V^-1 ds, V dz with P dx + A^T dz = -rx, A dx + ds = -rz, point o (V^-1 ds + V dz) = target.

    The scaled pair sums up to b = point \\ target: nothing cancels where s or z is near the boundary. One step of iterative refinement.
    """
    P, A, AT = program
    b = algebra.divide(V.point, target)
    rhs = -rx - AT @ V.apply(V.apply(rz, inverse=True) + b, inverse=True)
    dx = system.solve(rhs)
    dx = dx + system.solve(rhs - P @ dx - AT @ V.apply(V.apply(A @ dx, inverse=True), inverse=True))
    dz = V.apply(A @ dx + rz, inverse=True) + b
    return dx, b - dz, dz


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # the last iterations may meet infinity: they end there
def primal_dual(vi: Inequality, r: FloatArray, watch: Watch, max_iterations: int = 60) -> Iterate:
    """The program by our primal-dual method; one Cholesky factorisation of P + A^T V^-2 A an iteration."""
    status = watch.visit(vi.project(r), None, True)
    if status is not None:
        return Iterate(vi.project(r), status)
    rows, P, c, scale = scaled_program(vi)
    algebra = ConeAlgebra(rows)
    A, AT = rows.A, sp.csr_array(rows.A.T)
    program = P, A, AT

    def factor(V2: sp.csr_array) -> Factor:
        weight = sp.coo_array(AT @ V2 @ A)
        weight.sum_duplicates()
        if not isinstance(P, np.ndarray):
            return factorise(sp.csr_array(P + sp.csr_array(weight)))
        matrix = P.copy()
        matrix[weight.coords] += weight.data
        return ShiftedInverse(matrix) if vi.operator.symmetric else factorise(matrix)

    # step 0: the minimiser without cones gives x, s and z, pushed inside
    x = factor(sp.eye_array(len(rows.h), format="csr")).solve(AT @ rows.h - c)
    z = A @ x - rows.h
    s = -z + max(0.0, 1e-2 * np.abs(z).max(initial=1.0) - algebra.least(-z)) * algebra.identity
    z = z + max(0.0, 1e-2 * np.abs(z).max(initial=1.0) - algebra.least(z)) * algebra.identity
    answer, least = vi.project(r), np.inf
    for _ in range(max_iterations):
        rx, rz = P @ x + c + AT @ z, A @ x + s - rows.h
        gap = float(s @ z)
        candidate = np.zeros_like(r)
        candidate[rows.free] = scale * x
        candidate = vi.project(candidate)
        if not (np.all(np.isfinite(candidate)) and gap > 1e-20):  # as far as floating point goes
            break
        u = vi.velocity(candidate)
        residual = vi.residual(candidate, u, watch.compliance)
        if residual < least:
            answer, least = candidate, residual
        status = watch.visit(candidate, u, residual <= watch.target)
        if status is not None:
            return Iterate(candidate if status is Status.SOLVED else answer, status)
        try:
            V = NesterovTodd(rows, s, z)  # step 1: scaling and factorisation
            V2 = V.inverse_square()
            system = factor(V2)
        except (SingularMatrix, FloatingPointError):
            break

        squared = algebra.product(V.point, V.point)
        dx, ds, dz = _direction(system, V, algebra, program, rx, rz, -squared)  # step 2: predictor
        t = min(algebra.longest_step(V.point, ds), algebra.longest_step(V.point, dz))
        sigma = (1 - t) ** 3
        centre = sigma * gap / algebra.degree * algebra.identity
        target = centre - squared - algebra.product(ds, dz)
        dx, ds, dz = _direction(system, V, algebra, program, (1 - sigma) * rx, (1 - sigma) * rz, target)  # step 3: corrector
        t = min(1.0, 0.99 * min(algebra.longest_step(V.point, ds), algebra.longest_step(V.point, dz)))
        x, s, z = x + t * dx, s + t * V.apply(ds), z + t * V.apply(dz, inverse=True)
        watch.tick()
        if t < 1e-8:
            break
    return Iterate(answer, Status.STAGNATED)
