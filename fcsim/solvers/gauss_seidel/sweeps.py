"""Nonsmooth Gauss-Seidel on the local problem: contact after contact, each solved with the others' reactions fixed.

Sources: Jourdan, Alart, Jean, "A Gauss-Seidel like algorithm to solve frictional contact problems", Comput. Methods Appl. Mech. Eng.
155, 1998; Acary, Brémond, Huber 2018 (local solvers, light criterion eq. 14). The options are those of Siconos' NSGS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.linear.block_rows import embed_vector
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status, choice
from fcsim.solvers.gauss_seidel._sweep_kernels import change_to_await
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT, OneContact
from fcsim.solvers.gauss_seidel.rows import ContactRows

FULL_AT_LEAST_EVERY = 100
"""Sweeps between two full errors at most: they are the history, and what stagnation is judged by."""
UNWATCHED = 100_000
"""Contacts solved between two looks at the clock, about."""


@dataclass(frozen=True, kw_only=True)
class SweepOptions(Options):
    """What Gauss-Seidel on reactions and on velocities share.

    one_contact           one-contact solver, a name of `ONE_CONTACT`
    local_tolerance       of a contact's own equations, relative to the size of its problem
    local_tolerance_rule  "given"; "adaptive": error / local_error_ratio, but no less than the given one; "adaptive per contact":
                          divided by the number of contacts as well
    local_iterations      cap of the one-contact solver
    shuffle, seed         order of the contacts: "never" (as numbered), "once", "each sweep" (random)
    relaxation            omega of r <- r + omega (new - r): 1 is Gauss-Seidel, others projected SOR
    error_evaluation      when the full error is computed: "light" (eq. 14: when ||r_k+1 - r_k|| / ||r_k+1|| < tau, tau following the ratio
                          of the two), "full" (every error_frequency sweeps), "adaptive" (half-way to where its decrease predicts the end)
    stagnation_sweeps     how many sweeps may pass without the error falling by a tenth before giving up (0 = never)
    """

    max_iterations: int = 10_000
    one_contact: str = "AC"
    local_tolerance: float = 1e-14
    local_tolerance_rule: str = "given"
    local_error_ratio: float = 10.0
    local_iterations: int = 20
    shuffle: str = "never"
    seed: int = 0
    relaxation: float = 1.0
    error_evaluation: str = "light"
    error_frequency: int = 1
    stagnation_sweeps: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        choice("one_contact", self.one_contact, ONE_CONTACT)
        choice("local_tolerance_rule", self.local_tolerance_rule, ("given", "adaptive", "adaptive per contact"))
        choice("shuffle", self.shuffle, ("never", "once", "each sweep"))
        choice("error_evaluation", self.error_evaluation, ("light", "full", "adaptive"))
        self.numbers_from(local_tolerance=0)
        self.numbers_above(local_error_ratio=0)
        self.integers_from(local_iterations=1, seed=0)
        if not 0 < self.relaxation < 2:
            raise InputError(f"option relaxation: expected a number in (0, 2), got {self.relaxation}")
        self.integers_from(error_frequency=1, stagnation_sweeps=0)


@dataclass(frozen=True, kw_only=True)
class GaussSeidelOptions(SweepOptions):
    """And of Gauss-Seidel on reactions alone.

    regularisation  alpha / ||W_aa||: contact a is solved with W_aa + alpha I and q_a - alpha r_a, a proximal step of its own
    filter_local    keep a contact's reaction where the local solution is not finite or worse than it
    freezing        sweeps for which a contact is left out once its change is a tenth of its share of the light criterion (0 = never)
    """

    regularisation: float = 0.0
    filter_local: bool = False
    freezing: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self.numbers_from(regularisation=0)
        self.integers_from(freezing=0)


def contact_order(nc: int, options: SweepOptions) -> Callable[[], IntArray]:
    """Return what gives the order of the contacts for the next sweep."""
    numbered = np.arange(nc)
    if options.shuffle == "never":
        return lambda: numbered
    random = np.random.default_rng(options.seed)
    if options.shuffle == "each sweep":
        return lambda: random.permutation(nc)
    once = random.permutation(nc)
    return lambda: once


def local_tolerance(error: float, nc: int, options: SweepOptions) -> float:
    """The one-contact tolerance that goes with the last full error."""
    if options.local_tolerance_rule == "given":
        return options.local_tolerance
    share = nc if options.local_tolerance_rule == "adaptive per contact" else 1
    return float(np.clip(error / (options.local_error_ratio * share), options.local_tolerance, 0.1))


Sweep = Callable[[float, float, int], tuple[float, int]]
"""sweep(local tolerance, tau, count) -> relative change of the iterate in the last sweep, number of sweeps.

