"""`auto`: methods of the table that enter a race one after the other as the problem asks for them, so that no choice is needed.

The stages stand below in the order in which they may enter; who works when is the race's business (`race`), by costs counted from the
problem alone (`costs`). A method that fails costs at most about what the one that arrives does.

Noise of relative size a on the entries of a rank-deficient W may leave no solution, since it lets self-stress grow or resists it at
random; the error that can be reached is then a multiple of a, as for a pile of 20 bodies (92 contacts) where it is 0.072 a for a = 1e-6
and 1e-5. Of larger piles with a = 1e-8 that stay above 1e-8, one was left at 1.8e-8 by 117 further starts, each followed by cone
programs that minimise the velocities of its sticking and sliding contacts over all admissible reactions, and one at 3.9e-8 by 18.

Sources: beside each method in the solver table; the conditions and the race are our own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.problem.distributed import DistributedDelassus
from fcsim.solvers.automatic import admm, methods
from fcsim.solvers.automatic.closed import (
    closed,
    elastic_joints,
    held_as_blocks,
    in_bed,
    on_springs,
    singular_here,
    swept_at_the_door,
)
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.expected import FAR, at_first, dearer_than_newton, opening, swept
from fcsim.solvers.automatic.first import newton_first, proximal_first, proximal_is_due, splitting_first
from fcsim.solvers.automatic.interior import interior, interior_first
from fcsim.solvers.automatic.later import (
    BESIDE,
    beside_interior,
    enter_from_zero,
    enter_interior,
    enter_least_squares,
    enter_least_squares_again,
    enter_paths,
    enter_proof,
    exhausted,
    interior_alone,
    interior_leads,
    interior_opens,
    on_a_path,
    still,
)
from fcsim.solvers.automatic.nearby import first_alone
from fcsim.solvers.automatic.over_ranks import automatic_over_ranks
from fcsim.solvers.automatic.pause import run_with_pauses
from fcsim.solvers.automatic.race import LITTLE, Race, RaceOptions, Runner, Stage
from fcsim.solvers.base import Iterate, Monitor, Status
from fcsim.solvers.newton.systems.condensed import last_pattern

SWEEPS_BESIDE = 0.1
"""What sweeps spend beside proximal Newton where edges or faces hold one another: of 400 such problems they solved 7 once that had
begun."""
PATHS_ALONE = 2.0
"""Times what all others have spent that paths from zero spend before they share: once they have begun it is mostly they who arrive (27 of
28 arches and walls in 2D)."""
PROOF_SHARE = 4.0
"""Times what a proof costs that others may spend before it goes first."""
LAST = 40
"""Iterations that Fischer-Burmeister's Newton must be able to take, from both its starts together."""
PLATEAU = 50
"""Times `probe` sweeps after which Gauss-Seidel may be given up, where the last two thirds made the error no tenth smaller."""


