"""The two splittings of ADMM: what a linear step, a projection and the answer are in the local and in the global form.

Both factor once for each rho; the local one can go on with the factor of an earlier, nearly equal W.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear.factors import Factor, factorise
from fcsim.problem import Delassus
from fcsim.problem.distributed import DistributedFactor
from fcsim.problem.reduction import Reduction
from fcsim.solvers.base import Monitor
from fcsim.solvers.memory import Kept
from fcsim.solvers.variational.convex_sets import Cone
from fcsim.solvers.variational.inequality import Inequality, coulomb_term

STALE = 0.2
"""Contraction up to which the factor of an earlier W serves."""


@dataclass(frozen=True, eq=False)
class SplittingFactor(Kept):
    """The factor of W + (rho + eta) I of an earlier W."""

    rho: float
    eta: float
    factor: Factor


def forget_factor(monitor: Monitor | None) -> None:
    """Take the splitting's factor out of the memory, if there is one."""
    if monitor is not None and monitor.memory is not None:
        monitor.memory = monitor.memory.without(SplittingFactor)


class LocalSplitting:
    """z = r in C, -rho zeta = u + g in C*; `gain` and `dual_gain` carry the primal and the dual residual over to the natural one.

    With the factor of an earlier W, which a simulation keeps, the linear step is one of iterative refinement from the last x: the fixed
    point is the same, and where W has changed by less than rho the iterates hardly differ. So it is with a factor that is not exact.
    """

    def __init__(self, vi: Inequality, symmetric: bool, monitor: Monitor | None = None, eta: float = 0.0) -> None:
        """monitor: whose memory has earlier factors and takes this one's; eta: weight of the proximal term on x."""
        self._vi, self._symmetric, self._monitor, self._eta = vi, symmetric, monitor, eta
        self.dual_gain = 1.0
        self._before, self._moved = np.empty(0), 0.0  # the last x where there is a proximal term, and as `moved`
        self._x: FloatArray | None = None  # the last x where the factor is not this W's, or not exact

    def set_rho(self, rho: float) -> None:
        self.rho = rho
        self.gain = self._vi.operator.norm
        self._x = None
        forget_factor(self._monitor)  # the old one makes room for the new
        self._factor = self._vi.factor(rho + self._eta, self._symmetric)
        if isinstance(self._factor, DistributedFactor) and not self._factor.exact:
            self._x = np.zeros(self._vi.operator.size)
        if self._monitor is not None and self._monitor.memory is not None:
            memory = self._monitor.memory
            self._monitor.memory = memory.having(SplittingFactor(memory.identity, rho, self._eta, self._factor))

    def resume(self, rho: float) -> bool:
        """Go on with the factor that was kept if it is for about this rho and W has changed little; say whether that is so."""
        memory, size = None if self._monitor is None else self._monitor.memory, self._vi.operator.size
        kept = None if memory is None else memory.of_same_contacts(SplittingFactor)
        if kept is None or not 0.9 * rho <= kept.rho <= 1.1 * rho or not 0.9 * self._eta <= kept.eta <= 1.1 * self._eta:
            return False
        earlier, factor = kept.rho, kept.factor
        x = np.random.default_rng(0).standard_normal(size)
        for _ in range(2):  # x - (W_earlier + rho I)^-1 (W + rho I) x, in its direction of least contraction
            before = float(np.linalg.norm(x))
            x = x - factor.solve(self._vi.operator.affine(x, (earlier + kept.eta) * x))
            if not np.linalg.norm(x) <= STALE * before:
                return False
        self.rho, self.gain, self._factor, self._eta = earlier, self._vi.operator.norm, factor, kept.eta
        self._x = np.zeros(size)
        return True

    @property
    def condition(self) -> float:
        """lambda_max / lambda_min of W, the latter no less than 1e-6 of the former and than eta."""
        return self._vi.operator.norm / max(self._vi.operator.least_singular_value, self._eta)

    @property
    def moved(self) -> float:
        """eta ||x - x_before|| of the last linear step, what the proximal term adds to the dual residual at the most."""
        return self._moved

    def start(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        z = self._vi.project(r)
        if self._x is not None:
            self._x = z
        self._before, self._moved = z, 0.0
        return z, -self._vi.map(self._vi.velocity(z)) / self.rho

    def linear(self, a: FloatArray, g: FloatArray | float) -> FloatArray:
        b = self.rho * a - self._vi.q - g
        if not self._eta:
            return self._solved(b)
        x = self._solved(b + self._eta * self._before)
        self._before, self._moved = x, self._eta * float(np.linalg.norm(x - self._before))
        return x

    def _solved(self, b: FloatArray) -> FloatArray:
        """(W + (rho + eta) I)^-1 b, or what one iteration makes of the last x."""
        if self._x is None:
            return self._factor.solve(b)
        self._x = self._x + self._factor.solve(b - self._vi.operator.affine(self._x, (self.rho + self._eta) * self._x))
        return self._x

    def project(self, y: FloatArray) -> FloatArray:
        return self._vi.project(y)

    def velocity(self, z: FloatArray, zeta: FloatArray) -> FloatArray:
        return -self.rho * zeta

    def answer(self, z: FloatArray, zeta: FloatArray) -> FloatArray:
        return z


class GlobalSplitting:
    """z = u + g in K*, -rho zeta = r in K; M + rho H H^T, bordered by G, is factored."""

    def __init__(self, reduction: Reduction) -> None:
        p = reduction.problem
        self._problem, self._reduction = p, reduction
        self._H, self._HT = sp.csr_array(p.H), sp.csr_array(p.H.T)
        self._M, self._HHT = sp.csr_array(p.entries), sp.csr_array(self._H @ self._HT)
        self._compliance = float(reduction.compliance.mean()) if p.nc else 1.0
        self._cone = Inequality(Delassus(np.empty((0, 0)), p.dimension), p.w, Cone(p.mu))

    def set_rho(self, rho: float) -> None:
        self.rho = rho
        self.gain, self.dual_gain, self.moved = 1.0, self._compliance, 0.0
        A = self._M + rho * self._HHT
        G = self._problem.G
        if G is not None:
            A = sp.block_array([[A, -sp.csr_array(G)], [-sp.csr_array(G).T, None]])
        self._factor = factorise(sp.csr_array(A))

    def start(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        p = self._problem
        r = self._cone.project(r)
        u = self._HT @ self._reduction.velocity(r)[0] + p.w
        return u + coulomb_term(u, p.mu, p.dimension), -r / self.rho

    def linear(self, a: FloatArray, g: FloatArray | float) -> FloatArray:
        p = self._problem
        rhs = p.f + self.rho * (self._H @ (a - p.w - g))
        v = self._factor.solve(rhs if p.b is None else np.concatenate([rhs, p.b]))[: p.n]
        return self._HT @ v + p.w + g

    def project(self, y: FloatArray) -> FloatArray:
        return y + self._cone.project(-y)  # Moreau: P_K*(y) = y + P_K(-y)

    def velocity(self, z: FloatArray, zeta: FloatArray) -> FloatArray:
        return z

    def answer(self, z: FloatArray, zeta: FloatArray) -> FloatArray:
        return -self.rho * zeta
