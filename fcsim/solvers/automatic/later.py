"""When the later stages of `auto` enter: interior points, paths, least squares, and proximal Newton from zero."""

from __future__ import annotations

import numpy as np

from fcsim.problem.infeasible import unmoved
from fcsim.solvers.automatic.closed import (
    closed,
    faces,
    held_as_blocks,
    in_bed,
    in_single_points,
    in_small_bed,
    on_springs,
    singular_here,
    swept_at_the_door,
    unlike,
)
from fcsim.solvers.automatic.expected import FAR, PROXIMAL_ALONE, at_first, swept
from fcsim.solvers.automatic.first import proximal_is_due
from fcsim.solvers.automatic.methods import OVERTAKEN
from fcsim.solvers.automatic.race import Race, Runner

LEAST_SQUARES_AFTER, LEAST_SQUARES_LATE = 4.0, 12.0
"""Times what an iteration of least squares costs that was spent when it enters; and where the bodies behind W are known, so that W has
no noise of its own, or touch in single points, whose reactions are nearly unique."""
PATHS_AFTER, PATHS_SOON = 60, 30
"""Iterations of proximal Newton in the velocities of rigid bodies after which paths are followed, and those after which they are where by
its rate it needs more again: easy steps of masonry in motion take it 50 to 80."""
PIECES_OF_EDGES, PIECES_OF_FACES = 1.0, 0.5
"""Pieces a contact whose cost others have spent when paths are followed from zero: those that arrive take 0.1 to 0.9 in faces, 0.3 in the
median, and 1 to 3 in edges."""
PATHS_IN_W = 100
"""Contact unknowns up to which paths are followed in W, whose eliminations are of all of it: in beds of 150 they held others up."""
INTERIOR_OF_BLOCKS = 10
"""Iterations of an interior point that proximal Newton still needs when that enters in blocks. An interior point takes 7 to 30 in faces,
18 to 60 in edges, 22 to 100 in beds of grains."""
INTERIOR_OF_FEW = 15
"""Those that sweeps of a small bed still cost when it enters there, where it takes 8 to 40 from zero."""
BESIDE = 1e-4
"""Error below which an interior point in blocks has little to gain, since it begins with large products again."""
FALLS = 1.4
"""Factor by which the last third of an interior point's iterations brings the root of tau down on a central path that leads on."""
LEADS = 20
"""Its iterations within which each tenfold fall of that comes there: 8 to 14 on paths that arrive, 190 on one that crept for 422."""
PROOF_AFTER = 2.0
"""Times what a proof costs that others have spent when it enters: where there is a solution that costs half as much more at the most."""
STUCK, FRESH = 100, 250
"""Iterations of proximal Newton after which it may be stuck, and those after which a fresh start is due where it is."""

REACH = 3.0
"""Times the tolerance below which the best iterate is about to be good enough: who begins at zero has farther to go."""
LARGE = 1.4
"""An iteration of an interior point over one of proximal Newton, up to which bodies' eliminations make most of either: that of 1400 boxes
1.36, of 1900 contacts of a wall 1.34, of 600 in layers and walls 2."""

EFFORT = 15_000
"""Iterations of proximal Newton whose cost a race may spend where paths of blocks are followed: steps of rigid masonry in motion
that have an answer took up to 6000; 504 blocks had none after 7000."""


def exhausted(race: Race) -> bool:
    """Whether so much was spent on rigid bodies whose contacts hold more than their velocities that an answer is not to be expected: their
    solutions need not be isolated, and all methods creep."""
    if "paths" not in race.runners or race.spent() <= EFFORT * race.prices.proximal(0):
        return False
    return race.warm or held_as_blocks(race)


def within_reach(race: Race) -> bool:
    """Whether the best iterate is within a small factor of the tolerance, and proximal Newton has not ended or stood still for long."""
    runner = race.runners.get("proximal Newton")
    return race.best < REACH * race.monitor.tol and runner is not None and not stuck_for_long(runner)


