"""`auto`: a method that chooses and chains others from the problem itself, so that no choice is needed.

1. Probe. From a warm start Newton goes first, and where contacts come in joints of deformable bodies, since multifrontal elimination
   makes it cheap there; else a few Gauss-Seidel sweeps do, since they are cheap, make reactions positive and show how fast
   Gauss-Seidel converges here.
2. Race. A model of the costs (entries of W, size, density; no clock, so that runs repeat exactly) and the measured rate say whether
   Gauss-Seidel will arrive before Newton; it goes on in growing chunks as long as it will, and after Newton has failed as long as it will
   arrive before the proximal stage (4). Where it needs more than ADMM's one factorisation costs, some iterations of ADMM are tried first,
   and more as long as they bring the error down quickly (where contacts come in joints, before Newton, if they are so many that Newton's
   factorisations from afar cost more than ADMM's one).
3. Newton, plain (NSN-AC, from a cold start with a larger first rho): exact for full-rank W, given up when a dozen iterations bring no
   better iterate, or when the first one throws the error up by orders of magnitude, as it does for rank-deficient W (factors of 1e4 and
   more; of 1e2 for full rank).
4. Proximal Newton: with the prox centre r_k solve the regularised problem W + alpha D, q - alpha D r_k, whose solution is r_k+1; D are the
   contacts' own compliances, so that contacts of light and of heavy bodies make equal steps. alpha D makes rank-deficient W regular and
   pulls Newton into its basin; alpha falls while the inner solves are easy and grows when they fail (near a solution the first of these are
   tried with a rho that adapts as well, since single contacts may cycle with a constant one), where the natural map takes turns with
   Alart-Curnier. Its fixed points solve the problem itself, whatever alpha. An inner solve that does not arrive still gives a step if it
   brings the error down. Where noise makes W unsymmetric and indefinite, self-stress may grow without end at alpha below the noise: the
   best iterate is taken up again at a larger alpha. A run that stagnates is followed by one from ADMM's iterate and by one with another
   schedule, and near a solution by short ones from perturbed copies of the best iterate; each ends with Levenberg-Marquardt steps on the
   error itself.
5. Gauss-Seidel from the best iterate, as long as it finds better ones.

Noise of relative size a on the entries of a rank-deficient W may leave no solution, since it lets self-stress grow or resists it at
random; the error that can be reached is then a multiple of a, as for a pile of 20 bodies (92 contacts) where it is 0.072 a for a = 1e-6
and 1e-5. Of larger piles with a = 1e-8 that stay above 1e-8, one was left at 1.8e-8 by 117 further starts, each followed by cone
programs that minimise the velocities of its sticking and sliding contacts over all admissible reactions, and one at 3.9e-8 by 18.

Sources: the proximal point for frictional contact, Acary, Brémond, Huber 2018, section on PPA-NSN; R. T. Rockafellar, SIAM J. Control
Optim. 14, 1976. The schedules of alpha and the race are our own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.block_rows import compressed_blocks
from fcsim.linear.joints import BlockRows, joint_rows
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.gauss_seidel.rows import ContactRows
from fcsim.solvers.gauss_seidel.sweeps import GaussSeidelOptions, nsgs
from fcsim.solvers.newton.iterations import newton
from fcsim.solvers.newton.levenberg_marquardt import levenberg_marquardt
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.regularised import RegularisedNewton
from fcsim.solvers.newton.systems.choice import ONCE_DENSE, ONCE_SPARSE
from fcsim.solvers.variational.admm import AdmmOptions, admm, split
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import ProblemWatch

SPARSE_BELOW = 0.15
"""Density of W below which sparse elimination is cheaper than dense."""
RANK_DEFICIENT = 3e3
"""Growth of the error in a Newton iteration that only rank-deficient W shows (measured: below 200 for full rank, above 1e4 else)."""
FAR = 1e-3
"""Error above which ADMM is tried, and Newton takes long."""
SLOWING = 3.5
"""Times the sweeps that the first ones promise, Gauss-Seidel needs in the end."""
NEWTON_FROM_FAR, NEWTON_FROM_NEAR = 20, 7
"""What Newton needs from errors above and below `FAR`, about (measured, in iterations at the modelled cost)."""
PROXIMAL_FROM_NEAR = 15
"""And what the proximal stage needs from below it."""
WATCHED = 5
"""ADMM's iterations between two errors: its iterates pass by good ones before they swing, and the best counts."""
JOINTS_SHARE = 100
"""ADMM's iterations that must bring the error down tenfold where contacts come in joints of many bodies."""
PLAIN_NEWTON = NewtonOptions(formulation="AC", rho="adaptive", divergence=RANK_DEFICIENT)
COLD_RHO = 8.0
"""Factor on Newton's first rho from a cold start, where velocities say more than reactions (a fifth fewer iterations on walls)."""
RUNAWAY = 100.0
"""Growth of the error over the best one at which the proximal stage goes back to its best iterate."""
INEXACT = 0.5
"""Reduction of the residual at which an inner solve that did not arrive still gives a proximal step, if the error falls too."""
SMALL = 150
"""Up to this many unknowns dense linear algebra is cheapest whatever the density."""


