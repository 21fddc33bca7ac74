"""What the stages of `auto` run: methods of the solver table by turns, each with the options that suit it beside the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.block_rows import embed_vector
from fcsim.problem.infeasible import certificate
from fcsim.solvers.automatic.closed import edges, elastic, held_as_blocks, in_bed, kept, newton_stays, on_springs, unlike
from fcsim.solvers.automatic.race import Race, ShareOfMonitor
from fcsim.solvers.base import Iterate, Options, Status
from fcsim.solvers.gauss_seidel._sweep_kernels import change_to_await
from fcsim.solvers.gauss_seidel.conjugate import nncg
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.gauss_seidel.rows import ContactRows
from fcsim.solvers.gauss_seidel.sweeps import GaussSeidelOptions, nsgs
from fcsim.solvers.newton.iterations import local_turns
from fcsim.solvers.newton.levenberg_marquardt import levenberg_marquardt_turns
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.proximal.options import PROXIMAL_NEWTON
from fcsim.solvers.proximal.path_steps import PathOptions, path_turns
from fcsim.solvers.proximal.steps import proximal_turns
from fcsim.solvers.turns import Turns
from fcsim.solvers.variational.admm import AdmmOptions, split_turns
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import ProblemWatch

RANK_DEFICIENT = 3e3
"""Growth of the error in a Newton iteration that only rank-deficient W shows (measured: below 200 for full rank, above 1e4 else)."""
LONGEST = 3e4
"""Newton's longest step over what is left of its equations. Steps of a hyperstatic wall are at most 1.3e4 times as long, those along a null
space of W, a self-stress that is as good as any other, by chance as long as round-off lets them: mostly 1e7 and more, few below 1e6.
From a warm start, whose equations are met to some 1e-8, a step that passes takes less than 3e-4 of the forces along there."""
COLD_RHO = 8.0
"""Factor on Newton's first rho from a cold start, where velocities say more than reactions (a fifth fewer iterations on walls)."""
WATCHED = 5
"""ADMM's iterations between two errors: its iterates pass by good ones before they swing, and the best counts."""
TURN, LONGEST_TURN = 12, 40
"""Where sweeps are NNCG from the beginning, its direction kept from turn to turn: how many turns their next is a part of,
and its sweeps at the most. A look at the error costs about one of them, and it swings by a factor of 2 to 20 from sweep to sweep: who
looks seldom misses iterates that are good enough."""
TRIED, NEARER = 5, 0.9
"""Turns of sweeps from another method's iterate without an error below that share of what it was, after which their own course goes on."""
OVERTAKEN = 0.1
"""Share of its own error below which Gauss-Seidel and proximal Newton take up another method's iterate."""
ALPHA = 0.1
"""Proximal Newton's first alpha over the square root of the error, where it eliminates in the bodies' velocities: what it comes down to by
itself on its way to that error (measured on piles of a thousand boxes). Noise on W needs the large one. In joints of bodies of many
velocities as well: 38 steps of a wall in an earthquake took 113 iterations for 126, of one of elastic and rigid bricks 0.92 of the time;
0.03 there 92, but 1.1 of the time."""