def enter_interior(race: Race) -> bool:
    """Proximal Newton, from zero, is past the iterations that are its own, and in blocks needs more by its rate than an interior point
    mostly costs: in beds of grains one of the two mostly arrives, which is not known before. A proof that there is nothing to arrive at
    goes first."""
    runner = race.runners.get("proximal Newton")
    if runner is None:
        if not interior_opens(race):
            return False
        if not in_small_bed(race):
            return proximal_is_due(race)
        return swept_at_the_door(race) or swept(race) > INTERIOR_OF_FEW * race.prices.interior
    if race.warm or race.joints is not None or (race.best > FAR and not race.over("proof")):
        return False
    if _zero_comes_first(race) and not race.over("proximal Newton from zero"):
        return False
    if runner.result is not None:
        return True
    if at_first(runner):
        return False
    if held_as_blocks(race):
        return race.best > BESIDE and runner.needs() > INTERIOR_OF_BLOCKS * race.prices.interior
    return not within_reach(race)


def _zero_comes_first(race: Race) -> bool:
    """Whether proximal Newton from zero takes the interior point's place beside that from the best iterate, as in beds of unlike masses,
    where an interior point mostly stays above 1e-3: `mass-ratios:300:9201` to 1e-4 2.4 s for 3.5, ten others 7.8 s for 7.8."""
    return in_bed(race) and unlike(race) and not in_small_bed(race)


def interior_opens(race: Race) -> bool:
    """Whether an interior point goes before proximal Newton, from zero in a bed of few grains, or of discs, where both eliminate in W: as
    long as it has not begun, or its first central path leads on."""
    if race.warm or race.joints is not None or "interior point" in race.options.without:
        return False
    if not in_small_bed(race) and not _in_discs(race):
        return False
    runner = race.runners.get("interior point")
    return runner is None or (runner.result is None and len(runner.monitor.paths) < 2 and on_a_path(runner))


def interior_leads(race: Race) -> bool:
    """Whether an interior point goes first, from zero, since faces of so many bodies hold one another that its iterations cost little more
    than proximal Newton's: it takes 13 to 50 of them however many bodies there are, that more the more there are."""
    if race.warm or race.joints is not None or "interior point first" in race.options.without or race.over("interior point first"):
        return False
    if "interior point first" in race.runners:
        return True
    if race.best <= BESIDE or "proximal Newton" in race.runners or not race.prices.in_velocities or not faces(race):
        return False
    return race.prices.interior <= LARGE * race.prices.running(closed(race))


def _in_discs(race: Race) -> bool:
    """Whether an interior point eliminates in W in a bed of discs which sweeps have brought below `FAR`."""
    return race.problem.dimension == 2 and race.best <= FAR and not race.prices.in_velocities and in_single_points(race)


def beside_interior(race: Race) -> bool:
    """Whether an interior point or paths have begun in a bed of grains: beside these and proximal Newton others seldom arrive."""
    return ("interior point" in race.runners or "paths" in race.runners) and not held_as_blocks(race)


def interior_is_first(race: Race) -> bool:
    """Whether an interior point has still to show what it does in blocks, before ADMM in faces and paths enter."""
    if race.warm or race.joints is not None or "interior point" in race.options.without:
        return False
    runner = race.runners.get("interior point")
    return race.best > BESIDE if runner is None else runner.result is None and on_a_path(runner)


