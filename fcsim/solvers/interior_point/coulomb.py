"""IPM-COULOMB: a primal-dual interior point on Coulomb's law itself, with Nesterov-Todd scaling and Mehrotra's predictor and corrector.

The law is complementarity x o y = 0 over half-lines and cones (`pairs`), x linear in r; the velocities u in y are independent of r until
u = W r + q holds, so that a start need not be feasible. In scaled changes V dx, V^-1 dy with V x = V^-1 y = p an iteration solves

    p o (V dx + V^-1 dy) = sigma tau w - p o p - V dx' o V^-1 dy',      u + du = W (r + dr) + q - sigma (u - W r - q),

dx', dy' those of the predictor (sigma = 0), tau the mean of x . y, w the weight of each pair; eliminating y leaves (A W + B) dr. The
problem is not monotone, unlike the convex programs of IPM in which ||u_T|| is held: the central path tau -> 0 may turn back, where steps
to the boundary shrink to nothing. Then another path is followed, of other weights and from nearer to the best iterate.

A contact that grazes, or is about to slide, is known to the root of tau only, and the distance of a sliding one to its cone is round-off at
errors of about 1e-9. Where a path has come to an error of at most POLISHED, a few iterations of proximal Newton from there give the last
digits; a start that is as good already, as another method's iterate, is not what they begin from.

Sources: Chen, Ly, Wojtan, "Primal-dual non-smooth friction for rigid body animation", SIGGRAPH 2024; Howell et al., "Dojo",
arXiv:2203.00806, 2022; Mehrotra, SIAM J. Optim. 2, 1992; Nesterov, Todd, SIAM J. Optim. 8, 1998. The weights, the further paths and the
polish are our own.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import LocalProblem
from fcsim.problem.cone import de_saxce, project_cone
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.interior_point import _step_kernels as kernels
from fcsim.solvers.interior_point.pairs import ContactPairs
from fcsim.solvers.interior_point.systems import InteriorSystem
from fcsim.solvers.proximal.options import PROXIMAL_NEWTON
from fcsim.solvers.proximal.steps import proximal_turns
from fcsim.solvers.turns import Turns, to_the_end

LONGEST = 0.99
"""Share of the way to the boundary that a step takes at most; it is the predictor's own share where that lies above the option's."""
SHORT, JAMMED = 0.05, 3
"""A step is short below this length; a path ends after so many short ones in a row."""
LEAST = 1e-6
"""The least sigma."""
NEARER = 0.3
"""Factor of the velocity to which the next path's start is moved inside."""
WEIGHTS = ((1.0, 0.0), (1.0, -1.0), (0.0, 0.0), (1.0, 1.0), (0.0, -1.0), (0.0, 1.0))
"""Exponents (a, b) of paths one after the other: tau of a contact is in proportion to compliance^-a, that of its cone to mu^b beside."""
POLISHED, ALPHA = 1e-4, 0.1
"""Error up to which a path's end is polished, and the first regularisation over the error's root."""

PathTurns = Generator[None, None, Status | None]
"""Yields between two iterations; returns why all ends, None where only this path does."""


@dataclass(frozen=True, kw_only=True)
class InteriorPointOptions(Options):
    """max_iterations counts factorisations, those of the polish too.

    fraction   least share of the way to the boundary that a step may take
    paths      central paths that are followed, one after the other, before giving up
    weights    of these, as in `WEIGHTS`, again from the first where there are more paths
    velocity   [||q|| / sqrt(nc)] to which the first start is moved inside, each further one to `NEARER` of the one before: from an iterate
               of error e that others have come to about 10 sqrt(e); a larger one forgets it, from a smaller one steps jam
    polish     iterations of proximal Newton at the end of a path, 0: none
    """

    fraction: float = 0.9
    paths: int = 6
    weights: tuple[tuple[float, float], ...] = WEIGHTS
    velocity: float = 1.0
    polish: int = 30

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.fraction <= LONGEST:
            raise InputError(f"option fraction: expected a number in (0, {LONGEST}], got {self.fraction}")
        self.integers_from(paths=1, polish=0)
        self.numbers_above(velocity=0)
        if not np.isfinite(self.velocity):
            raise InputError(f"option velocity: expected a finite number, got {self.velocity}")
        if not self.weights or not all(_is_pair(pair) for pair in self.weights):
            raise InputError(f"option weights: expected pairs of finite numbers, one at least, got {self.weights!r}")


