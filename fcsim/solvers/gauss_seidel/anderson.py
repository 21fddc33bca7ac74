"""NSGS-AA: Gauss-Seidel's sweeps as a fixed point, accelerated by Anderson's mixing of the last ones (type II), with restart.

With S a sweep, g_k = S(x_k) and f_k = g_k - x_k, the numbered steps are

    1. g = S(x), f = g - x
    2. ||f|| > restart * the least of this window: forget the window, x = g
    3. gamma = argmin || f - dF gamma ||,   x = g - dG gamma          dF, dG: differences of the last `window` f and g

in the norm of sqrt(s) r with the contacts' compliances s, which does not depend on units or on which bodies are heavy. The iterates that
count are those after a sweep, in the cone.

Sources: D. G. Anderson, J. ACM 12, 1965; H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49, 2011 (type II, least squares in differences).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.block_rows import embed_vector
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.gauss_seidel._anderson_kernels import mix
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.gauss_seidel.rows import ContactRows
from fcsim.solvers.gauss_seidel.sweeps import SweepOptions, contact_order, iterate


@dataclass(frozen=True, kw_only=True)
class AndersonOptions(SweepOptions):
    """window: sweeps that are mixed; restart: growth of ||f|| over the least one of the window at which that is forgotten."""

    window: int = 5
    restart: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.integers_from(window=1)
        self.numbers_from(restart=1)


class Mixing:
    """Anderson's mixing of points x (k,) and their images g (k,), both in the variables whose norm counts."""

    def __init__(self, window: int, restart: float) -> None:
        self._window, self._restart = window, restart
        self._steps = np.empty((window, 0))
        self._forget()

    def _forget(self) -> None:
        self._points, self._least = 0, np.inf

    def _make_room(self, size: int) -> None:
        self._steps, self._images = np.zeros((self._window, size)), np.zeros((self._window, size))
        self._last_f, self._last_g = np.zeros(size), np.zeros(size)
        self._normal = np.zeros((self._window, self._window))

    def next(self, x: FloatArray, g: FloatArray) -> FloatArray:
        """Where to go after the point x with the image g."""
        f, following = g - x, g.copy()  # (1)
        if self._steps.shape[1] != len(x):
            self._make_room(len(x))
        size = float(np.linalg.norm(f))
        if not size <= self._restart * self._least:  # (2)
            self._forget()
        self._least = min(self._least, size)
        place, count = (self._points - 1) % self._window, min(self._points, self._window)
        self._points += 1
        mix(f, following, self._last_f, self._last_g, self._steps, self._images, self._normal, place, count)  # (3)
        return following


def anderson(
    problem: LocalProblem,
    r: FloatArray,
    monitor: Monitor,
    options: AndersonOptions,
    rows: ContactRows | None = None,
    mixing: Mixing | None = None,
) -> Iterate:
    """NSGS-AA from the starting point r (m,); rows: the problem's, where known already; mixing: the window that earlier sweeps left."""
    d, nc = problem.dimension, problem.nc
    solver = ONE_CONTACT[options.one_contact]
    if rows is None:
        rows = ContactRows.of(problem, solver.rho)
    reaction = embed_vector(r, d)
    order, frozen = contact_order(nc, options), np.zeros(nc, dtype=np.int64)
    root = np.sqrt(problem.compliance)[:, None]
    mixing, start = mixing or Mixing(options.window, options.restart), reaction.copy()

    def sweep(tolerance: float, tau: float, count: int) -> tuple[float, int]:
        nonlocal start
        light, done = np.inf, 0
        while done < count:
            done += 1
            reaction[:] = start
            change, size, _, _ = solver.sweep(
                *(rows.indptr, rows.indices, rows.blocks, rows.diagonal, rows.shift, rows.q, rows.mu, rows.rho, order(), reaction, frozen),
                *(float(tolerance), options.local_iterations, options.relaxation, False, 0, 0.0, 1, 0.0),
            )
            light = float(np.sqrt(change / size)) if size > 0 else float(change)
            if not light > (tau if options.error_evaluation == "light" else 0.0):  # NaN ends it too
                break
            start = (mixing.next((root * start).ravel(), (root * reaction).ravel()).reshape(-1, 3)) / root
        return light, done

    def point() -> tuple[FloatArray, FloatArray]:
        return reaction[:, :d].flatten(), rows.velocity(reaction)[:, :d].flatten()

    return iterate(sweep, point, nc, monitor, options)
