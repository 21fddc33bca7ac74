"""What all solvers share: status, result, options, the convergence monitor and the description of a method."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.brief import brief, shown
from fcsim.errors import InputError
from fcsim.problem import Checks, GlobalProblem, LocalProblem, natural_map_residual
from fcsim.problem.infeasible import Certificate
from fcsim.problem.judge import relative, size_of
from fcsim.problem.reduction import Reduction
from fcsim.ranks import told
from fcsim.solvers.derivative import GlobalDerivative, LocalDerivative, derivative
from fcsim.solvers.memory import Memory

ERRORS = ("scaled", "published")
"""Which error decides, see `fcsim.problem`."""


class Status(Enum):
    """Why a solver stopped; only SOLVED means that the full error was computed on the result and is at most `tol`."""

    SOLVED = "solved"
    MAX_ITERATIONS = "maximum number of iterations reached"
    STAGNATED = "stagnated"
    SINGULAR = "singular linear system"
    DIVERGED = "diverged"
    TIME_LIMIT = "time limit reached"
    INFEASIBLE = "no solution exists, as a certificate proves"
    EXHAUSTED = "given up after the effort that such problems are worth"

    @property
    def solved(self) -> bool:
        return self is Status.SOLVED


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options that every method has."""

    max_iterations: int = 200

    def __post_init__(self) -> None:
        if self.max_iterations < 0:
            raise InputError(f"max_iterations: expected an integer >= 0, got {self.max_iterations}")

    def integers_from(self, **least: int) -> None:
        """InputError for the first of these options, integers by their names, that is below its least."""
        for name, bound in least.items():
            if (value := getattr(self, name)) < bound:
                raise InputError(f"option {name}: expected an integer >= {bound}, got {value}")

    def numbers_from(self, **least: float) -> None:
        """InputError for the first of these options, numbers by their names, that is below its least, or NaN."""
        for name, bound in least.items():
            if not (value := getattr(self, name)) >= bound:
                raise InputError(f"option {name}: expected a number >= {bound}, got {value}")

    def numbers_above(self, **bounds: float) -> None:
        """InputError for the first of these options, numbers by their names, that is at its bound, below, or NaN."""
        for name, bound in bounds.items():
            if not (value := getattr(self, name)) > bound:
                raise InputError(f"option {name}: expected a number > {bound}, got {value}")


def override[O: Options](options: O, overrides: Mapping[str, object]) -> O:
    """Return the frozen options with the given fields replaced; an unknown name is an InputError that lists the known ones."""
    if not overrides:
        return options
    known = getattr(options, "__dataclass_fields__", {})  # dataclasses.fields takes longer than a sweep of a small problem
    for name, value in overrides.items():
        if name not in known:
            raise InputError(f"option {name!r}: expected one of {', '.join(known)}")
        _refuse_other_types(name, value, str(getattr(known[name].type, "__name__", known[name].type)), getattr(options, name))
    changed: Callable[..., O] = replace  # the names and types are checked above
    # compiled code knows no whole number beyond 64 bits, which a float may be given as
    return changed(options, **{k: float(v) if isinstance(v, int) and abs(v) > LARGEST else v for k, v in overrides.items()})


LARGEST = 2**53
"""Of whole numbers among the options: compiled code counts in 64 bits."""
EXPECTED = {
    "bool": "True or False",
    "int": f"a whole number from {-LARGEST} to {LARGEST}",
    "float": "a number",
    "str": "a text",
}


def _refuse_other_types(name: str, value: object, kind: str, now: object = None) -> None:
    """Refuse what is not of the option's declared type: a method would stumble over it somewhere, or take a text for True."""
    kind, optional = kind.removesuffix(" | None"), kind.endswith(" | None")
    if kind not in EXPECTED and isinstance(now, tuple | Mapping) and not isinstance(value, tuple if isinstance(now, tuple) else Mapping):
        raise InputError(f"option {name}: expected a {kind}, got {str(value)[:40]!r}")
    if kind not in EXPECTED or (optional and value is None):
        return
    switch = isinstance(value, bool | np.bool_)
    fits = {
        "bool": switch,
        "int": isinstance(value, int | np.integer) and not switch and -LARGEST <= value <= LARGEST,
        "float": isinstance(value, int | float | np.integer | np.floating)
        and not switch
        and _is_held(value)
        and value == value,  # NaN is none
        "str": isinstance(value, str),
    }
    if not fits[kind]:
        raise InputError(f"option {name}: expected {EXPECTED[kind]}, got {str(value)[:40]!r}")


