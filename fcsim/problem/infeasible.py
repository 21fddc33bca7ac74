"""Proofs that a frictional contact problem has no solution.

Three are looked for:

* A contact whose row of W is zero, which no reaction moves, and whose q_N < 0.
* Squeezed bodies: weights y >= 0 of the contacts with W^T N y = 0, N the normals, and q_N . y < 0. Then y . u_N = y . q_N + r . W^T N y
  = y . q_N < 0 for every r, so that no reactions whatever keep u_N >= 0 (Farkas' lemma: there is such a y or there are such r; J. Farkas,
  J. Reine Angew. Math. 124, 1902). In mechanics y is a self-stress of normal forces on which what is prescribed does work.
* In 2D, a few contacts that share no body with others: each is open, sticks or slides one way or the other, and each of these 4^k cases
  is a linear programme; where none has a solution there is none (P. Painlevé's rods, C. R. Acad. Sci. 121, 1895).

Between these a problem may have no solution that nothing here proves.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy  # whose optimize is loaded where it is used: a tenth of a second of every start
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.motion import Motion
from fcsim.problem.problem import LocalProblem

REACTIONS, REACTIONS_OF_A_CASE = 1e12, 1e6
"""Times the reactions that the velocities would need by the contacts' own compliances that an answer would have to exceed, for a proof in
floating point: W^T N y is never zero to the last digit; of a case whose equations are singular, where linear
programming sees no further."""
FEW = 300
"""Contacts of a self-stress up to which what linear programming leaves of it, 1e-10, is taken out."""
HEAVIEST = 1e-12
"""Times the largest compliance: what is below that is none, but round-off."""
MISSED = 1e-5
"""Share of the contacts' speed, or of their largest reaction, by which the best of all cases must miss, for a proof by cases."""
REGULAR = 1e12
"""Condition up to which the equations of a case are solved; of others the least that inequalities must be relaxed by is sought."""
CASES = 3
"""Contacts up to which all cases are looked at: 64 linear programmes."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """Why there is no solution.

    contacts (k,)  those that the proof is about
    direction (m,) N y for the proof by a self-stress, of unit sum; None for the proof by cases
    reactions      what ||r|| an answer would have to exceed, relative to ||q||, both in units of the contacts' own compliances; by cases
                   infinite, or `REACTIONS_OF_A_CASE` where equations of a case are singular
    """

    contacts: IntArray
    direction: FloatArray | None
    reactions: float

    @property
    def message(self) -> str:
        """For people."""
        few = ", ".join(map(str, self.contacts[:8].tolist())) + (" ..." if len(self.contacts) > 8 else "")
        if self.direction is None:
            near = "" if self.reactions == float("inf") else f", not with reactions of up to {self.reactions:.0e} times the usual"
            return f"no solution: contacts {few} can neither be open nor stick nor slide (all cases{near})"
        return (
            f"no solution: contacts {few} are squeezed, a self-stress of their normal forces works against what is prescribed "
            f"({self.needed} would keep them apart)"
        )

    @property
    def needed(self) -> str:
        """The reactions of an answer, in words."""
        return "no reactions" if self.reactions == float("inf") else f"only reactions of {self.reactions:.0e} times the usual"


def squeezed(problem: LocalProblem, beyond: float = REACTIONS) -> Certificate | None:
    """A self-stress y that proves that no reactions up to `beyond` (see `REACTIONS`) keep the bodies apart, None where linear programming
    finds none.

    minimise q_N . y subject to W^T N y = 0, sum y = 1, y >= 0, each unknown and row in units of its own compliance, so that a heavy body
    among light ones is not taken for one that is held. Where W = H^T M^-1 H is known,
    H N y = 0 says the same in fewer and shorter rows, since M^-1 is positive definite; what is found is checked on W all the same.
    """
    d, nc = problem.dimension, problem.nc
    q_N = problem.q[::d]
    speed = float(np.abs(q_N).max(initial=0.0))
    motion = problem.delassus.motion
    if motion is not None and motion.regular:  # y . W y > 0: no self-stress without velocities
        return None
    W = problem.W if isinstance(problem.W, np.ndarray) else sp.csr_array(problem.W)
    diagonal = np.abs(W.diagonal())
    if not speed or not np.any(q_N < 0):
        return None
    if (contact := unmoved(problem)) is not None:
        direction = np.zeros(problem.m)
        direction[d * contact] = 1.0
        return Certificate(np.array([contact]), direction, float("inf"))
    if not diagonal.any():
        return None
    own = 1 / np.sqrt(np.maximum(diagonal, HEAVIEST * diagonal.max()))
    of_body = motion is not None and motion.own is None
    E = _self_stress(motion, d) if of_body and motion is not None else sp.diags_array(own) @ sp.csr_array(W[::d].T)
    cost = own[::d] * q_N
    A = sp.vstack([E @ sp.diags_array(own[::d]), sp.csr_array(np.ones((1, nc)))], format="csr")
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = scipy.optimize.linprog(
        cost / np.abs(cost).max(), A_eq=A, b_eq=np.r_[np.zeros(E.shape[0]), 1.0], bounds=(0, None), options=options
    )
    if found.status != 0:
        return None
    y = np.maximum(found.x, 0.0)
    y[y < 1e-9 * y.max()] = 0.0
    y = _exact(sp.csc_array(sp.diags_array(own) @ sp.csr_array(W[::d].T) @ sp.diags_array(own[::d])), y)
    work, leak = -float(cost @ y), float(np.linalg.norm(own * (W[::d].T @ (own[::d] * y))))
    usual = float(np.linalg.norm(own * problem.q))
    reactions = work / (leak * usual) if leak > 0 else float("inf")
    if work <= speed * (own[::d] @ y) / REACTIONS or reactions < beyond:  # of round-off of q, or too little
        return None
    direction = np.zeros(problem.m)
    direction[::d] = own[::d] * y / (own[::d] @ y)
    return Certificate(np.flatnonzero(y), direction, reactions)


def unmoved(problem: LocalProblem) -> int | None:
    """The contact that is driven together fastest of those that no reactions move along their normals (links or supports hold both sides):
    their rows of W are zero; None where there is none, or none but by round-off of q."""
    d, q_N = problem.dimension, problem.q[:: problem.dimension]
    least = float(np.abs(problem.q).max(initial=0.0)) / REACTIONS
    still = np.flatnonzero((problem.diagonal_blocks[:, 0, 0] == 0) & (q_N < -least))
    if not len(still):
        return None
    W = problem.W if isinstance(problem.W, np.ndarray) else sp.csr_array(problem.W)
    still = still[abs(W[d * still]).sum(axis=1) == 0]
    return int(still[q_N[still].argmin()]) if len(still) else None


def _exact(E: sp.csc_array, y: FloatArray) -> FloatArray:
    """y (nc,) >= 0 with E y = 0 to round-off where that takes changes of what bears alone, and small ones; else y as it is."""
    bears = np.flatnonzero(y)
    if not 0 < len(bears) <= FEW:
        return y
    own = E[:, bears]
    rows = own[np.unique(own.indices)].toarray()
    left = np.linalg.lstsq(rows, rows @ y[bears], rcond=1e-9)[0]
    if not np.abs(left).max() < 1e-3 * y.max() or np.any(y[bears] - left < 0):
        return y
    exact = y.copy()
    exact[bears] -= left
    return exact


def _self_stress(motion: Motion, dimension: int) -> sp.csr_array:
    """M^-1/2 H N (n, nc) of a diagonal of M: the root of what W makes of normal forces."""
    return sp.csr_array(sp.diags_array(1 / np.sqrt(motion.M.diagonal())) @ motion.HT[::dimension].T)


def without_a_case(problem: LocalProblem) -> Certificate | None:
    """A group of at most `CASES` contacts of a 2D problem, coupled with no others, of which no case has a solution; None where all have."""
    if problem.dimension != 2:
        return None
    nc = problem.nc
    W = sp.coo_array(problem.W)
    graph = sp.coo_array((np.ones(W.nnz), (W.row // 2, W.col // 2)), shape=(nc, nc))
    count, group = connected_components(graph, directed=False)
    members = np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group, minlength=count))[:-1])
    rows = sp.csr_array(problem.W)
    for contacts in members:
        if len(contacts) > CASES:
            continue
        dofs = (2 * contacts[:, None] + np.arange(2)).ravel()
        own = rows[dofs][:, dofs].toarray()
        scale = np.sqrt(np.maximum(np.abs(own.diagonal()), HEAVIEST * np.abs(own.diagonal()).max()))
        speed = np.abs(problem.q[dofs] / scale).max() if own.any() else 0.0
        if not speed:
            continue
        # in units of each unknown's own compliance
        W_own, q_own, units = own / np.outer(scale, scale), problem.q[dofs] / scale / speed, scale[1::2] / scale[::2]
        missed = [_ruled_out(W_own, q_own, problem.mu[contacts] * units, case) for case in product(range(4), repeat=len(contacts))]
        if all(missed):
            return Certificate(contacts, None, min(missed))
    return None


def _ruled_out(W: FloatArray, q: FloatArray, mu: FloatArray, case: tuple[int, ...]) -> float:
    """What reactions a case's solution would have to exceed: infinity where its equations are regular and their only solution violates an
    inequality beyond doubt, `REACTIONS_OF_A_CASE` where they are singular and none of smaller reactions is near; 0 where there may be a
    solution."""
    k = len(mu)
    A, b = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
    for a, state in enumerate(case):
        N, T = 2 * a, 2 * a + 1
        A[[N, T]], b[[N, T]] = (np.eye(2 * k)[[N, T]], 0.0) if state == 0 else (W[[N, T]], -q[[N, T]])
        if state >= 2:
            A[T], b[T] = 0.0, 0.0
            A[T, T], A[T, N] = 1.0, mu[a] if state == 2 else -mu[a]
    rows = np.abs(A).max(axis=1)
    A, b = A / np.where(rows > 0, rows, 1)[:, None], b / np.where(rows > 0, rows, 1)
    condition = np.linalg.cond(A)
    if not condition <= REGULAR:
        return REACTIONS_OF_A_CASE if _missed(W, q, mu, case) > MISSED else 0.0
    r = np.linalg.solve(A, b)
    u, doubt = W @ r + q, 1e-14 * condition
    least_r, least_u = (MISSED + doubt) * np.abs(r).max(), MISSED + doubt * np.abs(W).max() * np.abs(r).max()
    for a, state in enumerate(case):
        r_N, r_T, u_N, u_T = *r[2 * a : 2 * a + 2], *u[2 * a : 2 * a + 2]
        against = 0.0 if state < 2 else -u_T if state == 2 else u_T
        beyond = abs(r_T) - mu[a] * r_N if state == 1 else 0.0
        if (state == 0 and -u_N > least_u) or (state > 0 and -r_N > least_r) or beyond > (1 + mu[a]) * least_r or against > least_u:
            return float("inf")
    return 0.0


def _missed(W: FloatArray, q: FloatArray, mu: FloatArray, case: tuple[int, ...]) -> float:
    """The least t by which the inequalities and equations of a case must be relaxed; 0: open, 1: sticking, 2, 3: sliding either way.

    Unknowns (r, t); each row of `bounded` says row . r <= value + t.
    """
    k = len(mu)
    bounded: list[tuple[FloatArray, float]] = []
    for a, state in enumerate(case):
        N, T = 2 * a, 2 * a + 1
        e_N, e_T = np.eye(2 * k)[[N, T]]
        u_N, u_T = W[N], W[T]
        sign = 1.0 if state == 2 else -1.0
        if state == 0:  # r = 0, u_N >= 0
            bounded += [(s * e, 0.0) for s in (1.0, -1.0) for e in (e_N, e_T)] + [(-u_N, q[N])]
            continue
        bounded += [(u_N, -q[N]), (-u_N, q[N]), (-e_N, 0.0)]
        if state == 1:  # u = 0, |r_T| <= mu r_N
            bounded += [(u_T, -q[T]), (-u_T, q[T]), (e_T - mu[a] * e_N, 0.0), (-e_T - mu[a] * e_N, 0.0)]
        else:  # u_N = 0, sign u_T >= 0, r_T = -sign mu r_N
            slide = e_T + sign * mu[a] * e_N
            bounded += [(-sign * u_T, sign * q[T]), (slide, 0.0), (-slide, 0.0)]
    rows, values = np.array([row for row, _ in bounded]), np.array([value for _, value in bounded])
    A = np.column_stack([rows, -np.ones(len(rows))])
    cost = np.r_[np.zeros(2 * k), 1.0]
    found = scipy.optimize.linprog(cost, A_ub=A, b_ub=values, bounds=[(-REACTIONS_OF_A_CASE, REACTIONS_OF_A_CASE)] * (2 * k) + [(0, None)])
    return float(found.fun) if found.status == 0 else 0.0


def certificate(problem: LocalProblem, beyond: float = REACTIONS) -> Certificate | None:
    """A proof that the problem has no solution, or of squeezed bodies none with reactions up to `beyond`; None where none was found."""
    return squeezed(problem, beyond) or without_a_case(problem)