SWEEPS = GaussSeidelOptions()
PATHS = PathOptions()
PATHS_IN_MOTION = PathOptions(newton_along=0, along=2.0, regained=2.0, longest=1200, patience=400)
"""From a warm start: ten long steps of rigid masonry in motion took 104 000 pieces by the options of the table, whose paths are lost again
where alpha falls tenfold after each, 51 000 by another `along`; of 97 others `newton_along` and `regained` took 0.87 of the time."""
ANEW = 12_000
"""Pieces after which paths from a warm start begin anew from zero, by turns of as many: of 35 hard steps those that took 41 000 and 27 000,
by others in the end, take 4800 and 3800 from zero, one that was not solved 6000, the others more or less."""
NEWTON = NewtonOptions(formulation="AC", rho="adaptive", divergence=RANK_DEFICIENT, longest=LONGEST)
FISCHER_BURMEISTER = NewtonOptions(formulation="FB", rho="spectral norm")
PROXIMAL_OF_BLOCKS = replace(PROXIMAL_NEWTON, metric="identity", alpha=1e-3, sigma=5.0, easy=8)
"""Proximal Newton's options after the first sweeps where edges or faces of bodies hold one another: as with PPA-NSN-AC, alpha falls faster,
and one number for all contacts weighs it."""
PROXIMAL_OF_FACES = replace(PROXIMAL_OF_BLOCKS, internal_options={"max_iterations": 12}, forgotten=0.5)
"""Those in faces: 54 boxes, walls and towers took 1210 iterations to 1e-4, for 1471 with a first alpha of 1e-2 and eight inside. An alpha
that failed far from the solution keeps the last tenfolds slow: nearly singular beds to 1e-8 took 0.91 of the counted cost for 0.7."""
PROXIMAL_OF_FACES_LOOSE = replace(PROXIMAL_OF_FACES, internal_error_ratio=2.0)
"""Those in faces to less than `LOOSE_BELOW`: inner problems solved to a half of the error. 40 boxes, walls, towers and nearly singular
piles to 1e-8 took 1200 iterations for 1388."""
LOOSE_BELOW = 1e-4
"""To 1e-4 looser inner problems in faces gain nothing in the mean, and a layer of 2000 boxes takes twice the iterations."""
PROXIMAL_OF_EDGES = replace(PROXIMAL_NEWTON, internal_options={"max_iterations": 15})
"""Those where edges of 2D bodies hold one another, whose inner problems do arrive after more than eight iterations."""
PROXIMAL_OF_EDGES_FIRST = replace(PROXIMAL_OF_BLOCKS, internal_options={"max_iterations": 15})
"""Those there from zero: ten walls in 2D took 168 iterations to 1e-4 for 274, 18 arches as many."""
PROXIMAL_OF_JOINTS = PROXIMAL_OF_EDGES_FIRST
"""Those in joints of bodies of many velocities, where Newton's method fails since W is singular all the same: 22 steps of a wall of elastic
and rigid bricks took 339 iterations; PROX-NEWTON's own options take 2300 on 43 of them and solve 33 in 150 each. Of nodes 70 for 98."""
PROXIMAL_LOOSE = replace(PROXIMAL_NEWTON, sigma=2.0, easy=3, internal_error_ratio=2.0)
"""Those where joints have stiffness, and in beds of grains: inner problems are solved to a half, not a tenth, of the error, and alpha is
halved. 43 steps that Newton's method leaves (three structures, 5e8 to 5e10 N/m) took 4350 iterations for 5890; of 40 beds that sweeps leave
at 1e-8 (300 contacts) 31 were solved in 0.7 s each, by PROX-NEWTON's options 27, those in 6750 iterations for 9450."""
PROXIMAL_BY_ONE_NUMBER = replace(PROXIMAL_LOOSE, metric="identity")
"""Those in beds of grains from the best iterate where W is eliminated, from zero where velocities are or masses are unlike: of the two
starts one has this metric, one the compliances. Of 41 beds in W that sweeps leave at 1e-8 it solved 40 from their iterate in 0.5 s each,
counted, compliances 37; from zero 36 and 37. Of 54 in velocities each solved 47, from zero 45. Of nine beds of 100 rocks of unlike masses,
in W, it solved seven from zero in 1 s each, compliances five."""
SPLITTING = AdmmOptions(initial_rho="norm", rho=1e-3)
SPLITTING_OF_JOINTS = AdmmOptions(initial_rho="norm", rho=3e-5, rho_update="constant")


def sweeps(race: Race, monitor: ShareOfMonitor) -> Turns:
    """Gauss-Seidel, then NNCG, by turns that grow with what was swept; where another method is well ahead, from its iterate."""
    rows = ContactRows.of(race.swept, ONE_CONTACT[SWEEPS.one_contact].rho)
    if kept(race):
        return conjugate_sweeps(race, monitor, rows)
    return sweeps_anew(race, monitor, rows)