def _is_held(value: object) -> bool:
    """Whether a float holds a number's size."""
    return not isinstance(value, int) or abs(value) <= sys.float_info.max


def checked_limits(tol: float, floor: float, time_limit: float) -> None:
    """Refuse tolerances that r = 0 would meet (from 1 on) or nothing can, and floors and time limits that are no numbers."""
    for name, value in (("tol", tol), ("floor", floor), ("time_limit", time_limit)):
        if not isinstance(value, int | float | np.integer | np.floating) or isinstance(value, bool):
            raise InputError(f"{name}: expected a number, got {str(value)[:40]!r}")
    if not tol > 0:
        raise InputError(f"tol: expected a number > 0, got {tol}")
    if tol >= 1:
        raise InputError(f"tol: expected a number < 1, since r = 0 meets that, got {tol}")
    if not 0 <= floor < math.inf:
        raise InputError(f"floor: expected a number >= 0 in the unit of q, got {floor}")
    if math.isnan(time_limit):
        raise InputError(f"time_limit: expected a number of seconds, got {time_limit}")


@dataclass(frozen=True)
class Criterion:
    """When a problem counts as solved: tol, on which of ERRORS (`error`), with the floor [unit of q] of ||q||; time_limit [s]."""

    tol: float
    error: str = "scaled"
    floor: float = 0.0
    time_limit: float = math.inf


def choice(name: str, value: str, known: Collection[str]) -> None:
    """Refuse an option value that is not among the known ones."""
    if not isinstance(value, str) or value not in known:
        raise InputError(f"option {name}: expected one of {', '.join(map(repr, known))}, got {shown(value)}")


class Monitor:
    """Computes the one error of an iterate, keeps the history (iteration, seconds, error) and the best iterate, watches the clock.

    compliance: s (nc,) of the scaled error, None for the published one, whose s is 1.
    velocity: u (m,) from r (m,) by the problem's own equations. Methods may carry u along as they move r; that drifts from W r + q, so
    that an error at or below `tol` counts only when it was computed with this u.
    memory: what earlier solves left and what this one leaves, None where nothing is to be kept (see `fcsim.solvers.memory`).
    passed, unproven: whether the compiled front door (`solvers.small`) has tried the problem, and found no proof that it has no solution.
    """

    def __init__(
        self,
        q: FloatArray,
        mu: FloatArray,
        dimension: int,
        tol: float,
        *,
        compliance: FloatArray | None = None,
        floor: float = 0.0,
        time_limit: float = float("inf"),
        start: float | None = None,
        velocity: Callable[[FloatArray], FloatArray] | None = None,
        memory: Memory | None = None,
    ) -> None:
        self.memory, self._velocity = memory, velocity
        self.passed = self.unproven = False
        self.mu, self.dimension = mu, dimension
        self.compliance = np.ones(len(mu)) if compliance is None else compliance
        self.tol = tol
        self.start = time.perf_counter() if start is None else start
        self.time_limit = time_limit
        self.history: list[tuple[int, float, float]] = []
        self.iterations = 0
        self.best = float("inf")
        self.best_r: FloatArray | None = None
        with np.errstate(over="ignore"):
            self.scale = size_of(q, floor)  # what the error divides by
        self.floor = floor

    @property
    def checks(self) -> bool:
        """Whether an error at or below `tol` counts only with the u that follows from r."""
        return self._velocity is not None

    def error(self, r: FloatArray, u: FloatArray) -> float:
        """The error, see `fcsim.problem.scaled_error`, at (r, u = W r + q)."""
        return relative(natural_map_residual(r, u, self.mu, self.dimension, self.compliance), self.scale)

    def record(self, r: FloatArray, u: FloatArray) -> float:
        """Compute the error, note it in the history under the current iteration and remember the iterate if it is the best so far."""
        error = self.error(r, u)
        if error <= self.tol and self._velocity is not None:
            error = self.error(r, self._velocity(r))
        self.history.append((self.iterations, time.perf_counter() - self.start, error))
        if error < self.best:
            self.best, self.best_r = error, r.copy()
        return error

    def inner(self, q: FloatArray, tol: float, floor: float = 0.0) -> Monitor:
        """A monitor for a problem of the same contacts on the way, with other velocities q (m,): the same error and clock, no memory."""
        return Monitor(
            *(q, self.mu, self.dimension, tol), compliance=self.compliance, floor=floor, time_limit=self.time_limit, start=self.start
        )

    def stopped(self, error: float, max_iterations: int) -> Status | None:
        """Why a method whose error is above `tol` has to stop: it is no number, or iterations or time are used up; None: it may go on."""
        if not math.isfinite(error):
            return Status.DIVERGED
        if self.iterations >= max_iterations:
            return Status.MAX_ITERATIONS
        return Status.TIME_LIMIT if self.out_of_time() else None

    def out_of_time(self) -> bool:
        """Whether the time limit has passed; of ranks that share their work by the clock of rank 0, or some would go on alone."""
        if self.time_limit == math.inf:
            return False
        return told("whether the time limit has passed", time.perf_counter() - self.start > self.time_limit)


