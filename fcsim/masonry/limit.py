"""Limit analysis of rigid blocks: the largest load multiplier that contact forces can bear.

Associative: max lambda subject to H r + dead + lambda live = 0, r in K (Coulomb's cone at every contact). By the static theorem there is no
equilibrium above it, so every structure with Coulomb friction has fallen by then; with hinges only it is the collapse load. The
multipliers of the equilibrium, v with live . v = 1, are the mechanism: H^T v in K*, slip with dilatancy.

Coulomb: slip opens no joint. A fixed point of limit problems with Tresca's friction, |r_T| <= mu N for N given, with N = r_N of their
answers, is a state of incipient collapse under Coulomb's law; such states are not unique, and the least one that was found counts.

Sources: M. C. Ferris, F. Tin-Loi, Int. J. Mech. Sci. 43, 2001 (the mathematical program with complementarity constraints); M. Gilbert,
C. Casapulla, H. M. Ahmed, Comput. Struct. 84, 2006 (sequences of limit problems).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from fcsim.arrays import BoolArray, FloatArray
from fcsim.contact_detection import Contacts
from fcsim.contact_detection.contact_matrix import contact_matrix
from fcsim.errors import InputError
from fcsim.masonry.mechanics import BlockModel
from fcsim.solvers.variational.conic import clarabel_module

ROUNDS = 60
_SETTLED, _NEAR = 1e-5, 1e-3
_JUMPS = 5  # rounds of the fixed point before it takes half steps
_STILL = {2: 1e-7, 3: 1e-5}  # of the largest contact velocity; interior points are rounder than corners

Outcome = Literal["limit", "unbounded", "falls", "undecided"]


@dataclass(frozen=True, eq=False)
class LimitLoad:
    """What limit analysis says of one law of slip.

    outcome       "limit"; "unbounded": contact forces bear every multiplier; "falls": not even the loads that stay are borne;
                  "undecided": the programs or their fixed point did not converge
    multiplier    the limit (Coulomb: the least of `span`), inf and 0; of what is undecided the last value
    r (m,) [N]    contact forces at the limit; v (n_dofs,): velocities of the mechanism, live . v = 1 W (of what falls: dead . v = 1 W)
    rounds        of the fixed point
    span          Coulomb: the least and the largest multiplier at which this mechanism and Coulomb's law go together: forces r that are
                  none where it opens, mu r_N against the slip where it slides, in the cone elsewhere. Checked by programs of their own
    """

    law: Literal["associative", "Coulomb"]
    outcome: Outcome
    multiplier: float
    r: FloatArray
    v: FloatArray
    rounds: int = 0
    span: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class LimitProblem:
    """Contacts and loads of limit analysis: H (n_dofs, m) of the free dofs' rows, see `limit_problem`."""

    blocks: BlockModel
    contacts: Contacts
    H: Any
    free: np.ndarray
    scale: float


def limit_problem(blocks: BlockModel, x: FloatArray | None = None, *, tolerance: float | None = None) -> LimitProblem:
    """Return the limit problem of the blocks in the configuration x (n_dofs,), by default as they were given.

    tolerance [m]: blocks that are nearer are in contact; by default 1e-4 of the smallest block's extent.
    """
    problem, model = blocks.problem, blocks.model
    x = np.zeros(model.n_dofs) if x is None else x
    alert = 1e-4 * problem.smallest if tolerance is None else tolerance
    contacts = blocks.contact(alert)(model.positions(x))
    free = model.free_dofs
    H = sp.csr_array(model.contact_matrix(contact_matrix(contacts, model.n_nodes), x))[free]
    scale = max(float(np.abs(blocks.dead).max()), float(np.abs(blocks.live).max()))
    if not scale > 0:
        raise InputError(f"limit analysis of {problem.name!r}: expected loads, got none")
    return LimitProblem(blocks, contacts, H, free, scale)


def associative_limit(problem: LimitProblem) -> LimitLoad:
    """Return the associative limit load: an upper bound of every load that Coulomb's friction bears."""
    dead, live = problem.blocks.dead, problem.blocks.live
    stands = _Program(problem, np.zeros_like(dead), dead).solve(at_most=1.0)
    law: Literal["associative"] = "associative"
    if stands is None:
        return _undecided(problem, law)
    if stands.multiplier < 1 - 1e-6:
        return LimitLoad(law, "falls", 0.0, stands.r, stands.v)
    if not np.abs(live).max() > 0:
        return LimitLoad(law, "unbounded", np.inf, stands.r, stands.v)
    found = _Program(problem, dead, live).solve()
    if found is None:  # no maximum: is there equilibrium far beyond all proportions?
        found = _Program(problem, dead, live).solve(at_most=1e6)
        if found is None or found.multiplier < 0.99e6:
            return _undecided(problem, law)
        return LimitLoad(law, "unbounded", np.inf, found.r, np.zeros_like(dead))
    return LimitLoad(law, "limit", found.multiplier, found.r, found.v)


