"""The solver of a step, what follows when it does not converge, and what was tried."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple, Self

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.brief import shown
from fcsim.contact_law.law import Timing
from fcsim.errors import InputError, NotConverged
from fcsim.problem.reduction import Reduction
from fcsim.problem.rolling import RollingReduction
from fcsim.solvers import SOLVERS, Memory, Result, Status, method, solve
from fcsim.solvers.base import choice, override
from fcsim.solvers.small.door import CONTACTS
from fcsim.solvers.solve_rolling import solve_rolling

OF_NEWTON = 1e-9
"""The tolerance of problems within Newton's method on nonlinear bodies, where the settings' is larger."""

ONE_LOOP = "one loop"
"""Where an attempt started, see `Attempt`."""

LEARNED, LEADS = 3, 25
"""After so many solves in a row that the same later link had to answer, it begins the chain, for so many solves."""


@dataclass(frozen=True)
class Attempt:
    """One link of the fallback chain: the solver, where it started ("previous steps" or "zero") and how it ended. `ONE_LOOP`: turning
    bodies and contacts in one loop from the previous steps, which the chain follows where that does not arrive.

    share: the part of the step that was attempted, 1 or, where the step was cut, 1/2, 1/4, ...; tol: the error asked for; leads: it began
    the chain because the steps before needed it, see `Lead`; why: of the last one of a chain, why there is no answer, where that is known
    """

    solver: str
    start: str
    status: str
    error: float
    iterations: int
    share: float
    tol: float
    leads: bool = False
    why: str = ""

    def __str__(self) -> str:
        return f"{self.way}: {self.status}, error {self.error:.2e}"

    @property
    def way(self) -> str:
        """Solver and start in words."""
        return f"{self.solver} {'in' if self.start == ONE_LOOP else 'from'} {self.start}"


@dataclass(frozen=True)
class Lead:
    """Which solver begins the chain instead of the settings' own, learned from the steps before.

    solver  the link that has worked where the first one did not, `streak` times in a row; it leads for `steps` more steps
    """

    solver: str = ""
    streak: int = 0
    steps: int = 0

    def after(self, first: str, worked: str) -> Lead:
        """The lead after a solve in which `first` began and `worked` had the answer."""
        if self.steps > 1:
            return Lead(self.solver, self.streak, self.steps - 1) if worked == self.solver else Lead()
        if self.steps or worked == first:
            return Lead()
        streak = self.streak + 1 if worked == self.solver else 1
        return Lead(worked, streak, LEADS if streak == LEARNED else 0)


NOBODY = Lead()


@dataclass(frozen=True, kw_only=True)
class SolverSettings:
    """Which solver a step uses, and what follows when it does not converge.

    The chain of a step: `name` from the previous steps' reactions (see `warm_start`), `name` from zero, then each of `fallback` from
    zero. The first answer below `tol` is taken; if none is, the step raises NotConverged. No link follows one that has spent all the
    effort that such a problem is worth (`Status.EXHAUSTED`), and a step of two of these is cut no further. A link that had to answer three
    times in a row begins the next 25 chains, see `Lead`; `Step.attempts` says what was tried.

    name       of the table of solvers, `fcsim.SOLVERS`; options: those of the method, by name
    tol        on the scaled error of each step's problem
    floor      [m/s; quasi-statics: m] what counts as motion at least, see `fcsim.problem.error`; None: by the model, its gravity and
               the step, see `settings_of_model`
    fallback   names that follow, see above; (): none
    loop       how a step with turning or nonlinear bodies goes to its answer: "sequence", friction problems that are solved one after the
               other; "one", one linearisation of the bodies an iteration of the contacts, with the nonsmooth Newton methods (see
               `one_loop`, `newton_loop`), and with `auto` where it begins with one; "auto": turning bodies in one loop, nonlinear
               ones by the sequence

    InputError: an unknown solver, option or loop.
    """

    name: str = "auto"
    tol: float = 1e-8
    floor: float | None = None
    options: Mapping[str, object] = field(default_factory=dict)
    fallback: tuple[str, ...] = ("NSN-AC", "NSN-NM", "NSN-AC-HYBRID", "auto")
    loop: str = "auto"

    def __new__(cls, *values: object, **_: object) -> Self:
        """InputError for values without their names, which would be a matter of the fields' order."""
        if values:
            named = ", ".join(f"{each.name}={shown(value)}" for each, value in zip(fields(cls), values, strict=False))
            raise InputError(f"SolverSettings: expected every value by its name, as SolverSettings({named}), got {len(values)} without")
        return super().__new__(cls)

    def __post_init__(self) -> None:
        if not isinstance(self.options, Mapping) or isinstance(self.fallback, str) or not isinstance(self.fallback, Sequence):
            raise InputError(
                "SolverSettings: expected options by name and fallback as names of solvers, (): none, got "
                f"{shown(self.options)} and {shown(self.fallback)}"
            )
        override(method(self.name).options, dict(self.options))
        for name in self.fallback:
            method(name)
        if not (is_number(self.tol) and 0 < self.tol < 1):  # from 1 on r = 0 would do
            raise InputError(f"tol: expected a number > 0 and < 1, got {shown(self.tol)}")
        choice("loop", self.loop, ("auto", "one", "sequence"))
        if self.floor is not None and not (is_number(self.floor) and self.floor >= 0):
            raise InputError(f"floor: expected a number >= 0 or None (of the model's size), got {shown(self.floor)}")

    @property
    def least_motion(self) -> float:
        """The floor as a number [unit of q]: 0 where none is set, neither here nor by `settings_of_model`."""
        return self.floor or 0.0


