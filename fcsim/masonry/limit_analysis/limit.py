"""Limit analysis of rigid blocks: the largest load multiplier that contact forces can bear.

Associative: max lambda subject to H r + dead + lambda live = 0, r in K (Coulomb's cone at every contact). By the static theorem there is no
equilibrium above it, so every structure with Coulomb friction has fallen by then; with hinges only it is the collapse load. The
multipliers of the equilibrium, v with live . v = 1, are the mechanism: H^T v in K*, slip with dilatancy.

Coulomb: slip opens no joint. A fixed point of limit problems with Tresca's friction, |r_T| <= mu N for N given, with N = r_N of their
answers, is a state of incipient collapse under Coulomb's law; such states are not unique: that of the associative forces is the known
one, which tables hold, and others lead to the lowest that is found.

Sources: M. C. Ferris, F. Tin-Loi, Int. J. Mech. Sci. 43, 2001 (the mathematical program with complementarity constraints); M. Gilbert,
C. Casapulla, H. M. Ahmed, Comput. Struct. 84, 2006 (sequences of limit problems).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.brief import brief
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem
from fcsim.masonry.limit_analysis.programs import ASTRAY, Answer, Program, slip_of

ROUNDS, _FURTHER = 60, 20  # of the fixed point; from further beginnings, once one has led to a state
_SETTLED, _NEAR = 1e-5, 1e-3
_FIRST_SHARE, _LEAST_SHARE = 0.5, 0.01  # of Coulomb's cones beside Tresca's disks, halved each time that rounds settle
_JUMPS = 5  # rounds of the fixed point before it takes half steps
_BY_CHANCE, _SEED = 2, 21  # beginnings of the fixed point with normal forces of chance

Outcome = Literal["limit", "unbounded", "falls", "undecided"]


@dataclass(frozen=True, eq=False)
class LimitLoad:
    """What limit analysis says of one law of slip.

    outcome       "limit"; "unbounded": contact forces bear every multiplier; "falls": not even the loads that stay are borne;
                  "undecided": the programs or their fixed point did not converge
    multiplier    the limit (Coulomb: the least of `span`), inf and 0; of what is undecided the last value, not above the associative limit
    r (m,) [N]    contact forces at the limit, of what is borne at every multiplier some under the loads that stay; v (n_dofs,): velocities
                  of the mechanism, live . v = 1 W (of what falls: dead . v = 1 W; of what is borne at every multiplier: 0)
    rounds        of the fixed point
    span          Coulomb: the least and the largest multiplier at which this mechanism and Coulomb's law go together: forces r that are
                  none where it opens, mu r_N against the slip where it slides, in the cone elsewhere. Checked by programs of their own
    dilatancy     Coulomb: by how much slip opens joints still, as a share of mu: 0 but where rounds without any end in no state
    """

    law: Literal["associative", "Coulomb"]
    outcome: Outcome
    multiplier: float
    r: FloatArray
    v: FloatArray
    rounds: int = 0
    span: tuple[float, float] | None = None
    dilatancy: float = 0.0

    __repr__ = brief


def associative_limit(problem: LimitProblem) -> LimitLoad:
    """Return the associative limit load: an upper bound of every load that Coulomb's friction bears."""
    dead, live = problem.dead, problem.live
    bearing = Program(problem, np.zeros_like(dead), dead)
    stands = bearing.solve(at_most=1.0)
    law: Literal["associative"] = "associative"
    if stands is None:
        return _undecided(problem, law)
    if stands.multiplier < 1 - 1e-6:
        return LimitLoad(law, "falls", 0.0, bearing.form.forces(stands.r), bearing.form.velocities(stands.v))
    if not np.abs(live).max() > 0:  # what stands has no mechanism: the program's dual is round-off there
        return LimitLoad(law, "unbounded", np.inf, bearing.form.forces(stands.r), np.zeros_like(dead))
    program = Program(problem, dead, live)
    found = program.solve()
    if found is None:  # no maximum: is there equilibrium far beyond all proportions?
        found = program.solve(at_most=1e6 * program.natural)
        if found is None or found.multiplier < 0.99e6 * program.natural:
            return _undecided(problem, law)
        return LimitLoad(law, "unbounded", np.inf, bearing.form.forces(stands.r), np.zeros_like(dead))  # not those of such a load
    return LimitLoad(law, "limit", found.multiplier, program.form.forces(found.r), program.form.velocities(found.v))


def coulomb_limit(problem: LimitProblem, start: LimitLoad) -> LimitLoad:
    """Return the multiplier at which Coulomb's friction allows a mechanism, by the fixed point from the associative answer `start` on."""
    if start.outcome != "limit":
        return LimitLoad("Coulomb", start.outcome, start.multiplier, start.r, start.v)
    program = Program(problem, problem.dead, problem.live)
    found = _fixed_point(program, start, _normals(program, start), ROUNDS)
    return found if found.outcome == "limit" else _dilatant(program, start) or found