def coulomb_limit(problem: LimitProblem, start: LimitLoad) -> LimitLoad:
    """Return the least load multiplier found at which Coulomb's friction allows a mechanism, from the associative answer on.

    That of the fixed point; where the rounds go on without one, the least of the mechanisms that they passed and that were certified.
    """
    if start.outcome != "limit":
        return LimitLoad("Coulomb", start.outcome, start.multiplier, start.r, start.v)
    d = problem.contacts.dimension
    program = _Program(problem, problem.blocks.dead, problem.blocks.live)
    mean, last = start.r, start.multiplier
    certified: LimitLoad | None = None
    for rounds in range(1, ROUNDS + 1):
        found = program.solve(given=np.maximum(mean[::d], 0.0))
        if found is None:
            break
        settled = abs(found.multiplier - last) <= _SETTLED * max(abs(last), 1e-3)
        state = _state_of_collapse(problem, program, found, rounds)
        if state is not None and state.span is not None:
            near = _NEAR * max(abs(last), 1e-3)
            if settled and state.span[0] - near <= found.multiplier <= state.span[1] + near:
                return state
            if certified is None or state.multiplier < certified.multiplier:
                certified = state
        # forces are not unique: the answers jump between corners of one set, their mean settles
        mean, last = found.r if rounds <= _JUMPS else 0.5 * (mean + found.r), found.multiplier
    return certified or LimitLoad("Coulomb", "undecided", last, start.r, start.v, ROUNDS)


def _state_of_collapse(problem: LimitProblem, program: _Program, found: _Answer, rounds: int) -> LimitLoad | None:
    """The answer's mechanism with forces that belong to it under Coulomb's law, at the least multiplier where they do; None: nowhere."""
    slip = _slip(problem, found.v)
    least, most = program.solve(slip=slip, sign=-1.0), program.solve(slip=slip)
    if least is None or most is None:
        return None
    return LimitLoad("Coulomb", "limit", least.multiplier, least.r, found.v, rounds, (least.multiplier, most.multiplier))


@dataclass(frozen=True, eq=False)
class _Slip:
    """What a mechanism asks of contact forces: none where it opens, friction -mu r_N t along the slip t (nc, d - 1) where it slides."""

    opens: BoolArray
    slides: BoolArray
    along: FloatArray


def _slip(problem: LimitProblem, v: FloatArray) -> _Slip:
    d = problem.contacts.dimension
    u = (problem.H.T @ v[problem.free]).reshape(-1, d)
    none = _STILL[d] * max(float(np.abs(u).max()), 1e-300)
    speed = np.linalg.norm(u[:, 1:], axis=1)
    opens = u[:, 0] > none
    slides = ~opens & (speed > none)
    return _Slip(opens, slides, u[:, 1:] / np.where(slides, speed, 1.0)[:, None])


@dataclass(frozen=True, eq=False)
class _Answer:
    multiplier: float
    r: FloatArray
    v: FloatArray