DIGITS = 4 * float(np.finfo(np.float64).eps)
"""Of the largest coordinate: what gaps, differences of coordinates, are known to."""

MOST_MOTION, OF_A_FALL = 1e-6, 0.1
"""The floor of dynamics: at most so much of the model's size in a step, and so much of the speed that gravity gives a body in a step."""


def settings_of_model(
    settings: SolverSettings, lengths: tuple[float, float], timing: Timing, gravity: FloatArray, nc: int
) -> SolverSettings:
    """The settings with a floor for a step with nc contacts, where they have none.

    lengths [m]: the model's size L and the largest of that and its coordinates, X; gravity (d,) [m/s^2]: g. The floor of statics is
    4 eps X sqrt(nc) / tol: errors of `tol` of it are round-off of gaps. That of dynamics is this by h, or g h / 10 where that is more,
    which keeps forces of bodies at rest to a tenth of `tol`, at most 1e-6 L / h. So a model in other units has the same answers.
    """
    if settings.floor is not None:
        return settings
    known = DIGITS * lengths[1] * max(nc, 1) ** 0.5 / settings.tol
    if not timing.moving:
        return replace(settings, floor=known)
    fall = OF_A_FALL * float(np.linalg.norm(gravity)) * timing.h
    return replace(settings, floor=max(known / timing.h, min(MOST_MOTION * lengths[0] / timing.h, fall)))


ROLLING: tuple[tuple[str, Mapping[str, object]], ...] = (
    ("ROLLING-AUTO", {"max_iterations": 3000}),
    ("ROLLING-EG", {"max_iterations": 3000}),
    ("ROLLING-NSGS", {}),
    ("ROLLING-EG", {}),
    ("ROLLING-FP", {}),
)
"""The methods for steps with rolling resistance, the slower ones in case that the first does not arrive."""


