"""The global problem with rolling friction, as FCLIB files of five unknowns a contact carry it, and with spinning friction, of six."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, Matrix
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.problem.problem import GlobalForm, as_vector


@dataclass(frozen=True, eq=False)
class GlobalRollingProblem(GlobalForm):
    """M (n, n), H (n, m), f (n,), w (m,), mu (nc,), mu_r (nc,), optionally G (n, p), b (p,) and mu_s (nc,); m = 5 nc, 6 nc with mu_s.

    Each contact owns five entries of u and r, (N, T1, T2, R1, R2): force [N] and rolling moment [N m], or their impulses; with mu_s a
    sixth, S, the moment about the normal. The cone is ||r_T|| <= mu r_N, ||r_R|| <= mu_r r_N, |r_S| <= mu_s r_N, with mu_r, mu_s in
    metres (Acary, Bourrier, "Coulomb friction with rolling resistance as a cone complementarity problem", European Journal of Mechanics
    A/Solids 85, 2021, of the first two; FCLIB knows these alone).
    """

    M: Matrix
    H: Matrix
    f: FloatArray
    w: FloatArray
    mu: FloatArray
    mu_r: FloatArray
    G: Matrix | None = None
    b: FloatArray | None = None
    dimension: int = 5
    mu_s: FloatArray | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        rows = 5 if self.mu_s is None else 6
        if self.dimension != 5 and self.dimension != rows:
            raise InputError(f"dimension: expected 5 with rolling friction, 6 with spinning friction, mu_s, too, got {self.dimension}")
        object.__setattr__(self, "dimension", rows)
        self._check_vectors()
        self._check_matrices()
        for name in ("mu", "mu_r", "mu_s")[: rows - 3]:
            object.__setattr__(self, name, as_vector(getattr(self, name), name))
            coefficients = getattr(self, name)
            if rows * len(coefficients) != len(self.w):
                raise InputError(
                    f"{name}: expected {len(self.w) / rows:g} coefficients for {len(self.w)} contact unknowns, got {len(coefficients)}"
                )
            if np.any(coefficients < 0):
                raise InputError(f"{name}: expected coefficients >= 0, got {coefficients.min()} at contact {int(coefficients.argmin())}")