@dataclass(frozen=True)
class Schedule:
    """How a run of the proximal stage goes.

    accuracy of the inner problems relative to the error; rise: factor of alpha where one fails; alpha, outer: shares of the options'
    """

    accuracy: float
    rise: float
    alpha: float = 1.0
    outer: float = 1.0


PATIENT, BOLD = Schedule(accuracy=0.1, rise=3.0), Schedule(accuracy=0.3, rise=5.0)
SHORT = Schedule(accuracy=0.1, rise=3.0, alpha=0.1, outer=0.05)
RETRIES = 2
"""Inner problems of a proximal run, from errors below FAR, that an adapting rho may fail to solve as well before it is given up."""
NEARBY_STARTS, NEAR = 10, 1e-6
"""Short proximal runs from near the best iterate, where its error is small already."""


@dataclass(frozen=True, kw_only=True)
class AutomaticOptions(Options):
    """max_iterations counts sweeps and Newton iterations alike.

    probe: Gauss-Seidel sweeps of the first stage; splitting: ADMM iterations that must bring the error down tenfold (0: no ADMM);
    patience: Newton iterations without a better iterate before the next stage; alpha: first regularisation of the proximal stage,
    relative to each contact's own compliance; outer: its outer iterations without a better iterate before the next attempt or stage.
    """

    max_iterations: int = 100_000
    probe: int = 20
    splitting: int = 30
    patience: int = 12
    alpha: float = 1e-2
    outer: int = 300

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("probe", "splitting", "patience", "outer"):
            if getattr(self, name) < 0:
                raise InputError(f"option {name}: expected an integer >= 0, got {getattr(self, name)}")
        if not self.alpha > 0:
            raise InputError(f"option alpha: expected a number > 0, got {self.alpha}")


def automatic(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: AutomaticOptions) -> Iterate:
    """Solve the problem by the stages above; the status is that of the last one, the iterate the best of all."""
    joints = None if isinstance(problem.W, np.ndarray) else joint_rows(problem.W, problem.dimension)
    warm = bool(np.any(r))
    run = _Run(problem, monitor, options, warm, joints)
    problem = run.problem
    last = Iterate(r, Status.MAX_ITERATIONS)
    stages: tuple[Callable[[FloatArray], Iterate], ...] = (run.second_race, run.proximal, run.sweeps_to_the_end)
    stages = (run.plain_newton, run.race, *stages) if warm or joints is not None else (run.race, run.plain_newton, *stages)
    if joints is not None and not warm and run.splitting_leads():
        stages = (lambda _: run.splitting(), *stages)
    monitor.record(r, problem.W @ r + problem.q)
    for stage in stages:
        last = stage(r)
        if last.status in (Status.SOLVED, Status.TIME_LIMIT):
            return last
        if monitor.best_r is not None:
            r = monitor.best_r
    return Iterate(r, Status.STAGNATED if last.status is Status.SINGULAR else last.status)


