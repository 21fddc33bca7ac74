"""ROLLING-AUTO, what "auto" means with rolling friction: sweeps and proximal Newton side by side, by counted costs.

After a first sweep Newton's method goes on, and sweeps get a third of what it spends; where their rate promises the answer for
less than half of what was spent so far, they go on alone. A method that comes to its end, or lags tenfold behind, begins anew from
the best iterate; when neither gets on, the extragradient method has the last word. No clock decides: runs repeat bit by bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.linear.storage import REFERENCE, Work
from fcsim.problem.rolling import LocalRollingProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Status
from fcsim.solvers.proximal.options import PROXIMAL_NEWTON
from fcsim.solvers.rolling.newton import rolling_proximal_turns
from fcsim.solvers.rolling.projections import rolling_extragradient
from fcsim.solvers.rolling.sweeps import RollingSweepOptions, rolling_sweep_turns
from fcsim.solvers.turns import Turns
from fcsim.solvers.variational.projection import ProjectionOptions

LOCAL_SOLUTION = 1e-5
"""Seconds of a contact's own projections in a sweep, some fifty of them."""
SHARE = 3.0
"""What Newton's method may spend for each second of sweeps."""
WATCHED = 10
"""Sweeps from which a rate is taken."""
BEHIND = 10.0
"""How many times the best error that of a method is when it begins anew from there."""
TRIES, GAIN = 2, 0.5
"""Ends, one after the other, between which the best error did not fall by this factor, after which a method is left."""


@dataclass
class _Contender:
    """A method in the race: what makes it anew from r, its turns, the price of an iteration [s], its share, what it spent [s]."""

    begin: Callable[[FloatArray], Turns]
    turns: Turns
    price: float
    share: float
    spent: float = 0.0
    ends: int = 0
    began: float = float("inf")
    left: bool = False
    least: float = float("inf")
    errors: list[float] = field(default_factory=list)

    def again(self, r: FloatArray) -> None:
        self.turns, self.least, self.errors = self.begin(r), float("inf"), []

    def needs(self, tol: float) -> float:
        """What it still needs at the rate of its last iterations [s]."""
        if len(self.errors) <= WATCHED:
            return float("inf")
        before, now = self.errors[-1 - WATCHED], self.errors[-1]
        if not 0 < now < before:
            return float("inf")
        return self.price * WATCHED * float(np.log(now / tol) / np.log(before / now))


def rolling_automatic(problem: LocalRollingProblem, r: FloatArray, monitor: Monitor, options: Options) -> Iterate:
    """ROLLING-AUTO from r (m,)."""
    most = options.max_iterations
    sweeping, proximal = RollingSweepOptions(max_iterations=most), replace(PROXIMAL_NEWTON, max_iterations=most)

    def sweeps(r: FloatArray) -> Turns:
        return rolling_sweep_turns(problem, r, monitor, sweeping)

    def newton(r: FloatArray) -> Turns:
        return rolling_proximal_turns(problem, r, monitor, proximal)

    prices = _prices(problem)
    race = [_Contender(sweeps, sweeps(r), prices[0], 1.0), _Contender(newton, newton(r), prices[1], SHARE)]
    while running := [contender for contender in race if not contender.left]:
        all_spent = sum(contender.spent for contender in race)
        near = race[0] if not race[0].left and race[0].needs(monitor.tol) <= 0.5 * all_spent else None
        contender = near or min(running, key=lambda one: one.spent / one.share)
        if contender.spent == 0.0 and monitor.best_r is not None:
            contender.again(monitor.best_r)
        iterations, records = monitor.iterations, len(monitor.history)
        ended = _turn(contender)
        errors = [error for _, _, error in monitor.history[records:]]
        contender.errors += errors
        contender.least = min(contender.least, *errors, float("inf"))
        contender.spent += contender.price * max(monitor.iterations - iterations, 1)
        if ended is not None and (ended.status is Status.SOLVED or _final(ended.status, monitor, most)):
            return ended
        if ended is not None:
            contender.ends = 1 if monitor.best < GAIN * contender.began else contender.ends + 1
            contender.began = monitor.best
            contender.left = contender.ends >= TRIES or monitor.best_r is None  # without a number it has no other start
        if (ended is not None or contender.least > BEHIND * monitor.best) and monitor.best_r is not None and not contender.left:
            contender.again(monitor.best_r)
    start = r if monitor.best_r is None else monitor.best_r
    return rolling_extragradient(problem, start, monitor, ProjectionOptions(step_rule="Khobotov", max_iterations=most))


def _turn(contender: _Contender) -> Iterate | None:
    """One turn; what the method ended with, None where it goes on."""
    try:
        next(contender.turns)
    except StopIteration as stop:
        ended: Iterate = stop.value
        return ended
    return None


def _final(status: Status, monitor: Monitor, most: int) -> bool:
    """Whether iterations or time of all are used up."""
    return status is Status.TIME_LIMIT or (status is Status.MAX_ITERATIONS and monitor.iterations >= most)


def _prices(problem: LocalRollingProblem) -> tuple[float, float]:
    """Of a sweep and of an iteration of Newton's method [s]: products, elimination and small steps on the reference machine."""
    operator, m = problem.delassus, len(problem.q)
    product = Work(bytes=8.0 * operator.entries, steps=8)
    sweep = REFERENCE.seconds(product) + operator.nc * LOCAL_SOLUTION
    filled = Work(flops=2 / 3 * m**3, bytes=24.0 * m * m) if operator.elimination == "dense" else Work(bytes=94 * 8.0 * operator.entries)
    return sweep, REFERENCE.seconds(filled + product + Work(steps=40))