At most `count` sweeps are done, where changes decide ("light" evaluation) none after one that changes the iterate by tau or less."""
Point = Callable[[], tuple[FloatArray, FloatArray]]


def nsgs(
    problem: LocalProblem,
    r: FloatArray,
    monitor: Monitor,
    options: GaussSeidelOptions,
    solver: OneContact | None = None,
    rows: ContactRows | None = None,
) -> Iterate:
    """Nonsmooth Gauss-Seidel with any one-contact solver (default: the one that the options name), from the starting point r (m,).

    rows: the problem's, where they are known already.
    """
    d, nc = problem.dimension, problem.nc
    solver = solver or ONE_CONTACT[options.one_contact]
    if rows is None:
        rows = ContactRows.of(problem, solver.rho, options.regularisation)
    reaction = embed_vector(r, d)
    order, frozen = contact_order(nc, options), np.zeros(nc, dtype=np.int64)
    settled, alike = 0.0, options.shuffle != "each sweep" and not options.freezing

    def sweep(tolerance: float, tau: float, count: int) -> tuple[float, int]:
        nonlocal settled
        change, size, _, done = solver.sweep(
            *(rows.indptr, rows.indices, rows.blocks, rows.diagonal, rows.shift, rows.q, rows.mu, rows.rho, order(), reaction, frozen),
            *(float(tolerance), options.local_iterations, options.relaxation, options.filter_local, options.freezing, settled),
            *(count if alike else 1, tau if options.error_evaluation == "light" else 0.0),
        )
        light = float(np.sqrt(change / size)) if size > 0 else float(change)
        if options.freezing:
            settled = 0.1 * tau * float(np.sqrt(size / nc))
            if light <= tau and frozen.any():  # nothing is over while contacts are left out
                frozen[:] = 0
                return float(max(light, np.nextafter(tau, np.inf))), done
        return light, done

    def point() -> tuple[FloatArray, FloatArray]:
        return reaction[:, :d].flatten(), rows.velocity(reaction)[:, :d].flatten()

    return iterate(sweep, point, nc, monitor, options)


def iterate(sweep: Sweep, point: Point, nc: int, monitor: Monitor, options: SweepOptions) -> Iterate:
    """Sweep until the full error of point() = (r, u), flat, is at most the tolerance."""
    r, u = point()
    error = monitor.record(r, u)
    tau, interval = monitor.tol, options.error_frequency
    last_full = last_progress = monitor.iterations
    least, caution = error, 1.0
    while not error <= monitor.tol:
        if not np.isfinite(error):
            return Iterate(r, Status.DIVERGED)
        if monitor.iterations >= options.max_iterations:
            return Iterate(r, Status.MAX_ITERATIONS)
        if monitor.out_of_time():
            r, u = point()
            return Iterate(r, Status.SOLVED if monitor.record(r, u) <= monitor.tol else Status.TIME_LIMIT)
        tolerance = local_tolerance(caution * error, nc, options)
        by_change = options.error_evaluation == "light"
        # sweeps until the full error is looked at anyway; a share of them at a time, so that the clock is looked at too
        count = (FULL_AT_LEAST_EVERY if by_change else interval) - (monitor.iterations - last_full)
        count = max(1, min(count, options.max_iterations - monitor.iterations, 1 + UNWATCHED // nc))
        light, done = sweep(tolerance, tau, count)
        monitor.iterations += done
        if not np.isfinite(light):
            return Iterate(r, Status.DIVERGED)
        waited = monitor.iterations - last_full
        due = light <= (tau if by_change else 0.0) or waited >= (FULL_AT_LEAST_EVERY if by_change else interval)
        if not due and monitor.iterations < options.max_iterations:
            continue
        r, u = point()
        previous, error = error, monitor.record(r, u)
        if not np.isfinite(error):
            return Iterate(r, Status.DIVERGED)
        last_full = monitor.iterations
        if error <= monitor.tol:
            break
        if light == 0.0:
            if tolerance <= options.local_tolerance:
                return Iterate(r, Status.STAGNATED)
            caution *= 0.1  # every contact is as good as it was asked to be: ask for more
        if light <= tau:
            tau = change_to_await(tau, light, monitor.tol / error)
        if options.error_evaluation == "adaptive":
            # sweeps left at the rate of decrease just seen
            left = np.log(error / monitor.tol) / np.log(previous / error) * waited if error < previous else np.inf
            interval = int(np.clip(min(left / 2, 2 * interval), 1, FULL_AT_LEAST_EVERY))
        if error < 0.9 * least:
            least, last_progress = error, monitor.iterations
        elif options.stagnation_sweeps and monitor.iterations - last_progress >= options.stagnation_sweeps:
            return Iterate(r, Status.STAGNATED)
    return Iterate(r, Status.SOLVED)