@dataclass(frozen=True, kw_only=True)
class AutomaticOptions(RaceOptions):
    """Those of the race, among the stages below."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known = [stage.name for stage in STAGES]
        for name in (name for name in self.without if name not in known):
            raise InputError(f"option without: expected names of {', '.join(known)}, got {name!r}")


def _newton(race: Race) -> float:
    """The price of an iteration of Newton from here."""
    return race.prices.newton(closed(race))


def _enter_sweeps(race: Race) -> bool:
    if swept_at_the_door(race) and interior_opens(race):
        return False
    if newton_first(race) and (on_springs(race) or (race.warm and elastic_joints(race))):  # of 300, of 10 such sweeps solved none
        return race.over("Newton") and race.over("proximal Newton")
    if proximal_first(race):
        return race.over("proximal Newton") or ("proximal Newton" in race.runners and not at_first(race.runners["proximal Newton"]))
    return race.over("Newton") or race.over("splitting") if newton_first(race) or splitting_first(race) else True


def _enter_newton(race: Race) -> bool:
    if not race.options.patience or singular_here(race):
        return False
    if splitting_first(race):
        return race.over("splitting")
    return newton_first(race) or dearer_than_newton(race, swept(race))


def _enter_interior_first(race: Race) -> bool:
    return interior_leads(race) and proximal_is_due(race)


def _enter_proximal(race: Race) -> bool:
    if interior_leads(race) or interior_opens(race):
        return False
    return swept_at_the_door(race) or proximal_is_due(race)


def _share_of_sweeps(race: Race) -> float:
    """Beds of grains may hold as much as the bodies' velocities without being blocks: there sweeps do arrive, seldom once an interior point
    has begun."""
    if "proximal Newton" in race.runners and (held_as_blocks(race) or on_springs(race)):
        return SWEEPS_BESIDE
    return LITTLE if beside_interior(race) else 1.0


def _share_in_beds(race: Race) -> float:
    """Of paths and least squares: in beds from zero proximal Newton and an interior point share alike, others a quarter."""
    return LITTLE if in_bed(race) else 1.0


def _plateau(race: Race, runner: Runner) -> bool:
    return runner.monitor.iterations >= PLATEAU * race.options.probe and runner.gain(2 / 3) < 1 / 0.9


STAGES: tuple[Stage, ...] = (
    Stage(
        "sweeps",
        "Gauss-Seidel (NSGS-AC, then NNCG; NNCG alone up to 20 000 contacts). Enters at once; after Newton or ADMM from a warm start and "
        "where contacts come in joints, after both of Newton's methods where joints of rigid blocks have stiffness. Left where two thirds "
        "of its sweeps made the error no tenth smaller.",
        enters=_enter_sweeps,
        turns=methods.sweeps,
        price=lambda race: race.prices.sweep,
        left=_plateau,
        opens=opening,
        steady=lambda race: True,
        share=_share_of_sweeps,
    ),
    Stage(
        "splitting",
        "ADMM. Enters far from a solution where the sweeps need more than its factor costs, in joints where Newton costs more; after "
        "proximal Newton's first iterations where that is in the bodies' velocities. "
        "Goes on alone as long as each share of iterations brings the error down tenfold.",
        enters=admm.enters,
        turns=admm.turns,
        price=lambda race: race.prices.admm,
        alone=admm.on_track,
        steady=lambda race: True,
        left=lambda race, runner: (race.joints is not None or beside_interior(race)) and not admm.on_track(race, runner),
        share=admm.share,
    ),
    Stage(
        "Newton",
        "NSN-AC. Enters at once where contacts come in joints or blocks in joints with stiffness, and from a warm start unless a probe of "
        "sweeps costs less than one of its iterations on a sparse W; else where the sweeps will cost more. Works alone, "
        "and leaves where a dozen iterations bring no better iterate or one throws the error up, or leads as far, as only a rank-deficient "
        "W does.",
        enters=_enter_newton,
        turns=methods.newton,
        price=_newton,
        alone=lambda race, runner: True,
    ),
    Stage(
        "interior point first",
        "IPM-COULOMB from zero by one path. Enters in the place of proximal Newton where faces of so many bodies hold one another that "
        "its iterations cost little more. Alone, left below 1e-4 and where its path does not lead on.",
        enters=_enter_interior_first,
        turns=interior_first,
        price=lambda race: race.prices.interior,
        alone=lambda race, runner: True,
        left=lambda race, runner: runner.monitor.best <= BESIDE or not on_a_path(runner),
    ),
    Stage(
        "proximal Newton",
        "Enters after Newton. A regular W at each step, for problems where W is rank deficient. Its first iterations are alone.",
        enters=_enter_proximal,
        turns=methods.proximal,
        price=lambda race: race.prices.running(closed(race)),
        alone=lambda race, runner: at_first(runner),
    ),
    Stage(
        "interior point",
        "IPM-COULOMB, in blocks from the best iterate, in beds of grains from zero. Enters, in a problem from zero, where proximal Newton "
        "has ended or is past its own iterations, in blocks if it needs as much as an interior point costs. In beds both share alike; "
        "alone on a central path that leads on in blocks, and in beds of discs, where it goes before proximal Newton.",
        enters=enter_interior,
        turns=interior,
        price=lambda race: race.prices.interior,
        alone=interior_alone,
    ),
    Stage(
        "paths",
        "PROX-PATH. Enters after 30 to 60 iterations of proximal Newton in the velocities of rigid bodies, where the closed contacts hold "
        "more velocities than the bodies have; from zero in edges and faces, once others have spent a piece a contact, or half of one; in "
        "beds from zero after 60 of its iterations, at a quarter of a share. "
        "Works alone from a warm start, in edges and faces until it has spent twice as much as all others.",
        enters=enter_paths,
        turns=methods.paths,
        price=lambda race: race.prices.piece,
        share=_share_in_beds,
        alone=lambda race, runner: race.warm or (held_as_blocks(race) and runner.spent < PATHS_ALONE * (race.spent() - runner.spent)),
    ),
    Stage(
        "proof",
        "A certificate that there is no solution. Enters far from one, once proximal Newton has begun and the others have spent twice as "
        "much; goes first once they have spent four times as much, and at once where bodies approach though no reaction moves them.",
        enters=enter_proof,
        turns=methods.proof,
        price=lambda race: race.prices.proof,
        alone=lambda race, runner: still(race) or (race.best > FAR and race.spent() > PROOF_SHARE * race.prices.proof),
    ),
    Stage(
        "least squares",
        "Levenberg-Marquardt on the error. Enters after proximal Newton, or where that is stuck near a solution: where noise leaves "
        "none, or one that is nearly none.",
        enters=enter_least_squares,
        turns=methods.least_squares,
        price=lambda race: race.prices.least_squares(closed(race)),
        share=_share_in_beds,
    ),
    Stage(
        "least squares again",
        "Levenberg-Marquardt from the best iterate. Enters where all others are at their end and one has come nearer since it ended: "
        "from a tenth farther it may not get there.",
        enters=enter_least_squares_again,
        turns=methods.least_squares,
        price=lambda race: race.prices.least_squares(closed(race)),
    ),
    Stage(
        "proximal Newton from zero",
        "Enters where proximal Newton from the best iterate has ended, or has long made the error no tenth smaller, as in a valley that it "
        "does not leave; in beds of grains once the interior point has ended.",
        enters=enter_from_zero,
        turns=methods.proximal_from_zero,
        price=lambda race: race.prices.running(closed(race)),
    ),
    Stage(
        "Fischer-Burmeister",
        "NSN-FB-NLS from the best iterate, then from zero. Enters where all others are at their end, for half of what they have spent: for "
        "solutions at which contacts touch without a reaction or are about to slide, where reactions are not unique.",
        enters=lambda race: not race.running() and race.over("proximal Newton from zero") and methods.last_iterations(race) >= LAST,
        turns=methods.fischer_burmeister,
        price=lambda race: race.prices.newton(0),
    ),
)


def automatic(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: AutomaticOptions) -> Iterate:
    """Solve the problem by the stages above; the status is that of the last one, the iterate the best of all. Where
    ranks have W together these come last, on all of W, after what all ranks do together (`over_ranks`)."""
    if isinstance(problem.W, DistributedDelassus):
        iterate = automatic_over_ranks(problem, r, monitor, options)
        if iterate.status in (Status.SOLVED, Status.TIME_LIMIT):
            return iterate
        problem, r = problem.whole, iterate.r
    if monitor.unproven:
        options = replace(options, without=(*options.without, "proof"))
    answer, runners = first_alone(problem, r, monitor, options, STAGES)
    if answer is not None:
        return answer
    joints, fitting = problem.delassus.joints_like(last_pattern(monitor.memory)), problem.stored()
    swept = problem if isinstance(fitting.W, np.ndarray) else fitting  # block rows are made of sparse storage if there is any
    race = Race(fitting, swept, monitor, options, Prices.of(fitting, problem.delassus, joints), bool(np.any(r)), joints, r, runners)
    if not runners and monitor.record(r, fitting.W @ r + fitting.q) <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    try:
        return run_with_pauses(race, [stage for stage in STAGES if stage.name not in options.without], exhausted)
    finally:
        race.runners.clear()  # their turns hold the race, which holds them: a circle that would keep W until Python looks for circles