def sweeps_anew(race: Race, monitor: ShareOfMonitor, rows: ContactRows) -> Turns:
    """NSGS-AC for a probe, then NNCG that begins anew at each turn."""
    r = race.best_r()
    while True:
        turn = max(race.options.probe, monitor.iterations // 4)
        options = replace(SWEEPS, max_iterations=min(monitor.iterations + turn, race.options.max_iterations))
        sweeping = nsgs if monitor.iterations < race.options.probe else nncg
        iterate = sweeping(race.problem, r, monitor, options, rows=rows)
        if iterate.status is not Status.MAX_ITERATIONS:
            return iterate
        yield
        r = race.best_r() if overtaken(race, monitor) else iterate.r


@dataclass(eq=False)
class Line:
    """A course of NNCG: the reactions after a sweep and the next one's start, its direction (nc, 3 each), ||g||^2 of the last sweep,
    the relative change after which the error is looked at, and the turns that it still has without a better error (None: no end)."""

    reaction: FloatArray
    start: FloatArray
    direction: FloatArray
    awaited: float
    last: float = 0.0
    turns: int | None = None

    @staticmethod
    def begun(r: FloatArray, dimension: int, awaited: float, turns: int | None = None) -> Line:
        """From the reactions r (m,)."""
        reaction = embed_vector(r, dimension)
        return Line(reaction, reaction.copy(), np.zeros_like(reaction), awaited, turns=turns)


def conjugate_sweeps(race: Race, monitor: ShareOfMonitor, rows: ContactRows) -> Turns:
    """NNCG whose direction is kept from turn to turn. Where another method is well ahead it is tried from that iterate, once; where that
    comes no nearer, its own course goes on where it was: that may have found out which contacts hold, and from a valley none returns."""
    one, d, order = ONE_CONTACT[SWEEPS.one_contact], race.problem.dimension, np.arange(race.problem.nc)
    frozen, most = np.zeros(len(order), dtype=np.int64), race.options.max_iterations
    own = line = Line.begun(race.best_r(), d, monitor.tol)
    tried = float("inf")
    while True:
        turn = max(race.options.probe, min(monitor.iterations // TURN, LONGEST_TURN))
        line.last, size, done, failed = one.sweep_conjugate(
            *(rows.indptr, rows.indices, rows.blocks, rows.diagonal, rows.shift, rows.q, rows.mu, rows.rho, order, line.reaction, frozen),
            *(line.start, line.direction, line.last, SWEEPS.local_tolerance, SWEEPS.local_iterations, SWEEPS.relaxation),
            *(min(turn, most - monitor.iterations), line.awaited),
        )
        monitor.iterations += done
        monitor.beside += failed * race.prices.unsolved_contact
        r = line.reaction[:, :d].flatten()
        error = monitor.record(r, rows.velocity(line.reaction)[:, :d].flatten())
        if error <= monitor.tol:
            return Iterate(r, Status.SOLVED)
        status = Status.STAGNATED if line.last == 0.0 and line is own else monitor.stopped(error, most)
        if status is not None:
            return Iterate(r, status)
        if done < turn and size > 0.0:  # where some reactions are far larger than others it may stay so
            line.awaited = change_to_await(line.awaited, float(np.sqrt(line.last / size)), monitor.tol / error)
        yield
        if line.turns is not None:
            nearer = error < NEARER * tried
            line.turns, tried = (TRIED, error) if nearer else (line.turns - 1, tried)
            if not line.turns or line.last == 0.0:
                line = own
        if race.best < OVERTAKEN * min(monitor.best, tried):
            monitor.taken_up = tried = race.best
            line = Line.begun(race.best_r(), d, monitor.tol, TRIED)


def newton(race: Race, monitor: ShareOfMonitor) -> Turns:
    """NSN-AC as long as every `patience` iterations bring a better iterate."""
    return local_turns(race.problem, race.best_r(), monitor, newton_options(race), once=not newton_stays(race))


def newton_options(race: Race) -> NewtonOptions:
    """Those of `newton`."""
    factor = 1.0 if race.warm else COLD_RHO
    return replace(NEWTON, rho_factor=factor, max_iterations=race.options.max_iterations, patience=race.options.patience)


def splitting(race: Race, monitor: ShareOfMonitor, options: AdmmOptions) -> Turns:
    """ADMM from zero, which suits it better than sweeps' iterate; where contacts come in joints one factor, many cheap iterations."""
    vi = Inequality.coulomb(race.problem)
    watch = ProblemWatch(vi.velocity, monitor, options.max_iterations, period=WATCHED)
    run = split_turns(vi, np.zeros(race.problem.m), watch, options)
    while True:
        try:
            next(run)
        except StopIteration as stop:
            iterate: Iterate = stop.value
            return iterate
        monitor.speed = watch.speed / (monitor.scale or 1.0)
        yield


def proximal(race: Race, monitor: ShareOfMonitor) -> Turns:
    """Proximal Newton from the best iterate; where another method is well ahead, from its iterate, but in beds."""

    def begin() -> Turns:
        options = PROXIMAL_OF_EDGES if edges(race) else PROXIMAL_NEWTON
        if race.prices.in_velocities and not race.warm and held_as_blocks(race):
            of_faces = PROXIMAL_OF_FACES_LOOSE if race.monitor.tol < LOOSE_BELOW else PROXIMAL_OF_FACES
            options = of_faces if race.problem.dimension == 3 else PROXIMAL_OF_EDGES_FIRST
        elif on_springs(race):
            options = PROXIMAL_LOOSE
        elif elastic(race):
            options = PROXIMAL_OF_JOINTS
        elif in_bed(race):
            options = PROXIMAL_LOOSE if race.prices.in_velocities else PROXIMAL_BY_ONE_NUMBER
        begins_near = race.prices.in_velocities or elastic(race)
        alpha = min(options.alpha, ALPHA * float(np.sqrt(race.best))) if begins_near else options.alpha
        options = replace(options, max_iterations=race.options.max_iterations, alpha=alpha)
        return proximal_turns(race.problem, race.best_r(), monitor, options)

    return _anew_where_overtaken(race, monitor, begin)


def proximal_from_zero(race: Race, monitor: ShareOfMonitor) -> Turns:
    """Proximal Newton from r = 0 by looser inner problems, in beds by the metric that it has not from the best iterate; by one number where
    masses are unlike: by the compliances heavy bodies hold still while light ones settle."""
    by_one_number = in_bed(race) and (race.prices.in_velocities or unlike(race))
    options = PROXIMAL_BY_ONE_NUMBER if by_one_number else PROXIMAL_LOOSE
    options = replace(options, max_iterations=race.options.max_iterations)
    return proximal_turns(race.problem, np.zeros_like(race.start), monitor, options)


def paths(race: Race, monitor: ShareOfMonitor) -> Turns:
    """PROX-PATH's proximal steps along paths from the best iterate; where another method is well ahead, from its iterate. From a warm start
    by turns of `ANEW` pieces with those from where proximal Newton leads from zero."""
    options = replace(PATHS_IN_MOTION if race.warm else PATHS, max_iterations=race.options.max_iterations)
    first = _anew_where_overtaken(race, monitor, lambda: path_turns(race.problem, race.best_r(), monitor, options))
    runs = [first, _paths_from_zero(race, monitor, options)] if race.warm else [first]
    while True:
        until = monitor.iterations + ANEW
        try:
            while monitor.iterations < until:
                next(runs[0])
                yield
        except StopIteration as stop:
            iterate: Iterate = stop.value
            if iterate.status in (Status.SOLVED, Status.TIME_LIMIT) or len(runs) == 1:
                return iterate
            runs.pop(0)
        else:
            runs.append(runs.pop(0))


def _paths_from_zero(race: Race, monitor: ShareOfMonitor, options: PathOptions) -> Turns:
    """PROX-PATH from r = 0, its iterations of PROX-NEWTON first."""
    r = np.zeros_like(race.start)
    alpha = min(PROXIMAL_NEWTON.alpha, ALPHA * float(np.sqrt(monitor.error(r, race.problem.q))))
    most = min(monitor.iterations + options.before, options.max_iterations)
    iterate = yield from proximal_turns(race.problem, r, monitor, replace(PROXIMAL_NEWTON, alpha=alpha, max_iterations=most))
    if iterate.status in (Status.SOLVED, Status.TIME_LIMIT):
        return iterate
    return (yield from path_turns(race.problem, iterate.r, monitor, options))


def overtaken(race: Race, monitor: ShareOfMonitor) -> bool:
    """Whether another method is well ahead, whose iterate is taken up then, which the monitor is told."""
    ahead = race.best < OVERTAKEN * monitor.best
    if ahead:
        monitor.taken_up = race.best
    return ahead


def _anew_where_overtaken(race: Race, monitor: ShareOfMonitor, begin: Callable[[], Turns]) -> Turns:
    """What `begin` makes, made anew where another method is well ahead. Not in beds of grains: there the error swings by tenfolds on the
    way to a solution, and the best iterate of others seldom lies on one."""
    while True:
        run = begin()
        behind = False
        while not behind:
            try:
                next(run)
            except StopIteration as stop:
                iterate: Iterate = stop.value
                return iterate
            yield
            behind = not in_bed(race) and overtaken(race, monitor)


def fischer_burmeister(race: Race, monitor: ShareOfMonitor) -> Turns:
    """NSN-FB-NLS from the best iterate, then from zero: half the iterations of what it may spend each."""
    each = last_iterations(race) // 2
    for r in (race.best_r(), np.zeros(race.problem.m)):
        options = replace(FISCHER_BURMEISTER, max_iterations=monitor.iterations + each)
        iterate = yield from local_turns(race.problem, r, monitor, options, once=True)
        if iterate.status in (Status.SOLVED, Status.TIME_LIMIT):
            break
    return iterate


def last_iterations(race: Race) -> int:
    """Iterations of Newton on all contacts that cost half of what all have spent, 400 at most."""
    return min(400, int(0.5 * race.spent() / race.prices.newton(0)))


def least_squares(race: Race, monitor: ShareOfMonitor) -> Turns:
    """Levenberg-Marquardt on the error itself, from the best iterate."""
    return levenberg_marquardt_turns(race.problem, race.best_r(), monitor, Options(max_iterations=race.options.max_iterations))


def proof(race: Race, monitor: ShareOfMonitor) -> Turns:
    """Look for a certificate that there is no solution."""
    monitor.iterations += 1
    found = certificate(race.problem)
    yield
    if found is None:
        return Iterate(race.best_r(), Status.STAGNATED)
    return Iterate(race.best_r(), Status.INFEASIBLE, found.message, found)
