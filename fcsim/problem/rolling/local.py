"""The local form of a problem with rolling friction, in variables that do not depend on the units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.brief import brief
from fcsim.problem.delassus import Delassus
from fcsim.problem.problem import Answer
from fcsim.problem.reduction import Reduction, reduce
from fcsim.problem.rolling.problem import GlobalRollingProblem


@dataclass(frozen=True, eq=False)
class LocalRollingProblem:
    """u = W r + q, K* ∋ u + g(u) ⊥ r ∈ K with W (m, m), q (m,), mu (nc,), mu_r (nc,), m = 5 nc, and with mu_s (nc,) m = 6 nc; all without a
    unit of length between forces and moments: see `RollingReduction`.
    """

    W: Matrix
    q: FloatArray
    mu: FloatArray
    mu_r: FloatArray
    mu_s: FloatArray | None = None

    __repr__ = brief

    @property
    def dimension(self) -> int:
        return 5 if self.mu_s is None else 6

    @property
    def spinning(self) -> FloatArray:
        """mu_s (nc,), zeros without spinning friction."""
        return np.zeros_like(self.mu) if self.mu_s is None else self.mu_s

    @cached_property
    def delassus(self) -> Delassus:
        return Delassus(self.W, self.dimension)


@dataclass(frozen=True, eq=False)
class RollingReduction:
    """A global problem with rolling friction and the way to its local form.

    The local form has forces and moments in one unit. With a length l_a of each contact, r_R = l r'_R, u'_R = l u_R and mu_r' = mu_r / l;
    l^2 = (tr W_FF / 3) / (tr W_RR / 2), F the forces, the length at which moments turn the bodies as easily as forces move them (of a solid
    sphere about its radius); with a spinning moment, of R and S, tr / 3. So neither the answer nor the error depends on the units of mass,
    length and time.
    """

    problem: GlobalRollingProblem
    reduction: Reduction

    __repr__ = brief

    @cached_property
    def W(self) -> Matrix:
        """The Delassus operator (m, m) in the problem's own units."""
        return self.reduction.delassus(1)

    @cached_property
    def length(self) -> FloatArray:
        """l (nc,) [m]; where nothing turns or moves, mu_r or mu_s, and where they are zero too, 1."""
        own = np.array(self.W.diagonal()).reshape(-1, self.problem.dimension)
        moving, turning = own[:, :3].mean(axis=1), own[:, 3:].mean(axis=1)
        known = (moving > 0) & (turning > 0)
        longest = self.problem.mu_r if self.problem.mu_s is None else np.maximum(self.problem.mu_r, self.problem.mu_s)
        otherwise = np.where(longest > 0, longest, 1.0)
        return np.where(known, np.sqrt(np.where(known, moving, 1.0) / np.where(known, turning, 1.0)), otherwise)

    @cached_property
    def scale(self) -> FloatArray:
        """(m,) with r = scale r', u' = scale u."""
        scale = np.ones((self.problem.nc, self.problem.dimension))
        scale[:, 3:] = self.length[:, None]
        return scale.ravel()

    @cached_property
    def local(self) -> LocalRollingProblem:
        """The local form in r', u'."""
        p, W, scale = self.problem, self.W, self.scale
        if sp.issparse(W):
            scaling = sp.diags_array(scale)
            scaled = sp.bsr_array(scaling @ sp.csr_array(W) @ scaling, blocksize=(p.dimension, p.dimension))
        else:
            scaled = scale[:, None] * W * scale
        spinning = None if p.mu_s is None else p.mu_s / self.length
        return LocalRollingProblem(scaled, scale * self.reduction.q, p.mu, p.mu_r / self.length, spinning)

    def answer(self, r: FloatArray) -> Answer:
        """u, v, l from r (m,), all in the problem's own units."""
        return self.reduction.answer(r)


def reduce_rolling(problem: GlobalRollingProblem) -> RollingReduction:
    """Return the reduction; its equations are those without rolling friction, with five or six unknowns a contact."""
    return RollingReduction(problem, reduce(problem))
