"""How good reactions are: the two errors, the unit-true checks, and the status of each contact.

The published error (eq. 13) is what tables compare; the scaled one, the same natural map with all terms in the unit of a velocity, is
what decides whether a result is SOLVED. Every solver, table and file is judged here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SuperLU
from fcsim.problem._judge_kernels import squared_natural_residual, violations
from fcsim.problem.cone import LEAST_SIZE, enlargement, tangential_norm
from fcsim.problem.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduced


def natural_map_residual(r: FloatArray, u: FloatArray, mu: FloatArray, dimension: int = 3, compliance: FloatArray | None = None) -> float:
    """Return ||z - P_K(z - (u + g(u)))|| with z_a = s_a r_a, the numerator of the error, for flat r and u (m,).

    compliance: s (nc,) [velocity per impulse], None for 1 of whatever unit, the published form. With y = z - (u + g(u)) it is
    u + g(u) + (y - P_K(y)): so written, a small u is not lost beside a large r, whose difference with itself would be zero wherever r
    grows without bound.

    Where u_N < 0 a contact's part is at least |u_N| / sqrt(1 + mu^2), and may be no more: with mu = 1e8 no penetration would count for
    anything. So it is taken for at least |u_N| / sqrt(1 + min(mu, 10)^2), which also holds where u_N is lost beside mu ||u_T||; not in the
    published form.
    """
    published = compliance is None
    s = np.ones(len(mu)) if compliance is None else compliance
    square: float = squared_natural_residual(r, u, mu, s, dimension, not published)
    if not square < LEAST_SIZE**2:
        return math.sqrt(square)
    largest = max(np.abs(u).max(initial=0.0), np.abs(r.reshape(len(mu), dimension) * s[:, None]).max(initial=0.0))
    if not 0 < largest < LEAST_SIZE:
        return math.sqrt(square)
    factor = enlargement(largest)  # squares beyond the least number: r = 0 would be an answer to any velocities
    return math.sqrt(squared_natural_residual(r * factor, u * factor, mu, s, dimension, not published)) / factor


def size_of(q: FloatArray, floor: float = 0.0) -> float:
    """max(||q||, floor): what errors divide by, of velocities q (m,) however small."""
    size = float(np.linalg.norm(q))
    if size < LEAST_SIZE and (largest := float(np.abs(q).max(initial=0.0))) > 0:
        factor = enlargement(largest)
        size = float(np.linalg.norm(q * factor)) / factor
    return max(size, floor)


def relative(residual: float, scale: float) -> float:
    """residual / scale, 0 for 0 / 0 and infinity for anything else over 0; NaN stays NaN, and is what anything over infinity is: a problem
    whose size is beyond the largest number is solved by nothing."""
    if not scale < math.inf:
        return math.nan
    if residual == 0:
        return 0.0
    return residual / scale if scale > 0 else residual * math.inf


OUTWEIGHED = 1e-3
"""Error relative to the contacts that are not parting, from which a remark says that others outweigh them."""


def outweighed(
    r: FloatArray, u: FloatArray, q: FloatArray, dimension: int, residual: float, scale: float, floor: float, tol: float = 0.0
) -> str:
    """What there is to say where a small error is so for contacts that part alone, empty where there is nothing.

    Errors are relative to ||q||, in which a contact 1e9 m/s from closing hides whatever others do: r = 0 has an error of 1e-9. So the
    residual is compared with the q of the contacts that are pressed, penetrate, or would without reactions; flat r, u, q (m,); scale: what
    the error divides by; floor as in `error`, below which all is at rest.
    """
    if not residual > 1e-13 * scale:  # round-off
        return ""
    share, closing = max(OUTWEIGHED, 10 * tol), np.minimum(q[::dimension], 0.0)
    if residual <= share * math.sqrt(float(closing @ closing)):  # a part of what follows says so, in a tenth of the time
        return ""
    pressed = (u[::dimension] < 0) | (q[::dimension] < 0)
    for k in range(dimension):  # rows of three are slow to ask
        pressed |= r[k::dimension] != 0
    counted = max(float(np.linalg.norm(q.reshape(-1, dimension)[pressed])), floor)
    if residual <= share * counted:
        return ""
    return (
        f"contacts that part outweigh the others in ||q|| ({scale:.1e} of {counted:.1e}): relative to these the error is "
        f"{relative(residual, counted):.1e}; ask for a smaller tolerance, or leave contacts out that cannot close"
    )


ROUND_OFF = float(np.finfo(np.float64).eps)
BLURRED = 0.1
"""Share of the tolerance from which the error's own round-off is told."""
PLAIN = 100
"""Times round-off up to which an error is known as well as numbers allow."""


def blurred(z: float, parts: float, scale: float, tol: float, mu: float = 0.0) -> str:
    """What there is to say where round-off keeps the error from being known to `tol`, empty where it does not.

    u is the sum of W r, of the size ||z|| of the scaled reactions, and of q, which in global form is itself a sum: parts = ||w|| +
    ||H^T M^-1 f|| [velocity]. Nothing below their round-off is known of it, whatever the residual says; scale: what the error divides by.
    mu: the largest of contacts with reactions; g(u) multiplies by it what is known of ||u_T||.
    """
    known = relative(ROUND_OFF * (z + parts), scale)
    if not known > BLURRED * tol:
        if not mu * known > BLURRED * tol:
            return ""
        return f"friction of {mu:.0e} multiplies the round-off of sliding velocities: the error is known to {mu * known:.0e} alone"
    if known <= PLAIN * ROUND_OFF:  # nothing cancels: it is the tolerance
        return f"by round-off the error is known to {known:.0e} alone, which a tolerance of {tol:.0e} does not leave room for"
    if z > parts:
        return f"reactions are {relative(z, scale):.0e} times what ||q|| asks for: by round-off the error is known to {known:.0e} alone"
    return (
        f"w and H^T M^-1 f cancel to ||q|| = {relative(scale, parts):.0e} of their size: by round-off the error is known to {known:.0e} "
        "alone; if the bodies are at rest, give a floor, the velocity that counts as none"
    )