class _Program:
    """max lambda subject to H r + dead + lambda live = 0 and friction; forces in units of the largest load."""

    def __init__(self, problem: LimitProblem, dead: FloatArray, live: FloatArray) -> None:
        self.problem = problem
        self.dead, self.live = dead[problem.free] / problem.scale, live[problem.free] / problem.scale
        self.balance = sp.hstack([problem.H, sp.csc_array(self.live[:, None])], format="csc")

    def solve(
        self, *, given: FloatArray | None = None, slip: _Slip | None = None, at_most: float = np.inf, sign: float = 1.0
    ) -> _Answer | None:
        """The largest lambda <= at_most, or with sign = -1 the least; None where the program has no answer.

        given (nc,) [N]: the normal forces of Tresca's disks in place of Coulomb's cones; slip: the mechanism to which forces are to belong.
        """
        rows, right = [self.balance], [-self.dead]
        if slip is not None:
            rows.append(self._belonging(slip))
            right.append(np.zeros(rows[-1].shape[0]))
        equal = sp.vstack(rows, format="csc"), np.concatenate(right)
        low = 0.0 if slip is None else -np.inf
        # in 2D a linear program, of which the simplex method finds a corner: where the fixed point of disks ends lowest
        found = (self._linear if self.problem.contacts.dimension == 2 else self._conic)(
            *equal, None if given is None else given / self.problem.scale, (low, at_most), sign
        )
        if found is None:
            return None
        multiplier, r, dual = found
        v = np.zeros(self.problem.blocks.model.n_dofs)
        power = float(self.live @ dual[: len(self.live)]) * self.problem.scale
        if power != 0:
            v[self.problem.free] = dual[: len(self.live)] / power
        return _Answer(multiplier, r * self.problem.scale, v)

    def _belonging(self, slip: _Slip) -> Any:
        """Rows whose product with (r, lambda) is zero where forces belong to the mechanism."""
        d, mu, nc = self.problem.contacts.dimension, self.problem.contacts.mu, len(self.problem.contacts)
        none = (d * np.flatnonzero(slip.opens)[:, None] + np.arange(d)).ravel()
        sliding = np.flatnonzero(slip.slides)
        count = (d - 1) * len(sliding)
        tangents = (d * sliding[:, None] + np.arange(1, d)).ravel()
        against = (mu[sliding, None] * slip.along[sliding]).ravel()
        rows = np.concatenate([np.arange(len(none)), np.tile(len(none) + np.arange(count), 2)])
        columns = np.concatenate([none, tangents, np.repeat(d * sliding, d - 1)])
        values = np.concatenate([np.ones(len(none) + count), against])
        return sp.csc_array((values, (rows, columns)), shape=(len(none) + count, d * nc + 1))

    def _linear(
        self, equal: Any, right: FloatArray, given: FloatArray | None, bounds: tuple[float, float], sign: float
    ) -> tuple[float, FloatArray, FloatArray] | None:
        mu, nc = self.problem.contacts.mu, len(self.problem.contacts)
        a = np.arange(nc)
        cone = mu if given is None else np.zeros(nc)
        values = np.concatenate([np.ones(nc), -cone, -np.ones(nc), -cone])
        rows = np.concatenate([a, a, nc + a, nc + a])
        columns = np.concatenate([2 * a + 1, 2 * a, 2 * a + 1, 2 * a])
        friction = sp.csc_array((values, (rows, columns)), shape=(2 * nc, 2 * nc + 1))
        most = np.zeros(2 * nc) if given is None else np.tile(mu * given, 2)
        limits = np.stack([np.append(np.tile([0.0, -np.inf], nc), bounds[0]), np.append(np.full(2 * nc, np.inf), bounds[1])], axis=1)
        cost = np.zeros(2 * nc + 1)
        cost[-1] = -sign
        answer = linprog(cost, A_ub=friction, b_ub=most, A_eq=equal, b_eq=right, bounds=limits, method="highs-ds")
        if answer.status != 0:
            return None
        return float(answer.x[-1]), answer.x[:-1], np.asarray(answer.eqlin.marginals)

    def _conic(
        self, equal: Any, right: FloatArray, given: FloatArray | None, bounds: tuple[float, float], sign: float
    ) -> tuple[float, FloatArray, FloatArray] | None:
        clarabel = clarabel_module()
        mu, nc, d = self.problem.contacts.mu, len(self.problem.contacts), self.problem.contacts.dimension
        size = d * nc + 1
        normal = d * np.arange(nc)
        tangents = (normal[:, None] + np.arange(1, d)).ravel()
        push = sp.csc_array((-np.ones(nc), (np.arange(nc), normal)), shape=(nc, size))
        rows, sides = [equal, push], [right, np.zeros(nc)]
        for bound, direction in zip(bounds, (-1.0, 1.0), strict=True):
            if np.isfinite(bound):
                rows.append(sp.csc_array((np.array([direction]), ([0], [size - 1])), shape=(1, size)))
                sides.append(np.array([direction * bound]))
        lines = sum(len(side) for side in sides[1:])
        weight, heads = (mu, np.zeros(d * nc)) if given is None else (np.zeros(nc), np.zeros(d * nc))
        if given is not None:
            heads[normal] = mu * given
        entries = np.concatenate([normal, tangents])
        rows.append(sp.csc_array((np.concatenate([-weight, -np.ones(len(tangents))]), (entries, entries)), shape=(d * nc, size)))
        cones = [clarabel.ZeroConeT(len(right)), clarabel.NonnegativeConeT(lines), *[clarabel.SecondOrderConeT(d)] * nc]
        cost = np.zeros(size)
        cost[-1] = -sign
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        A = sp.csc_matrix(sp.vstack(rows))
        answer = clarabel.DefaultSolver(sp.csc_matrix((size, size)), cost, A, np.concatenate([*sides, heads]), cones, settings).solve()
        if answer.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            return None
        x = np.array(answer.x)
        return float(x[-1]), x[:-1], np.array(answer.z)[: len(right)]


def _undecided(problem: LimitProblem, law: Literal["associative", "Coulomb"]) -> LimitLoad:
    m, n = problem.contacts.dimension * len(problem.contacts), problem.blocks.model.n_dofs
    return LimitLoad(law, "undecided", np.nan, np.zeros(m), np.zeros(n))
