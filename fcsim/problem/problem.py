"""The frictional contact problem in its two forms, its one error and the unit-true checks.

Global form: M v = H r + G l + f, G^T v + b = 0, u = H^T v + w, K* ∋ u + g(u) ⊥ r ∈ K. Local form: u = W r + V l + q,
V^T r + R l + s = 0 with the Delassus operator W. The symbols are those of FCLIB (Acary et al., INRIA report RT-0444).
In dynamics v, u are velocities [m/s] and r impulses [N s]; in quasi-statics v, u are displacement increments [m] and r forces [N].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, Matrix
from fcsim.errors import InputError
from fcsim.problem._judge_kernels import squared_natural_residual, violations
from fcsim.problem.cone import tangential_norm
from fcsim.problem.delassus import Delassus


def _vector(values: Any, what: str) -> FloatArray:
    try:
        vector = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what}: expected a vector of numbers, got {type(values).__name__} of something else") from None
    if vector.ndim != 1:
        raise InputError(f"{what}: expected a vector, got shape {vector.shape}")
    if not np.all(np.isfinite(vector)):
        raise InputError(f"{what}: expected finite numbers, got NaN or infinity in {np.count_nonzero(~np.isfinite(vector))} entries")
    return vector


def _matrix(values: Any, what: str, shape: tuple[int, int]) -> Matrix:
    if not sp.issparse(values):
        values = np.asarray(values, dtype=np.float64)
    elif not isinstance(values, sp.sparray) or values.format not in ("csr", "csc", "bsr", "coo"):
        values = sp.csr_array(values)
    if tuple(values.shape) != shape:
        raise InputError(f"{what}: expected shape {shape}, got {tuple(values.shape)}")
    entries = values.data if sp.issparse(values) else values
    with np.errstate(over="ignore", invalid="ignore"):
        finite = np.isfinite(entries.sum())  # no array of booleans as large as the matrix
    if not finite and not np.all(np.isfinite(entries)):
        raise InputError(f"{what}: expected finite numbers, got NaN or infinity")
    return values


def _friction(mu: Any, m: int, dimension: int) -> FloatArray:
    if dimension not in (2, 3):
        raise InputError(f"dimension: expected 2 or 3, got {dimension}")
    mu = _vector(mu, "mu")
    if len(mu) * dimension != m:
        raise InputError(f"mu: expected {m // dimension} friction coefficients for {m} contact unknowns in {dimension}D, got {len(mu)}")
    if np.any(mu < 0):
        raise InputError(f"mu: expected friction coefficients >= 0, got {mu.min()} at contact {int(mu.argmin())}")
    return mu


@dataclass(frozen=True, eq=False)
class GlobalProblem:
    """M (n, n), H (n, m), f (n,), w (m,), mu (nc,), optionally G (n, p) and b (p,); m = dimension * nc."""

    M: Matrix
    H: Matrix
    f: FloatArray
    w: FloatArray
    mu: FloatArray
    G: Matrix | None = None
    b: FloatArray | None = None
    dimension: int = 3

    def __post_init__(self) -> None:
        f, w = _vector(self.f, "f"), _vector(self.w, "w")
        object.__setattr__(self, "f", f)
        object.__setattr__(self, "w", w)
        object.__setattr__(self, "mu", _friction(self.mu, len(w), self.dimension))
        object.__setattr__(self, "M", _matrix(self.M, "M", (len(f), len(f))))
        object.__setattr__(self, "H", _matrix(self.H, "H", (len(f), len(w))))
        if (self.G is None) != (self.b is None):
            raise InputError("G and b: expected both or none of the equality constraints' matrix and vector")
        if self.G is not None:
            b = _vector(self.b, "b")
            object.__setattr__(self, "b", b)
            object.__setattr__(self, "G", _matrix(self.G, "G", (len(f), len(b))))

    @property
    def n(self) -> int:
        return len(self.f)

    @property
    def m(self) -> int:
        return len(self.w)

    @property
    def nc(self) -> int:
        return len(self.mu)


@dataclass(frozen=True, eq=False)
class LocalProblem:
    """W (m, m), q (m,), mu (nc,), optionally V (m, p), R (p, p) and s (p,); m = dimension * nc."""

    W: Matrix
    q: FloatArray
    mu: FloatArray
    V: Matrix | None = None
    R: Matrix | None = None
    s: FloatArray | None = None
    dimension: int = 3

    def __post_init__(self) -> None:
        q = _vector(self.q, "q")
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "mu", _friction(self.mu, len(q), self.dimension))
        object.__setattr__(self, "W", _matrix(self.W, "W", (len(q), len(q))))
        if not (self.V is None) == (self.R is None) == (self.s is None):
            raise InputError("V, R and s: expected all or none of the equality constraints' matrices and vector")
        if self.V is not None:
            s = _vector(self.s, "s")
            object.__setattr__(self, "s", s)
            object.__setattr__(self, "V", _matrix(self.V, "V", (len(q), len(s))))
            object.__setattr__(self, "R", _matrix(self.R, "R", (len(s), len(s))))

    @property
    def m(self) -> int:
        return len(self.q)

    @property
    def nc(self) -> int:
        return len(self.mu)

    @cached_property
    def delassus(self) -> Delassus:
        """W with what is derived from it once: what solvers work on."""
        return Delassus(self.W, self.dimension)

    @property
    def diagonal_blocks(self) -> FloatArray:
        """The contacts' own blocks W_aa (nc, d, d)."""
        return self.delassus.diagonal_blocks