NEGATIVE = 1e-9
"""Share of the largest by which eigenvalues, or the work of reactions, are below zero beyond round-off."""


def indefinite(blocks: FloatArray, r: FloatArray, moved: FloatArray) -> str:
    """What there is to say where W is seen not to be positive semidefinite, empty where it is not seen.

    blocks (nc, d, d): W_aa; moved (m,): W r. A necessary condition each: no W_aa has a negative eigenvalue, and r . W r >= 0. The W of
    masses and stiffnesses meets both; of others an answer may not exist, and no method is made for them.
    """
    own = np.linalg.eigvalsh(0.5 * (blocks + blocks.transpose(0, 2, 1))) if np.isfinite(blocks).all() else np.zeros((0, 1))
    bad = np.flatnonzero(own[:, 0] < -NEGATIVE * np.abs(own).max(initial=0.0))
    work = float(r @ moved)
    if len(bad):
        seen = f"the block of contact {bad[0]} has the eigenvalue {own[bad[0], 0]:.1e}"
    elif work < -NEGATIVE * float(np.linalg.norm(r) * np.linalg.norm(moved)):
        seen = f"r . W r = {work:.1e} of the last r"
    else:
        return ""
    return f"W is not positive semidefinite ({seen}), as H^T M^-1 H of masses and stiffnesses is: look for a sign in W, M or K"


def error(problem: LocalProblem, r: FloatArray, u: FloatArray | None = None, floor: float = 0.0) -> float:
    """Return the published error ||r - P_K(r - (u + g(u)))|| / max(||q||, floor), u = W r + q (eq. 13 of Acary, Brémond, Huber 2018).

    It adds impulses to velocities, so that its size depends on the units; see `scaled_error`. `u` may be given where W r + q was just
    computed. `floor`, in the unit of q, keeps the error meaningful where q is nothing but the round-off of a state at rest, as in a
    simulation's first step: r = 0 is then the answer.
    """
    _refuse_global(problem)
    if u is None:
        u = problem.W @ r + problem.q
    residual = natural_map_residual(r, u, problem.mu, problem.dimension)
    return relative(residual, size_of(problem.q, floor))


def scaled_error(problem: LocalProblem, r: FloatArray, u: FloatArray | None = None, floor: float = 0.0) -> float:
    """Return ||z - P_K(z - (u + g(u)))|| / max(||q||, floor) with z_a = s_a r_a: what decides whether a result is SOLVED.

    s_a = tr(W_aa) / d is the contact's own compliance, the mean of the others where it has none. Every term is a velocity (quasi-statics:
    a length), so that the error does not depend on the units of mass, length and time. Arguments as in `error`.
    """
    _refuse_global(problem)
    if u is None:
        u = problem.W @ r + problem.q
    residual = natural_map_residual(r, u, problem.mu, problem.dimension, problem.compliance)
    return relative(residual, size_of(problem.q, floor))


def _refuse_global(problem: object) -> None:
    if isinstance(problem, GlobalProblem):
        local = "whose local form is fcsim.problem.reduction.reduced(problem).local"
        raise InputError(f"problem: expected a LocalProblem, got a GlobalProblem, {local}")


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


class Judge:
    """Judges reactions on a problem as it is given: its equations are solved by LU of M or R as a whole, not by the solvers' reduction."""

    def __init__(self, problem: GlobalProblem | LocalProblem) -> None:
        """SingularMatrix where M or R is singular."""
        self.problem = p = problem
        self._factor: SuperLU | None = None
        if isinstance(p, GlobalProblem):
            M = sp.csc_array(p.entries)
            self._factor = SuperLU(M if p.G is None else sp.block_array([[M, -sp.csc_array(p.G)], [-sp.csc_array(p.G).T, None]]))
        elif p.R is not None:
            self._factor = SuperLU(p.R)

    def velocity(self, r: FloatArray) -> FloatArray:
        """u (m,) from r (m,)."""
        p = self.problem
        if isinstance(p, LocalProblem):
            u = p.W @ r + p.q
            return u if p.V is None or p.s is None or self._factor is None else u - p.V @ self._factor.solve(p.V.T @ r + p.s)
        assert self._factor is not None
        rhs = p.H @ r + p.f
        x = self._factor.solve(rhs if p.b is None else np.concatenate([rhs, p.b]))
        return p.H.T @ x[: p.n] + p.w

    @cached_property
    def scale(self) -> float:
        """||q||, q the velocity without reactions."""
        return size_of(self.velocity(np.zeros(self.problem.m)))

    @cached_property
    def compliance(self) -> FloatArray:
        """tr(W_aa) / d (nc,), see `Delassus.compliance`."""
        return reduced(self.problem).compliance

    def error(self, r: FloatArray, floor: float = 0.0) -> float:
        """The published error of r (m,), infinity where r is not finite; `floor` as in `error`."""
        return self._error(r, floor, None)

    def scaled_error(self, r: FloatArray, floor: float = 0.0) -> float:
        """The scaled error of r (m,), infinity where r is not finite."""
        return self._error(r, floor, self.compliance)

    def _error(self, r: FloatArray, floor: float, compliance: FloatArray | None) -> float:
        r = np.asarray(r, dtype=np.float64)
        if not np.all(np.isfinite(r)):
            return math.inf
        residual = natural_map_residual(r, self.velocity(r), self.problem.mu, self.problem.dimension, compliance)
        return relative(residual, max(self.scale, floor))
