"""Sizes and mathematical properties of a problem: contact density, symmetry, rank and condition of W."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigvalsh, svdvals

from fcsim.linear.storage import SUM_UP_TO
from fcsim.problem import GlobalProblem, LocalProblem

SYMMETRIC_UP_TO = 1e-10
"""max |W - W^T| / max |W| of a matrix that counts as symmetric: W carries the round-off of M^-1."""


@dataclass(frozen=True)
class Properties:
    """Of a problem and its Delassus operator W (m, m).

    n, density = m / n   None where the global problem is not known
    fill                 nonzero entries / m^2
    asymmetry            max |W - W^T| / max |W|
    rank, condition      singular values above m eps sigma_max, and sigma_max over the smallest of those; None where not estimated
    friction             the smallest and the largest coefficient
    """

    dimension: int
    nc: int
    n: int | None
    m: int
    fill: float
    asymmetry: float
    rank: int | None
    condition: float | None
    friction: tuple[float, float]

    @property
    def density(self) -> float | None:
        return self.m / self.n if self.n else None

    @property
    def symmetric(self) -> bool:
        return self.asymmetry <= SYMMETRIC_UP_TO

    @property
    def text(self) -> str:
        """As math_info says it, with how rank and condition were found."""
        words = [f"n = {self.n}"] if self.n is not None else []
        words += [f"nc = {self.nc}", f"m = {self.m}"]
        words += [f"contact density m/n = {self.density:.4g}"] if self.density is not None else []
        if not self.m:
            return ", ".join(words)
        words.append(f"W: {100 * self.fill:.3g} % of its entries are not zero")
        words.append(f"{'symmetric' if self.symmetric else 'unsymmetric'} (max |W - W^T| / max |W| = {self.asymmetry:.1e})")
        if self.rank is None or self.condition is None:
            words.append("rank and condition not estimated")
        else:
            values = "eigenvalues" if self.symmetric else "singular values"
            words.append(
                f"rank {self.rank} of {self.m}, condition {self.condition:.3g} (all {values}; those up to m eps max count as zero)"
            )
        return ", ".join(words)


def properties(problem: GlobalProblem | LocalProblem, local: LocalProblem, spectrum_up_to: int = SUM_UP_TO) -> Properties:
    """Describe `problem`, whose local form is `local`; rank and condition up to `spectrum_up_to` contact unknowns.

    All eigenvalues (LAPACK syevd) of a symmetric W, all singular values (gesdd) of another: of order m^3, 0.8 s at m = 2064.
    """
    W, m = local.W, local.m
    largest = float(abs(W).max()) if m else 0.0
    asymmetry = float(abs(W - W.T).max()) / largest if largest else 0.0
    rank = condition = None
    if m <= spectrum_up_to:
        dense = W if isinstance(W, np.ndarray) else W.toarray()
        values = np.abs(eigvalsh(dense)) if asymmetry <= SYMMETRIC_UP_TO else svdvals(dense)
        kept = values[values > m * np.finfo(float).eps * values.max(initial=0.0)]
        rank, condition = len(kept), float(kept.max() / kept.min()) if len(kept) else None
    nonzero = np.count_nonzero(W) if isinstance(W, np.ndarray) else W.count_nonzero()
    mu = problem.mu if problem.nc else np.zeros(1)
    return Properties(
        dimension=problem.dimension,
        nc=problem.nc,
        n=problem.n if isinstance(problem, GlobalProblem) else None,
        m=m,
        fill=int(nonzero) / m**2 if m else 0.0,
        asymmetry=asymmetry,
        rank=rank,
        condition=condition,
        friction=(float(mu.min()), float(mu.max())),
    )