@dataclass(frozen=True, eq=False)
class Iterate:
    """What a method's run function returns: the last iterate and why it stopped; message: what another program said about that, what
    the certificate of an INFEASIBLE problem says, or that what was asked for by name was not all that worked.
    """

    r: FloatArray
    status: Status
    message: str = ""
    certificate: Certificate | None = None

    __repr__ = brief


Run = Callable[..., Iterate]
"""run(problem, r, monitor, options): on a `LocalProblem`, with dimensions 5 and 6 on a `LocalRollingProblem`; options: the method's own
class."""


@dataclass(frozen=True)
class Method:
    """A published method: a run function and its options; a variant is another line of data.

    run(problem, r, monitor, options) -> Iterate works on the local form without equality constraints. A method that can work
    on the global form without reduction has `run_global` as well, one that can work on a mixed local form (V, R, s) without
    elimination has `run_mixed`; both are chosen by the option linear="kkt". One that can work on a problem whose q follows its solution
    (`fcsim.problem.Followed`) has `run_followed`. `limits` says on which problems the method is not meant to reach a small error; its
    status is honest there as everywhere. over_ranks: it asks no more of W than a `DistributedDelassus` has, or for `whole`;
    over_ranks_from: entries of W from which ranks have it together; over_ranks_elastic: only where
    every contact has a deformable body, so that W is not rank deficient for want of degrees of freedom.
    """

    run: Run
    options: Options
    family: str
    source: str
    siconos: str = ""
    dimensions: tuple[int, ...] = (2, 3)
    run_global: Run | None = None
    run_mixed: Run | None = None
    run_followed: Run | None = None
    limits: str = ""
    over_ranks: bool = False
    over_ranks_from: float = 3e5
    over_ranks_elastic: bool = False


@dataclass(frozen=True, eq=False)
class Result:
    """The answer of a solver.

    r (m,), u (m,), v (n,) or None for a problem in local form, multiplier l (p,) or None; error: the one that decided, `scaled_error` or
    `published_error` (see `fcsim.problem.scaled_error` and `error`), both with the caller's floor;
    seconds by phase ("reduction", "solve"; their sum is `time`); history rows (iteration, seconds, error); memory: what may serve the
    next, nearly equal problem, None where `solve` was given none; message: what a program that was called said where it failed, and
    where contacts that part outweigh the others in ||q||, so that the error says nothing of these (`fcsim.problem.judge.outweighed`);
    certificate: the proof where the status is INFEASIBLE.
    """

    r: FloatArray
    u: FloatArray
    v: FloatArray | None
    status: Status
    error: float
    scaled_error: float
    published_error: float
    iterations: int
    seconds: dict[str, float]
    history: list[tuple[int, float, float]]
    checks: Checks
    method: str
    multiplier: FloatArray | None = None
    message: str = ""
    memory: Memory | None = None
    certificate: Certificate | None = None

    __repr__ = brief

    @property
    def solved(self) -> bool:
        return self.status.solved

    @property
    def time(self) -> float:
        return sum(self.seconds.values())

    def derivative(
        self, problem: GlobalProblem | LocalProblem | Reduction, *, margin: float | None = None
    ) -> LocalDerivative | GlobalDerivative:
        """How this solution of `problem` changes with its data, by the implicit function theorem on the contacts' statuses.

        What comes back takes changes of the data `forward` (W, q, mu; of a global problem M, f, w, mu) and gradients of a scalar
        `backward`. margin: share of ||q|| up to which a part of a contact's scaled reaction or of its velocity counts as zero, default
        100 times the scaled error. InputError where this is no solution of the problem, contacts are on the border between two statuses
        (touching without a reaction, about to slide), or reactions are not unique.
        """
        return derivative(problem, self.r, margin)