@dataclass(frozen=True, eq=False)
class Chain:
    """The solvers that try a problem one after the other, and where it is noted what they made of it.

    settings: the solvers; share: of the step that the problem is of; attempts: what is tried is added to them
    serves: whether what `auto` leaves of up to 128 contacts serves the next problems, not so where all bodies are rigid
    """

    settings: SolverSettings
    share: float
    attempts: list[Attempt]
    serves: bool = True

    def solve(
        self, reduction: Reduction, warm: FloatArray, tol: float, kept: Memory | None, lead: Lead
    ) -> tuple[Result | None, Memory | None]:
        """Return the first answer below `tol`, None where no link reaches it, and what the chain leaves for the next problem.

        warm (m,): where the first link begins; kept: what the problem before left; lead: who begins.
        """
        settings = self.settings
        links: list[tuple[str, str, Mapping[str, object]]] = [(settings.name, "previous steps", settings.options)]
        if lead.steps:
            links.insert(0, (lead.solver, "previous steps", {}))
        if np.any(warm):
            links.append((settings.name, "zero", settings.options))
        links += [(name, "zero", {}) for name in settings.fallback if name != settings.name]
        solved: Callable[..., Result] = solve  # which checks the options
        few = not self.serves and reduction.problem.nc <= CONTACTS
        for k, (name, start, options) in enumerate(links):
            r = warm if start == "previous steps" else None
            serving = None if few and name == "auto" else kept  # without a memory it passes its compiled front door
            result = solved(reduction, name, r, tol=tol, floor=settings.least_motion, memory=serving, **options)
            kept = kept if serving is None else result.memory
            self.note(name, start, result, tol, leads=k == 0 and lead.steps > 0)
            if result.solved:
                return replace(result, memory=None), kept
            if result.status is Status.EXHAUSTED:
                break
        return None, kept

    def solve_rolling(self, reduction: RollingReduction, warm: FloatArray, tol: float) -> Result | None:
        """As `solve` on the cone of rolling friction: the settings' solver where it has this cone, then `ROLLING`, the short ones from
        where the one before ended, the long ones from zero."""
        settings = self.settings
        own = [(settings.name, dict(settings.options))] if 5 in method(settings.name).dimensions else []
        r, start = warm, "previous steps" if np.any(warm) else "zero"
        solved: Callable[..., Result] = solve_rolling  # which checks the options
        for name, options in (*own, *ROLLING):
            if not options and name != settings.name:
                r, start = np.zeros_like(warm), "zero"
            result = solved(reduction, name, r, tol=tol, floor=settings.least_motion, **options)
            self.note(name, start, result, tol)
            if result.solved:
                return result
            if np.all(np.isfinite(result.r)):
                r, start = result.r, "the last answer"
        return None

    def note(self, name: str, start: str, result: Result, tol: float, *, leads: bool = False, status: str | None = None) -> None:
        """Add an attempt by the solver `name`; status: where it is not the result's."""
        status = result.status.value if status is None else status
        self.attempts.append(Attempt(name, start, status, result.error, result.iterations, self.share, tol, leads))


def given_up(attempts: Sequence[Attempt]) -> bool:
    """Whether a step is not to be cut any further: twice all the effort was spent that such a problem is worth, on the step and on its
    first part, so that the end comes after a time that is bounded."""
    return sum(attempt.status == Status.EXHAUSTED.value for attempt in attempts) > 1


MET = 1e-12  # tolerance that solvers meet in double precision, see `longest_flight`


class StepTimes(NamedTuple):
    """[s] The beginning and the end of a step, and the beginning of the last part that was tried of it."""

    begin: float
    end: float
    part: float


def not_converged(
    settings: SolverSettings,
    number: int,
    times: StepTimes,
    cuttings: int,
    attempts: Sequence[Attempt],
    why: Sequence[str] = (),
) -> NotConverged:
    """The error of step `number` that says what was tried on the last part, and how short that is; why: what else is said of the run."""
    begin, end, part = times
    last = attempts[-1]
    tried = "; ".join(map(str, (a for a in attempts[_last_solved(attempts) + 1 :] if a.share == last.share)))
    text = f"step {number} did not converge to {last.tol:.3g} ({tried})"
    if cuttings:
        text += (
            f", from t = {begin:.6g} to {end:.6g} s: cut into parts of h/2 to h/{2**cuttings} = {last.share * (end - begin):.3g} s, "
            f"the last from t = {part:.6g} s"
        )
    if last.why:
        text += f"; {last.why}"
    elif last.status == Status.EXHAUSTED.value:
        text += (
            "; what rigid bodies that meet in faces do is not determined by Coulomb's law alone, and the solvers creep: give the joints "
            "stiffness, Compliant(Springs(..., each=True)), or ask for less, tol=1e-6"
        )
    elif last.solver == "links":
        text += (
            "; links whose forces turn with what they hold: choose a smaller h, or in statics, where links leave bodies a motion that eta "
            "alone holds (a chain), a larger eta"
        )
    elif last.solver in SOLVERS and last.tol < 0.5 * min(settings.tol, OF_NEWTON):  # asked for by `longest_flight`
        by = f" (about {MET / last.tol:.0e} times)" if last.tol < MET else ""
        text += f"; bodies fly farther than the model is large in one step: choose a smaller h, in statics a larger eta{by}"
    return NotConverged("; ".join((text, *why)))


def _last_solved(attempts: Sequence[Attempt]) -> int:
    return max((k for k, attempt in enumerate(attempts) if attempt.status == Status.SOLVED.value), default=-1)


class Clock:
    """Seconds by phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._last
        self._last = now