def natural_map_residual(r: FloatArray, u: FloatArray, mu: FloatArray, dimension: int = 3) -> float:
    """Return ||r - P_K(r - (u + g(u)))||, the numerator of the error, for flat r and u (m,).

    With z = r - (u + g(u)) it is u + g(u) + (z - P_K(z)): so written, a small u is not lost beside a large r, whose difference with
    itself would be zero wherever r grows without bound.
    """
    return math.sqrt(squared_natural_residual(r, u, mu, dimension))


def error(problem: LocalProblem, r: FloatArray, u: FloatArray | None = None, floor: float = 0.0) -> float:
    """Return ||r - P_K(r - (u + g(u)))|| / max(||q||, floor) with u = W r + q (eq. 13 of Acary, Brémond, Huber 2018).

    `u` may be given where W r + q was just computed. `floor`, in the unit of q, keeps the error meaningful where q is nothing but
    the round-off of a state at rest, as in a simulation's first step: r = 0 is then the answer.
    """
    if u is None:
        u = problem.W @ r + problem.q
    residual = natural_map_residual(r, u, problem.mu, problem.dimension)
    if residual == 0:
        return 0.0
    scale = max(float(np.linalg.norm(problem.q)), floor)
    return residual / scale if scale > 0 else float("inf")


@dataclass(frozen=True)
class Checks:
    """What the error mixes, each on its own; every number is zero at an exact solution.

    cone             max (||r_T|| - mu r_N)_+ / max |r|
    dual_cone        max (mu ||u_T|| - (u + g(u))_N)_+ / max |u|
    complementarity  |r . (u + g(u))| / (||r|| ||u||); here and above q stands in for u where it is larger: all contacts may stick
    penetration      max (-u_N)_+, in the unit of u (times h: metres a step)
    momentum         ||M v - H r - G l - f|| / ||f||, None for a problem given in local form
    """

    cone: float
    dual_cone: float
    complementarity: float
    penetration: float
    momentum: float | None = None


def check(
    r: FloatArray, u: FloatArray, mu: FloatArray, dimension: int = 3, momentum: float | None = None, q: FloatArray | None = None
) -> Checks:
    """Compute the unit-true checks of flat r and u (m,); q (m,), the velocity without reactions, keeps u = 0 up to round-off small."""
    if len(mu) == 0:
        return Checks(0.0, 0.0, 0.0, 0.0, momentum)
    found = violations(r, u, u if q is None else q, mu, dimension)
    cone, dual_cone, penetration, product, r_max, u_max, r_size, u_size = found
    return Checks(
        cone=cone / (r_max or 1.0),
        dual_cone=dual_cone / (u_max or 1.0),
        complementarity=abs(product) / ((r_size * u_size) or 1.0),
        penetration=penetration,
        momentum=momentum,
    )


OPEN, STICK, SLIP = 0, 1, 2


def contact_status(r: FloatArray, mu: FloatArray, dimension: int = 3, tolerance: float = 1e-6) -> NDArray[np.int8]:
    """Return OPEN (no normal reaction), STICK (inside the cone) or SLIP (on its boundary) of every contact (nc,).

    `tolerance` is relative: to the largest reaction for open, to mu r_N for slip.
    """
    r2 = r.reshape(-1, dimension)
    status = np.full(len(mu), STICK, dtype=np.int8)
    status[tangential_norm(r2) >= (1 - tolerance) * mu * r2[:, 0]] = SLIP
    status[r2[:, 0] <= tolerance * np.abs(r).max(initial=0.0)] = OPEN
    return status
