"""The derivative of the local problem's solution (r, u) with respect to W, q and mu.

With the statuses fixed, each contact's law is the smooth equation of

    open        dr = 0
    sticking    du = 0
    sliding     du_N = 0,    dr_T + mu t dr_N + (mu r_N / ||u_T||) (1 - t t^T) du_T = -t r_N dmu,    t = u_T / ||u_T||

(r_T = -mu r_N t differentiated), and du = W dr + dW r + dq. Eliminating du gives one linear system for the reactions of the closed
contacts, in impulses scaled by the roots of the contacts' compliances and rows divided by 1 + s mu r_N / ||u_T||, so that its entries are
about 1 in all units. `forward` takes changes of the data through it, `backward` gradients of a scalar back through its transpose.

Source: the implicit function theorem (U. Dini 1878; for generalised equations Robinson, Math. Oper. Res. 5, 1980); the equations are ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray, Matrix
from fcsim.errors import InputError
from fcsim.linear.factors import DenseLU, SingularMatrix, SuperLU
from fcsim.linear.singularity import refuse_singular
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.problem import OPEN, SLIP, STICK, LocalProblem
from fcsim.solvers.derivative.outer import OuterProduct, checked_change

DENSE_UP_TO = 3000
"""Unknowns of closed contacts up to which their system is factored as a dense matrix."""


@dataclass(frozen=True, eq=False)
class Change:
    """Changes of r (m,), u (m,) and v (n,), None for a problem in local form, for a change of the data."""

    r: FloatArray
    u: FloatArray
    v: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Gradient:
    """The gradient of a scalar with respect to W, q (m,) and mu (nc,); NaN in mu where a contact without friction does not move."""

    W: OuterProduct
    q: FloatArray
    mu: FloatArray


@dataclass(frozen=True, eq=False)
class LocalDerivative:
    """At the solution (r, u) with these statuses (nc,): OPEN, STICK or SLIP of `fcsim.problem`.

    active (k,): the unknowns of closed contacts; law_u, law_r (closed, d, d): dF/du, dF/dr of their equations, and law_mu (closed, d)
    minus dF/dmu, all scaled; scale (k,): the roots of the compliances; the system's factor.
    """

    problem: LocalProblem
    r: FloatArray
    u: FloatArray
    status: NDArray[np.int8]
    active: IntArray
    law_u: FloatArray
    law_r: FloatArray
    law_mu: FloatArray
    scale: FloatArray
    factor: DenseLU | SuperLU | None

    def forward(self, *, W: Matrix | None = None, q: FloatArray | None = None, mu: FloatArray | None = None) -> Change:
        """How (r, u) changes with changes of W (m, m), q (m,) and mu (nc,), each 0 where not given."""
        m, nc = len(self.r), len(self.status)
        b = checked_direction(q, "q", (m,))
        if W is not None:
            b = b + checked_change(W, "W", (m, m)) @ self.r
        dmu = checked_direction(mu, "mu", (nc,))[self.closed]
        moved = np.where(dmu[:, None] == 0, 0.0, self.law_mu) * dmu[:, None]
        if not np.all(np.isfinite(moved)):
            raise InputError("mu: expected no change at contacts without friction that do not move: any friction would hold them")
        right = moved - np.einsum("aij,aj->ai", self.law_u, (b[self.active] / self.scale).reshape(moved.shape))
        dr = np.zeros(m)
        if self.factor is not None:
            dr[self.active] = self.factor.solve(right.ravel()) / self.scale
        return Change(dr, self.problem.W @ dr + b)

    def backward(self, *, r: FloatArray | None = None, u: FloatArray | None = None) -> Gradient:
        """The gradient of a scalar whose own gradients with respect to r and u (m,) are these, 0 where not given."""
        m, nc = len(self.r), len(self.status)
        onto_u = checked_direction(u, "u", (m,))
        onto_r = checked_direction(r, "r", (m,)) + self.problem.W.T @ onto_u
        onto_q, onto_mu = onto_u.copy(), np.zeros(nc)
        if self.factor is not None:
            z = self.factor.solve_transposed(onto_r[self.active] / self.scale).reshape(self.law_mu.shape)
            onto_q[self.active] -= np.einsum("aij,ai->aj", self.law_u, z).ravel() / self.scale
            onto_mu[self.closed] = np.einsum("ai,ai->a", z, self.law_mu)
        return Gradient(OuterProduct(onto_q, self.r), onto_q, onto_mu)

    @property
    def closed(self) -> IntArray:
        """The contacts that are not open."""
        return np.flatnonzero(self.status != OPEN)


def local_derivative(problem: LocalProblem, r: FloatArray, u: FloatArray, status: NDArray[np.int8]) -> LocalDerivative:
    """The derivative at a solution with these statuses; InputError where the reactions are not unique, so that they have none."""
    d = problem.dimension
    closed = np.flatnonzero(status != OPEN)
    active = (d * closed[:, None] + np.arange(d)).ravel()
    scale = np.sqrt(np.repeat(problem.compliance[closed], d))
    x, w = (r[active] * scale).reshape(-1, d), (u[active] / scale).reshape(-1, d)
    laws = _laws(x, w, problem.mu[closed], status[closed])
    factor = None
    if len(closed):
        W = sp.csr_array(problem.W)[active][:, active]
        inverse = sp.diags_array(1 / scale)
        factor = _factor(sp.csr_array(_block_diagonal(laws[0]) @ (inverse @ W @ inverse) + _block_diagonal(laws[1])))
    return LocalDerivative(problem, r, u, status, active, *laws, scale, factor)


def _laws(x: FloatArray, w: FloatArray, mu: FloatArray, status: NDArray[np.int8]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """dF/du, dF/dr (c, d, d) and -dF/dmu (c, d) of closed contacts with scaled reactions x and velocities w (c, d)."""
    count, d = x.shape
    law_u, law_r, law_mu = np.zeros((count, d, d)), np.zeros((count, d, d)), np.zeros((count, d))
    law_u[:, 0, 0] = 1.0  # du_N = 0
    stick, slide = status == STICK, status == SLIP
    law_u[stick, 1:, 1:] = np.eye(d - 1)
    speed = np.linalg.norm(w[slide, 1:], axis=1)
    t = w[slide, 1:] / np.where(speed > 0, speed, 1)[:, None]
    turning = mu[slide] * x[slide, 0] / np.where(speed > 0, speed, 1)  # mu r_N / ||u_T||
    share = 1 / (1 + turning)
    law_u[slide, 1:, 1:] = (share * turning)[:, None, None] * (np.eye(d - 1) - t[:, :, None] * t[:, None, :])
    law_r[slide, 1:, 1:] = share[:, None, None] * np.eye(d - 1)
    law_r[slide, 1:, 0] = (share * mu[slide])[:, None] * t
    law_mu[slide, 1:] = np.where((speed > 0)[:, None], -(share * x[slide, 0])[:, None] * t, np.nan)
    return law_u, law_r, law_mu


def _block_diagonal(blocks: FloatArray) -> sp.bsr_array:
    """The matrix with these blocks (c, d, d) on its diagonal."""
    count, d = blocks.shape[:2]
    return with_short_indices(sp.bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=(count * d, count * d)))


def _factor(J: sp.csr_array) -> DenseLU | SuperLU:
    """The factor of the closed contacts' system."""
    make: Callable[[], DenseLU | SuperLU] = (lambda: DenseLU(J.toarray())) if J.shape[0] <= DENSE_UP_TO else lambda: SuperLU(J)
    try:
        factor = make()
        refuse_singular(J, factor)
    except SingularMatrix:
        raise InputError(
            "derivative: expected reactions that are unique, got more of them than the bodies' velocities determine (as of a face in four "
            "points): such reactions have no derivative"
        ) from None
    return factor


def checked_direction(value: FloatArray | None, name: str, shape: tuple[int, ...]) -> FloatArray:
    """A change or gradient as floats, zeros where not given; InputError where it has another shape or no finite numbers."""
    if value is None:
        return np.zeros(shape)
    try:
        if np.iscomplexobj(value):  # whose imaginary part NumPy would drop
            raise TypeError
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected numbers of shape {shape}, got a {type(value).__name__}") from None
    if array.shape != shape:
        raise InputError(f"{name}: expected shape {shape}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise InputError(f"{name}: expected finite numbers, got NaN or infinity")
    return array
