"""Performance profiles: E. Dolan, J. Moré, "Benchmarking optimization software with performance profiles", Math. Program. 91, 2002."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import FloatArray
from fcsim.errors import InputError

RESOLUTION = 1e-6
"""[s] Times below are not told apart: what a clock of microseconds can see."""


@dataclass(frozen=True, eq=False)
class Profile:
    """The performance profile of a table of times.

    ratios           (problems, solvers) r_ps >= 1, infinity where unsolved
    unsolved_by_all  number of problems that no solver solved, counted in |P| unless they were left out
    left_out         whether they were
    """

    ratios: FloatArray
    unsolved_by_all: int
    left_out: bool = False

    @property
    def problems(self) -> int:
        """|P|"""
        return len(self.ratios)

    @property
    def solved(self) -> FloatArray:
        """(solvers,) rho_s(infinity): the fraction of the problems that each solver solved."""
        return np.isfinite(self.ratios).sum(axis=0) / max(self.problems, 1)

    @property
    def largest(self) -> float:
        """The largest finite ratio, from which on no curve changes; 1 where nothing was solved."""
        finite = self.ratios[np.isfinite(self.ratios)]
        return float(finite.max()) if finite.size else 1.0

    def rho(self, tau: ArrayLike) -> FloatArray:
        """rho_s(tau) = |{p: r_ps <= tau}| / |P|, of shape tau.shape + (solvers,)."""
        at = np.asarray(tau, dtype=float)
        counts = [np.searchsorted(column, at, side="right") for column in np.sort(self.ratios, axis=0).T]
        finite = np.isfinite(self.ratios).sum(axis=0)  # tau = infinity reaches what was solved
        return np.minimum(np.stack(counts, axis=-1), finite) / max(self.problems, 1)

    def steps(self, solver: int, tau_max: float) -> tuple[FloatArray, FloatArray]:
        """The corners (tau, rho) of one solver's curve from 1 to tau_max, to be joined by horizontals and then verticals ("post")."""
        column = self.ratios[:, solver]
        tau = np.unique(np.concatenate([[1.0, tau_max], column[column <= tau_max]]))
        return tau, self.rho(tau)[:, solver]

    def area(self, tau_max: float) -> FloatArray:
        """(solvers,) Mean of rho_s over log tau from 1 to tau_max: how high a curve lies in the figure."""
        if tau_max <= 1:
            return self.rho(1.0)
        reached = np.log(tau_max / np.minimum(self.ratios, tau_max)).sum(axis=0)  # every problem lifts the curve from its ratio on
        return reached / (np.log(tau_max) * max(self.problems, 1))

    def order(self, tau_max: float) -> list[int]:
        """Solvers from the top of the figure to its bottom: by rho at its right edge, then by area."""
        edge, area = self.rho(tau_max), self.area(tau_max)
        return sorted(range(self.ratios.shape[1]), key=lambda s: (-edge[s], -area[s], s))


def performance_profile(times: ArrayLike, *, resolution: float = RESOLUTION, leave_out_unsolved: bool = False) -> Profile:
    """Return the performance profile of times (problems, solvers) [s], infinity where unsolved.

        r_ps       = max(t_ps, d) / min_s max(t_ps, d),   infinity where t_ps is
        rho_s(tau) = |{p: r_ps <= tau}| / |P|

    with d = `resolution` [s] of the clock: a time of zero has no ratio, and times below d are ties. Equal times are ties too, all with
    ratio 1. A problem that no solver solved has no finite ratio; it counts in |P|, so that no curve reaches 1, unless
    `leave_out_unsolved`. Ratios are to the best of the solvers given: with others, they change.
    Raises InputError for another shape, NaN, negative times and a resolution that is not > 0.
    """
    t = np.array(times, dtype=float)
    if t.ndim != 2 or t.shape[1] == 0:
        raise InputError(f"times: expected an array (problems, solvers) with at least one solver, got shape {t.shape}")
    if np.isnan(t).any() or (t < 0).any():
        raise InputError("times: expected seconds >= 0, infinity where unsolved; got NaN or negative ones")
    if not 0 < resolution < np.inf:
        raise InputError(f"resolution: expected seconds > 0, got {resolution}")
    t = np.maximum(t, resolution)
    solvable = np.isfinite(t).any(axis=1)
    ratios = np.full_like(t, np.inf)
    ratios[solvable] = t[solvable] / t[solvable].min(axis=1, keepdims=True)
    return Profile(ratios[solvable] if leave_out_unsolved else ratios, int((~solvable).sum()), leave_out_unsolved)