def _is_pair(pair: object) -> bool:
    """Whether it is two finite numbers."""
    numbers = isinstance(pair, tuple | list) and len(pair) == 2 and all(isinstance(number, int | float) for number in pair)
    return numbers and bool(np.all(np.isfinite(pair)))  # type: ignore[call-overload]


def interior_point(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: InteriorPointOptions) -> Iterate:
    """The primal-dual interior point from r (m,), which is moved inside its cones."""
    return to_the_end(interior_point_turns(problem, r, monitor, options))


def interior_point_turns(
    problem: LocalProblem, r: FloatArray, monitor: Monitor, options: InteriorPointOptions, told: Callable[[float], None] | None = None
) -> Turns:
    """The same by turns of one iteration each, and one of none before each path but the first; told: is told tau after each iteration
    along a path, infinity before a path."""
    error = monitor.record(r, problem.delassus.affine(r, problem.q))
    if error <= monitor.tol:
        return Iterate(r, Status.SOLVED)
    method = _InteriorPoint(problem, monitor, options, told or (lambda tau: None))
    begun, size, weights = monitor.iterations, options.velocity * monitor.scale / np.sqrt(problem.nc), options.weights
    for number in range(options.paths):
        method.told(np.inf)
        if number:
            yield
        best = r if not number or monitor.best_r is None else monitor.best_r
        status = yield from method.follow(best, NEARER**number * size, *weights[number % len(weights)])
        if status is None and options.polish and method.least <= POLISHED:
            status = yield from method.polish()
        if status is not None:
            return Iterate(r if monitor.best_r is None else monitor.best_r, status)
    status = Status.SINGULAR if monitor.iterations == begun else Status.STAGNATED
    return Iterate(r if monitor.best_r is None else monitor.best_r, status)