def _fitting_storage(problem: LocalProblem, entries: int) -> LocalProblem:
    """Return the problem with W stored dense or in sorted block rows as its size and density ask for, converted once for all stages."""
    W, d = problem.W, problem.dimension
    sparse = problem.m > SMALL and entries < SPARSE_BELOW * problem.m**2
    if sparse and sp.issparse(W) and W.format == "bsr":
        # a copy even of block rows: a factorisation would sort the caller's in place, and later products would differ in the last bits
        W = sp.bsr_array(W, blocksize=(d, d), copy=True)
        W.sort_indices()
    elif sparse:
        indptr, column, blocks = compressed_blocks(W, d)
        W = sp.bsr_array((blocks, column.astype(np.int32), indptr.astype(np.int32)), shape=W.shape)
    elif sp.issparse(W):
        W = W.toarray()
    return problem if W is problem.W else LocalProblem(W, problem.q, problem.mu, dimension=d)


def _entries(W: Any) -> int:
    """Entries of W that are not zero."""
    return int(np.count_nonzero(W.data if sp.issparse(W) else W))


class _Run:
    """One run of the method: the problem, its costs and the stages."""

    def __init__(self, problem: LocalProblem, monitor: Monitor, options: AutomaticOptions, warm: bool, joints: BlockRows | None) -> None:
        entries = _entries(problem.W)
        self.problem = problem if joints is not None else _fitting_storage(problem, entries)
        self._swept = self.problem if sp.issparse(self.problem.W) else problem  # block rows are made of sparse storage if there is any
        self.monitor, self.options, self.warm = monitor, options, warm
        m = problem.m
        self.sparse = sp.issparse(self.problem.W)
        # seconds on a common processor; only their ratio matters
        share = options.splitting
        self.sweep_cost = 6e-10 * entries + 9e-8 * problem.nc
        self.joints = joints
        if joints is not None:
            flops = joints.tree.flops(problem.dimension)
            self.newton_cost = 3e-3 + 1e-8 * entries + 1e-11 * flops
            self.splitting_cost = 1e-3 + 1.5e-11 * flops + JOINTS_SHARE * 3e-9 * entries
        elif self.sparse:
            self.newton_cost = 1e-3 + 1.5e-7 * entries
            self.splitting_cost = 1e-3 + 0.4 * self.newton_cost + share * (5e-5 + 1e-9 * entries)
        else:
            small = m <= ONCE_DENSE
            self.newton_cost = (2.5e-4 + 2.5e-11 * m**3 if small else 5e-4 + 3e-11 * m**3) + 4e-9 * m**2
            self.splitting_cost = 3e-4 + 2e-11 * m**3 + share * (4e-5 + 1e-9 * m**2)
        self.proximal_cost = self.newton_cost
        if self.sparse and joints is None and entries <= ONCE_SPARSE:
            self.proximal_cost = 8e-4 + 3.5e-8 * entries
        self._rows: ContactRows | None = None
        self._chunk, self._sweeps_left, self._untried = options.probe, 0.0, options.splitting > 0

    def _limit(self, count: int) -> int:
        return min(self.monitor.iterations + count, self.options.max_iterations)

    def _sweeps(self, r: FloatArray, count: int) -> Iterate:
        options = GaussSeidelOptions(max_iterations=self._limit(count))
        if self._rows is None:
            self._rows = ContactRows.of(self._swept, ONE_CONTACT[options.one_contact].rho)
        return nsgs(self.problem, r, self.monitor, options, rows=self._rows)

    def race(self, r: FloatArray) -> Iterate:
        """Gauss-Seidel in chunks that double, while it is predicted to arrive before Newton."""
        return self._race(r, NEWTON_FROM_FAR * self.newton_cost, NEWTON_FROM_NEAR * self.newton_cost)

    def second_race(self, r: FloatArray) -> Iterate:
        """The same after Newton has failed, against the proximal stage: nothing far from a solution, where Gauss-Seidel slows down."""
        return self._race(r, 0.0, PROXIMAL_FROM_NEAR * self.proximal_cost)

    def _race(self, r: FloatArray, from_far: float, from_near: float) -> Iterate:
        """from_far, from_near: what the rival costs from errors above and below FAR."""
        monitor = self.monitor
        iterate = Iterate(r, Status.MAX_ITERATIONS)
        while self._chunk and self._sweeps_left * self.sweep_cost <= (from_far if monitor.best > FAR else from_near):
            before, begun = monitor.best, monitor.iterations
            iterate = self._sweeps(r, self._chunk)
            if iterate.status is not Status.MAX_ITERATIONS or monitor.iterations >= self.options.max_iterations:
                return iterate
            r = iterate.r
            swept = monitor.iterations - begun
            gain = np.log(before / monitor.best) / max(swept, 1) if monitor.best < before else 0.0
            self._sweeps_left = np.log(monitor.best / monitor.tol) / gain if gain > 0 else np.inf
            if self._untried and monitor.best > FAR and SLOWING * self._sweeps_left * self.sweep_cost > self.splitting_cost:
                self._untried, iterate = False, self.splitting()
                if iterate.status in (Status.SOLVED, Status.TIME_LIMIT):
                    return iterate
                r = _best(monitor)[0]
            self._chunk *= 2
        return iterate

    def splitting_leads(self) -> bool:
        """Whether ADMM and Newton from its iterate cost clearly less than Newton from afar: many bodies, whose LU is dear."""
        far, near = NEWTON_FROM_FAR * self.newton_cost, NEWTON_FROM_NEAR * self.newton_cost
        return self.options.splitting > 0 and self.splitting_cost + near < 0.7 * far

    def splitting(self) -> Iterate:
        """ADMM from zero, which suits it better than sweeps' iterate, as long as each share of iterations brings the error down tenfold."""
        share, options = self.options.splitting, AdmmOptions(initial_rho="norm", rho=1e-3)
        if self.joints is not None:  # one factorisation, and many cheap iterations
            share, options = JOINTS_SHARE, AdmmOptions(initial_rho="norm", rho=3e-5, rho_update="constant")
        vi = Inequality.coulomb(self.problem)
        watch = _SplittingWatch(vi.velocity, self.monitor, self.options.max_iterations, share)
        return split(vi, np.zeros(self.problem.m), watch, options)

    def plain_newton(self, r: FloatArray) -> Iterate:
        """NSN-AC as long as every `patience` iterations bring a better iterate."""
        if not self.options.patience:
            return Iterate(r, Status.STAGNATED)
        factor = 1.0 if self.warm else COLD_RHO
        options = replace(PLAIN_NEWTON, rho_factor=factor, max_iterations=self.options.max_iterations, patience=self.options.patience)
        return newton(self.problem, r, self.monitor, options, once=True)

    def proximal(self, r: FloatArray) -> Iterate:
        """Proximal point with Newton inside; where it stagnates, again from ADMM's iterate, from r with another schedule, and nearby."""
        iterate = self._proximal_run(r, PATIENT)
        if iterate.status is Status.STAGNATED:
            start = self._relaxed_splitting()
            if start.status in (Status.SOLVED, Status.TIME_LIMIT):
                return start
            iterate = self._proximal_run(start.r, PATIENT)
        if iterate.status is Status.STAGNATED:
            iterate = self._proximal_run(r, BOLD)
        random = np.random.default_rng(0)
        for _ in range(NEARBY_STARTS):
            if iterate.status is not Status.STAGNATED or self.monitor.best > NEAR:
                break
            iterate = self._proximal_run(self._nearby(random), SHORT)
        return iterate

    def _proximal_run(self, r: FloatArray, schedule: Schedule) -> Iterate:
        """A run, and where it stagnates the least error near its best iterate, if that is among the best so far."""
        iterate = self._proximal_point(r, schedule)
        best = self.monitor.best
        if iterate.status is not Status.STAGNATED or self.monitor.error(iterate.r, self.problem.W @ iterate.r + self.problem.q) > 3 * best:
            return iterate
        return levenberg_marquardt(self.problem, iterate.r, self.monitor, self.options.max_iterations)

    def _nearby(self, random: np.random.Generator) -> FloatArray:
        """The best iterate with the reactions of one contact in fifty, at least three, multiplied by random factors."""
        nc = self.problem.nc
        start = _best(self.monitor)[0].reshape(nc, -1).copy()
        few = random.choice(nc, min(nc, max(3, nc // 50)), replace=False)
        start[few] *= random.uniform(0.0, 1.5, (len(few), 1))
        return start.ravel()

    def _relaxed_splitting(self) -> Iterate:
        """ADMM without acceleration, contacts scaled alike: the start that suits piles of very different masses."""
        options = AdmmOptions(
            initial_rho="norm",
            rho=1e-2,
            rho_update="residual balancing",
            acceleration="none",
            relaxation=1.6,
            rescaling="contacts",
            max_iterations=self._limit(10 * self.options.splitting),
        )
        return admm(self.problem, np.zeros(self.problem.m), self.monitor, options)

    def _proximal_point(self, r: FloatArray, schedule: Schedule) -> Iterate:
        """One run from r; alpha adapts to how hard the inner problems are."""
        problem, monitor, W = self.problem, self.monitor, self.problem.W
        inner = RegularisedNewton(problem)
        alpha, formulation, floor = schedule.alpha * self.options.alpha, "AC", 0.0
        error = least = monitor.record(r, W @ r + problem.q)
        best, waited, retries = r, 0, 0
        while waited < schedule.outer * self.options.outer:
            if monitor.out_of_time():
                return Iterate(r, Status.TIME_LIMIT)
            if monitor.iterations >= self.options.max_iterations:
                return Iterate(r, Status.MAX_ITERATIONS)
            target = schedule.accuracy * max(monitor.tol, min(error, 1.0))
            found, watch = inner.solve(r, alpha, target, formulation, monitor)
            monitor.iterations += max(watch.iterations, 1)
            if found.status is not Status.SOLVED and error <= FAR and retries < RETRIES:
                again, second = inner.solve(r, alpha, target, formulation, monitor, adaptive=True)
                monitor.iterations += max(second.iterations, 1)
                if again.status is Status.SOLVED:
                    found, watch = again, second
                else:
                    retries += 1
            waited += 1
            solved = found.status is Status.SOLVED
            new = found.r if solved or watch.best_r is None else watch.best_r
            new_error = monitor.record(new, W @ new + problem.q) if solved or watch.best <= INEXACT * error else np.inf
            if new_error <= monitor.tol:
                return Iterate(new, Status.SOLVED)
            if solved or new_error < 0.9 * error:
                r, error = new, new_error
                if error < least:
                    best, least, waited = r, error, 0
                if error <= RUNAWAY * least:
                    if solved:
                        alpha = max(floor, alpha * (0.3 if watch.iterations <= 4 else 0.6 if watch.iterations <= 8 else 1.0))
                    floor *= 0.7
                    continue
                r, error = best, least
                alpha *= schedule.rise
            # what failed is left behind: well above it for a while, with the other formulation
            alpha *= schedule.rise
            floor = alpha
            formulation = "NM" if formulation == "AC" else "AC"
            if alpha > 1e8:
                break
        return Iterate(best, Status.STAGNATED)

    def sweeps_to_the_end(self, r: FloatArray) -> Iterate:
        """Gauss-Seidel in chunks that double, as long as each brings a better iterate."""
        monitor, chunk = self.monitor, 50 * (self.options.probe or 1)
        while True:
            before = monitor.best
            iterate = self._sweeps(r, chunk)
            if iterate.status is not Status.MAX_ITERATIONS or monitor.iterations >= self.options.max_iterations:
                return iterate
            if monitor.best > 0.9 * before:
                return Iterate(iterate.r, Status.STAGNATED)
            r, chunk = iterate.r, 2 * chunk


class _SplittingWatch(ProblemWatch):
    """Ends ADMM where `share` iterations did not bring the best error down tenfold, or half of them (and a third of all) no better one."""

    def __init__(self, velocity: Callable[[FloatArray], FloatArray], monitor: Monitor, max_iterations: int, share: int) -> None:
        super().__init__(velocity, monitor, max_iterations, period=WATCHED)
        self._share, self._begun, self._next_share = share, monitor.iterations, monitor.iterations + share
        self._before, self._least, self._better = monitor.best, monitor.best, monitor.iterations

    def visit(self, r: FloatArray, u: FloatArray | None, due: bool) -> Status | None:
        status = super().visit(r, u, due)
        if status is not None:
            return status
        now, best = self._monitor.iterations, self._monitor.best
        if best < self._least:
            self._least, self._better = best, now
        if now - self._better > max(0.5 * self._share, (now - self._begun) / 3):
            return Status.MAX_ITERATIONS
        if now >= self._next_share:
            if best > 0.1 * self._before:
                return Status.MAX_ITERATIONS
            self._before, self._next_share = best, now + self._share
        return None


def _best(monitor: Monitor) -> tuple[FloatArray, float]:
    assert monitor.best_r is not None  # the start was recorded
    return monitor.best_r, monitor.best
