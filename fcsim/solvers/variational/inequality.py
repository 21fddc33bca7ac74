"""The problem as a variational inequality on a product of convex sets, the common ground of projection, splitting and QP methods.

Find r in C with F(r) . (s - r) >= 0 for all s in C. Three readings (Acary, Brémond, Huber 2018, Sections 3 and 4):

* Coulomb: C = K, F(r) = u + g(u), u = W r + q; not the gradient of anything;
* given sliding s (Acary, Cadoux, Lemaréchal, Malick 2011): C = K, F(r) = W r + q + mu s N, a convex QP over second-order cones;
* given threshold (Tresca): C = {r_N >= 0, ||r_T|| <= mu p}, F(r) = W r + q, a convex QP over half-cylinders.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.factors import Factor
from fcsim.problem import Delassus, LocalProblem
from fcsim.solvers.variational._set_kernels import add_de_saxce, de_saxce_term
from fcsim.solvers.variational.convex_sets import Cone, ConvexSet

FACTORS = 4
"""Factors that are kept at a time: more than the rhos between which a method goes back and forth."""


def coulomb_term(u: FloatArray, mu: FloatArray, dimension: int) -> FloatArray:
    """De Saxcé's g(u) = (mu ||u_T||, 0, 0) for flat u (m,)."""
    return de_saxce_term(u, mu, dimension)


class Factors:
    """The last factors of W + rho I of one operator, by rho; they live as long as the method that holds them."""

    def __init__(self) -> None:
        self._made: dict[tuple[float, bool], Factor] = {}

    def of(self, operator: Delassus, rho: float, symmetric: bool) -> Factor:
        """The factor for rho, made where it is not there."""
        key = (rho, symmetric)
        if key not in self._made:
            if len(self._made) >= FACTORS:
                del self._made[next(iter(self._made))]
            self._made[key] = operator.factor(rho, symmetric=symmetric)
        return self._made[key]


@dataclass(frozen=True, eq=False)
class Inequality:
    """Find r in C with F(r) . (s - r) >= 0, F(r) = W r + q [+ g(W r + q) with the friction coefficients mu where given].

    factors: of operator + rho I, shared by the inequalities of one operator.
    """

    operator: Delassus
    q: FloatArray
    convex_set: ConvexSet
    mu: FloatArray | None = None
    factors: Factors = field(default_factory=Factors)

    @staticmethod
    def coulomb(problem: LocalProblem) -> Inequality:
        """Coulomb's law by De Saxcé's term: C = K, F(r) = u + g(u)."""
        return Inequality(problem.delassus, problem.q, Cone(problem.mu), problem.mu)

    @property
    def lipschitz(self) -> float:
        """The Lipschitz constant of F: ||W|| times that of u -> u + g(u), the largest singular value of [[1, mu], [0, 1]]."""
        mu = 0.0 if self.mu is None else float(self.mu.max(initial=0.0))
        return self.operator.norm * 0.5 * (mu + np.sqrt(mu * mu + 4))

    def velocity(self, r: FloatArray) -> FloatArray:
        """u = W r + q (m,)."""
        return self.operator.affine(r, self.q)

    def factor(self, rho: float, symmetric: bool) -> Factor:
        """The factor of W + rho I, computed once for each rho: Cholesky where symmetric, LU otherwise."""
        return self.factors.of(self.operator, rho, symmetric)

    def map(self, u: FloatArray) -> FloatArray:
        """F (m,) where u = W r + q is known."""
        if self.mu is None:
            return u
        F = np.empty_like(u)
        add_de_saxce(self._rows(u), self.mu, self._rows(F))
        return F

    def term(self, u: FloatArray) -> FloatArray | float:
        """g(u) (m,), by which F differs from u; 0 without friction coefficients."""
        return 0.0 if self.mu is None else coulomb_term(u, self.mu, self.operator.dimension)

    def project(self, z: FloatArray) -> FloatArray:
        """Return P_C(z)."""
        return self.step(z, z, 0.0)[0]

    def step(self, r: FloatArray, F: FloatArray, rho: float) -> tuple[FloatArray, float]:
        """Return P_C(r - rho F) and its distance to r."""
        out = np.empty_like(r)
        change = self.convex_set.step(self._rows(r), self._rows(F), rho, self._rows(out))
        return out, float(np.sqrt(change))

    def residual(self, r: FloatArray, u: FloatArray, compliance: FloatArray) -> float:
        """The natural residual ||s (r - P_C(r - F(r) / s))|| with the contacts' compliances s (nc,), in the unit of u."""
        s = compliance[:, None]
        moved = self.step(r, (self._rows(self.map(u)) / s).ravel(), 1.0)[0]
        return float(np.linalg.norm(s * self._rows(r - moved)))

    def _rows(self, x: FloatArray) -> FloatArray:
        return x.reshape(-1, self.operator.dimension)