class _InteriorPoint:
    """The paths of one problem; their points are r (nc, d), and flat x and y on both sides of the pairs."""

    def __init__(self, problem: LocalProblem, monitor: Monitor, options: InteriorPointOptions, told: Callable[[float], None]) -> None:
        self._problem, self._monitor, self._options, self.told = problem, monitor, options, told
        self._operator, self._shape = problem.delassus, (problem.nc, problem.dimension)
        self._compliance = problem.delassus.compliance
        self.pairs = ContactPairs(problem.mu, problem.dimension)
        self._system = InteriorSystem(problem.delassus)
        self.least, self._nearest = np.inf, np.empty(0)

    def follow(self, r: FloatArray, size: float, by_compliance: float, by_friction: float) -> PathTurns:
        """Follow a central path from near r (m,), from tau = size^2 [velocity] over the compliance; None where it ends unsolved. What it
        came to is its least error, `least`."""
        self.least = np.inf
        c, monitor = self._compliance, self._monitor
        mean = float(np.exp(np.log(c).mean()))
        tau = (mean / c) ** by_compliance / mean
        rough = np.where(self._problem.mu > 0, self._problem.mu, 1.0) ** by_friction
        centre = self.pairs.weights(tau, tau * rough)
        x, y = self.pairs.centred(r.reshape(self._shape), self._velocity(r), size**2 * tau, c)
        R, short, products, total = self.pairs.contact_reaction(x), 0, float(x @ y), float(centre.sum())
        while short < JAMMED:
            if (stopped := monitor.stopped(monitor.best, self._options.max_iterations)) is not None:
                return stopped
            try:
                with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # a path's last iterations may meet infinity
                    point = self._step(R, x, y, products / total, centre)
            except (SingularMatrix, FloatingPointError):
                return None
            if not (point.length > 0 and point.inside and np.isfinite(point.products)):
                return None  # as far as floating point goes
            R, x, y, products = point.r, point.x, point.y, point.products
            self.told(products / total)
            monitor.iterations += 1
            answer = self._answer(R, y)
            error = monitor.record(answer, self._velocity(answer).ravel())
            if error <= monitor.tol:
                return Status.SOLVED
            if error < self.least:
                self.least, self._nearest = error, answer
            short = short + 1 if point.length < SHORT else 0
            yield
        return None

    def _velocity(self, r: FloatArray) -> FloatArray:
        """W r + q (nc, d) of r (m,) or (nc, d)."""
        return self._operator.affine(r.ravel(), self._problem.q).reshape(self._shape)

    def _answer(self, R: FloatArray, y: FloatArray) -> FloatArray:
        """r (m,) in the cones, by the natural map of the point: open contacts have none, and sliding ones are at the cone's surface."""
        u, mu = self.pairs.contact_velocity(y), self._problem.mu
        return project_cone(R - (u + de_saxce(u, mu)) / self._compliance[:, None], mu).ravel()

    def _step(self, R: FloatArray, x: FloatArray, y: FloatArray, tau: float, centre: FloatArray) -> _Point:
        """Predictor and corrector from a point, tau the mean of x . y, to the next one. Raises SingularMatrix."""
        step = Linearised(self.pairs, self._system, x, y, self._velocity(R))
        _, dx, dy, t = step.direction(-step.squared, 1.0)
        sigma, fraction = max((1 - t) ** 3, LEAST), max(self._options.fraction, LONGEST * t)
        # t^2: of the predictor's second-order term, what a predictor of that length leaves
        target = kernels.corrected(step.squared, dx, dy, centre, sigma * tau, t**2, *self._shape)
        dr, _, dy, t = step.direction(target, 1 - sigma)
        t *= fraction
        return _Point(t, *step.moved(R, dr, y, dy, t))

    def polish(self) -> PathTurns:
        """Proximal Newton from the path's best iterate; None where it does not arrive within its iterations."""
        monitor, most = self._monitor, self._options.max_iterations
        options = replace(
            PROXIMAL_NEWTON,
            alpha=min(PROXIMAL_NEWTON.alpha, ALPHA * float(np.sqrt(self.least))),
            max_iterations=min(monitor.iterations + self._options.polish, most),
        )
        status = (yield from proximal_turns(self._problem, self._nearest, monitor, options)).status
        return status if status in (Status.SOLVED, Status.TIME_LIMIT) or monitor.iterations >= most else None


@dataclass(frozen=True)
class _Point:
    """Where a step of that length ends: r (nc, d), both sides, whether they are inside, and x . y."""

    length: float
    r: FloatArray
    x: FloatArray
    y: FloatArray
    inside: bool
    products: float


class Linearised:
    """The law and u = W r + q about a point x, y inside, of r (nc, d) with velocity = W r + q (nc, d); raises SingularMatrix.

    scaling: V with V x = V^-1 y = point, see `_step_kernels`; squared = point o point.
    """

    def __init__(self, pairs: ContactPairs, system: InteriorSystem, x: FloatArray, y: FloatArray, velocity: FloatArray) -> None:
        self._contacts = pairs.mu, pairs.rough
        *scaling, self.point, self.squared = kernels.scaling(x, y, len(velocity), pairs.cones, pairs.cone_size)
        self.scaling = tuple(scaling)
        A, B, self._apart = kernels.equations(*self.scaling, y, velocity, *self._contacts)
        self._solve = system.factored(A, B)

    def direction(self, target: FloatArray, share: float) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """dr (nc, d), V dx, V^-1 dy with point o (V dx + V^-1 dy) = target, which take that share off the infeasibility W r + q - u; and
        how far a step may go along these until either side is at the boundary, at most 1."""
        b, right = kernels.right_side(*self.scaling, self.point, target, share, self._apart, self._contacts[1])
        dr = self._solve(right)
        return dr, *kernels.changes(*self.scaling, self.point, b, dr, *self._contacts)

    def moved(
        self, R: FloatArray, dr: FloatArray, y: FloatArray, dy: FloatArray, t: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, bool, float]:
        """R + t dr (nc, d), its x, y + t V dy, whether these are inside, and x . y."""
        result: tuple[FloatArray, FloatArray, FloatArray, bool, float] = kernels.moved(R, dr, y, dy, t, *self.scaling, *self._contacts)
        return result