def lowest_limit(problem: LimitProblem, start: LimitLoad, known: LimitLoad) -> LimitLoad:
    """Return the lowest of `known`, from the associative answer `start`, and of the fixed points that other forces lead to.

    From no friction at all, from the forces of the loads that stay and from chance ones, always the same. 4 of 49 seeded walls have one
    1 to 8 % below that of the associative forces, and fall there or near.
    """
    if start.outcome != "limit":
        return known
    program, least = Program(problem, problem.dead, problem.live), known
    for normals in _beginnings(problem, program, start):
        decided = least.outcome == "limit"
        found = _fixed_point(program, start, normals, _FURTHER if decided else ROUNDS)
        if found.outcome == "limit" and (not decided or found.multiplier < least.multiplier):
            least = found
    return least


def _beginnings(problem: LimitProblem, program: Program, start: LimitLoad) -> Iterator[FloatArray]:
    """Normal forces (nc,) of the program from which fixed points are sought besides the associative ones."""
    dead, normals = problem.dead, _normals(program, start)
    yield np.zeros_like(normals)
    alone = Program(problem, np.zeros_like(dead), dead)
    stands = alone.solve(at_most=1.0)
    if stands is not None:
        yield _of_normals(program, alone.form.forces(stands.r))
    dice = np.random.default_rng(_SEED)
    for _ in range(_BY_CHANCE):
        yield normals * dice.uniform(0.0, 2.0, len(normals))


def _normals(program: Program, start: LimitLoad) -> FloatArray:
    """The normal forces (nc,) of a limit load in the program's form."""
    return _of_normals(program, start.r)


def _of_normals(program: Program, r: FloatArray) -> FloatArray:
    return np.maximum(program.form.own_forces(r)[:: program.form.dimension], 0.0)


def _fixed_point(program: Program, start: LimitLoad, given: FloatArray, most: int) -> LimitLoad:
    """The state of collapse in which the normal forces of Tresca's law are those of its answer, from `given` (nc,) on, in at
    most so many rounds.

    Where the rounds go on without one, the least of the mechanisms that they passed and that were certified.
    """
    d = program.form.dimension
    last = start.multiplier
    certified: LimitLoad | None = None
    for rounds in range(1, most + 1):
        found = program.solve(given=given)
        if found is None:
            break
        settled = abs(found.multiplier - last) <= _SETTLED * max(abs(last), 1e-3 * program.natural)
        # a program that is linear settles, and only then is worth its certificate; cones wander among mechanisms
        state = _state_of_collapse(program, found, rounds) if settled or d == 3 or rounds == most else None
        if state is not None and state.span is not None:
            near = _NEAR * max(abs(last), 1e-3 * program.natural)
            if settled and state.span[0] - near <= found.multiplier <= state.span[1] + near:
                return state
            if certified is None or state.multiplier < certified.multiplier:
                certified = state
        # forces are not unique: the answers jump between corners of one set, their mean settles
        normals = np.maximum(found.r[::d], 0.0)
        given, last = normals if rounds <= _JUMPS else 0.5 * (given + normals), found.multiplier
    return certified or LimitLoad("Coulomb", "undecided", min(last, start.multiplier), start.r, start.v, most)


def _dilatant(program: Program, start: LimitLoad) -> LimitLoad | None:
    """The state of collapse with slip that opens joints by the least share of mu at which rounds settle; None: nowhere.

    Friction is bounded by mu ((1 - share) N + share r_N): between Tresca's disks, whose rounds may jump among forces that bear nothing, and
    Coulomb's cones, which bear what can be borne.
    """
    d, share, last, least = program.form.dimension, _FIRST_SHARE, start.multiplier, None
    given = _normals(program, start)
    for rounds in range(1, ROUNDS + 1):
        found = program.solve(given=given, share=share)
        if found is None or share < _LEAST_SHARE:
            break
        normals = np.maximum(found.r[::d], 0.0)
        given = normals if rounds <= _JUMPS else 0.5 * (given + normals)
        if abs(found.multiplier - last) <= _SETTLED * max(abs(last), 1e-3 * program.natural):
            state = _state_of_collapse(program, found, rounds, share)
            least, share = state or least, 0.5 * share
        last = found.multiplier
    return least


def _state_of_collapse(program: Program, found: Answer, rounds: int, dilatancy: float = 0.0) -> LimitLoad | None:
    """The answer's mechanism with forces that belong to it under Coulomb's law, at the least multiplier where they do; None: nowhere."""
    slip, form = slip_of(program, found.v, dilatancy), program.form
    for astray in ASTRAY[form.dimension]:
        least = program.solve(slip=replace(slip, astray=astray), sign=-1.0)
        most = None if least is None else program.solve(slip=replace(slip, astray=astray))
        if least is not None and most is not None:
            r, v, span = form.forces(least.r), form.velocities(found.v), (least.multiplier, most.multiplier)
            return LimitLoad("Coulomb", "limit", least.multiplier, r, v, rounds, span, dilatancy)
    return None


def _undecided(problem: LimitProblem, law: Literal["associative", "Coulomb"]) -> LimitLoad:
    m, n = problem.contacts.dimension * len(problem.contacts), problem.model.n_dofs
    return LimitLoad(law, "undecided", np.nan, np.zeros(m), np.zeros(n))