def on_a_path(runner: Runner) -> bool:
    """Whether an interior point is on a central path that leads on: in the first iterations along one, or the last third of them brought
    the root of tau down and each tenfold took few. Of 19 first paths from zero in beds of grains that arrived 17 were so all along, in 19
    to 52 iterations. A further path begins when it is the interior point's turn."""
    paths = runner.monitor.paths
    roots = paths[-1] if paths else []
    done = len(roots)
    if done < PROXIMAL_ALONE:
        return done > 0 or len(paths) < 2
    leads = roots[2 * done // 3 - 1] > FALLS * roots[-1]
    return leads and done <= PROXIMAL_ALONE + LEADS * float(np.log10(roots[0] / roots[-1]))


def interior_alone(race: Race, runner: Runner) -> bool:
    """Whether an interior point goes on alone: on a path that leads on, in edges and faces down to the error below which proximal Newton
    and sweeps, which take up its iterate, are the quicker ones; in beds of discs as long as nobody has begun beside it and the sweeps."""
    if held_as_blocks(race) and not in_small_bed(race):
        return on_a_path(runner) and race.best > BESIDE
    return interior_opens(race)


def enter_paths(race: Race) -> bool:
    """Rigid bodies whose contacts hold more than their velocities, and proximal Newton has not arrived where easy problems do; a proof that
    there is nothing to arrive at goes first. From zero, where edges or faces hold one another, whose paths are of about
    a piece a contact, or half of one, once others have spent as much; in beds of grains beside proximal Newton, which may cycle near a
    solution to which a path of some pieces leads."""
    runner = race.runners.get("proximal Newton")
    if runner is None or (race.best > FAR and not race.over("proof")):
        return False
    if not race.prices.in_velocities:
        return not race.warm and race.joints is None and race.problem.m <= PATHS_IN_W and stuck(runner, PATHS_AFTER)
    if not race.warm and not held_as_blocks(race):
        due = runner.monitor.iterations >= PATHS_AFTER and not at_first(runner)
        return stuck_for_long(runner) or due
    if interior_is_first(race):
        return False
    pieces = PIECES_OF_FACES if faces(race) else PIECES_OF_EDGES
    if not race.warm and race.spent() < pieces * race.problem.nc * race.prices.piece:
        return False
    if not race.warm and runner.result is None and (at_first(runner) or race.best < OVERTAKEN * runner.monitor.best):
        return False  # it has still to show what it does, or what it does from an iterate that is well ahead of its own
    if not singular_here(race):
        return False
    done = runner.monitor.iterations
    return runner.result is not None or done >= PATHS_AFTER or (done >= PATHS_SOON and runner.needs() > runner.spent)


def still(race: Race) -> bool:
    """Whether bodies approach where no reaction moves them, by more than an answer may miss: told by W alone, once."""
    if race.still is None:
        contact, monitor = unmoved(race.problem), race.monitor
        race.still = contact is not None and bool(-race.problem.q[race.problem.dimension * contact] > monitor.tol * monitor.scale)
    return race.still


def enter_proof(race: Race) -> bool:
    """At once where it is plain. Where every contact has a compliance there is a solution: y^T W y > 0."""
    late = "proximal Newton" in race.runners and race.best > FAR and race.spent() > PROOF_AFTER * race.prices.proof
    return still(race) or (late and not on_springs(race))


def enter_least_squares(race: Race) -> bool:
    """After proximal Newton, or where that has long made the error no tenth smaller and would go on, and four times as much was spent as
    an iteration costs."""
    exact = race.problem.delassus.motion is not None or in_single_points(race)
    after = LEAST_SQUARES_LATE if exact else LEAST_SQUARES_AFTER
    if race.best > FAR or (race.running() and race.spent() < after * race.prices.least_squares(closed(race))):
        return False
    runner = race.runners.get("proximal Newton")
    stuck = runner is not None and runner.monitor.iterations > STUCK and runner.gain(0.5) < 1 / 0.9
    return race.over("proximal Newton") or stuck


def enter_least_squares_again(race: Race) -> bool:
    runner = race.runners.get("least squares")
    return runner is not None and not race.running() and race.best < runner.monitor.best


def stuck(runner: Runner, after: int) -> bool:
    """Whether proximal Newton has ended, or has made the error no tenth smaller in half of so many iterations, or more."""
    return runner.result is not None or (runner.monitor.iterations >= after and runner.gain(0.5) < 1 / 0.9)


def stuck_for_long(runner: Runner) -> bool:
    """`stuck` of many iterations."""
    return stuck(runner, FRESH)


def enter_from_zero(race: Race) -> bool:
    """Where proximal Newton from the best iterate ended, or has made the error no tenth smaller in half of many iterations; in beds of
    grains where the interior point has ended, whose share it takes, of unlike masses when that would enter."""
    runner = race.runners.get("proximal Newton")
    if runner is None:
        return not race.running() and race.over("proximal Newton")
    if race.warm:
        return not race.running() and runner.result is not None
    if _zero_comes_first(race) and not at_first(runner) and (race.best <= FAR or race.over("proof")):
        return stuck_for_long(runner) or not within_reach(race)
    return stuck_for_long(runner) or (in_bed(race) and race.over("interior point") and not at_first(runner))
