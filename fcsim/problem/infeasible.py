"""Proofs that a frictional contact problem has no solution.

Two are looked for:

* Squeezed bodies: weights y >= 0 of the contacts with W^T N y = 0, N the normals, and q_N . y < 0. Then y . u_N = y . q_N + r . W^T N y
  = y . q_N < 0 for every r, so that no reactions whatever keep u_N >= 0 (Farkas' lemma: there is such a y or there are such r; J. Farkas,
  J. Reine Angew. Math. 124, 1902). In mechanics y is a self-stress of normal forces on which what is prescribed does work.
* In 2D, a few contacts that share no body with others: each is open, sticks or slides one way or the other, and each of these 4^k cases
  is a linear programme; where none has a solution there is none (P. Painlevé's rods, C. R. Acad. Sci. 121, 1895).

Between the two a problem may have no solution that nothing here proves.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy.optimize
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.motion import Motion
from fcsim.problem.problem import LocalProblem

REACTIONS = 1e6
"""Times the reactions that the velocities would need by the contacts' own compliances that an answer would have to exceed, for a proof in
floating point: W^T N y is never zero to the last digit."""
MISSED = 1e-5
"""Share of the contacts' speed by which the best of all cases must miss, for a proof by cases."""
CASES = 3
"""Contacts up to which all cases are looked at: 64 linear programmes."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """Why there is no solution.

    contacts (k,)  those that the proof is about
    direction (m,) N y for the proof by a self-stress, of unit sum; None for the proof by cases
    reactions      what ||r|| an answer would have to exceed, relative to ||q|| over the mean compliance; infinite by cases
    """

    contacts: IntArray
    direction: FloatArray | None
    reactions: float

    @property
    def message(self) -> str:
        """For people."""
        few = ", ".join(map(str, self.contacts[:8].tolist())) + (" ..." if len(self.contacts) > 8 else "")
        if self.direction is None:
            return f"no solution: contacts {few} can neither be open nor stick nor slide (all cases)"
        return (
            f"no solution: contacts {few} are squeezed, a self-stress of their normal forces works against what is prescribed "
            f"(reactions of {self.reactions:.0e} times the usual would be needed)"
        )


def squeezed(problem: LocalProblem) -> Certificate | None:
    """A self-stress y that proves that no reactions keep the bodies apart, None where linear programming finds none.

    minimise q_N . y subject to W^T N y = 0, sum y = 1, y >= 0, in units of the largest entries. Where W = H^T M^-1 H is known,
    H N y = 0 says the same in fewer and shorter rows, since M^-1 is positive definite; what is found is checked on W all the same.
    """
    d, nc = problem.dimension, problem.nc
    q_N = problem.q[::d]
    speed = float(np.abs(q_N).max(initial=0.0))
    motion = problem.delassus.motion
    if motion is not None and motion.regular:  # y . W y > 0: no self-stress without velocities
        return None
    W = problem.W if isinstance(problem.W, np.ndarray) else sp.csr_array(problem.W)
    largest = float(np.abs(W if isinstance(W, np.ndarray) else W.data).max(initial=0.0))
    if not speed or not largest or not np.any(q_N < 0):
        return None
    E = _self_stress(motion, d) if motion is not None and motion.own is None else sp.csr_array(W[::d].T) / largest
    A = sp.vstack([E, sp.csr_array(np.ones((1, nc)))], format="csr")
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = scipy.optimize.linprog(q_N / speed, A_eq=A, b_eq=np.r_[np.zeros(E.shape[0]), 1.0], bounds=(0, None), options=options)
    if found.status != 0:
        return None
    y = np.maximum(found.x, 0.0)
    y[y < 1e-9 * y.max()] = 0.0
    work, leak = -float(q_N @ y), float(np.linalg.norm(W[::d].T @ y))
    compliance = float(W.diagonal().mean()) or largest
    usual = float(np.linalg.norm(problem.q)) / compliance
    reactions = work / (leak * usual) if leak > 0 else float("inf")
    if not work > 0 or reactions < REACTIONS:
        return None
    direction = np.zeros(problem.m)
    direction[::d] = y
    return Certificate(np.flatnonzero(y), direction, reactions)


def _self_stress(motion: Motion, dimension: int) -> sp.csr_array:
    """The rows of H N (n, nc), each over the root of its mass, in units of the largest entry."""
    rows = sp.csr_array(sp.diags_array(1 / np.sqrt(motion.M.diagonal())) @ motion.HT[::dimension].T)
    return rows / float(np.abs(rows.data).max(initial=0.0) or 1.0)


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
        speed, largest = np.abs(problem.q[dofs]).max(), np.abs(own).max()
        if not speed or not largest:
            continue
        # in units of velocities and compliances of its own
        cases = product(range(4), repeat=len(contacts))
        if all(_missed(own / largest, problem.q[dofs] / speed, problem.mu[contacts], case) > MISSED for case in cases):
            return Certificate(contacts, None, float("inf"))
    return None


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
    found = scipy.optimize.linprog(cost, A_ub=A, b_ub=values, bounds=[(-1 / MISSED, 1 / MISSED)] * (2 * k) + [(0, None)])
    return float(found.fun) if found.status == 0 else 0.0


def certificate(problem: LocalProblem) -> Certificate | None:
    """A proof that the problem has no solution, None where none was found."""
    return squeezed(problem) or without_a_case(problem)
