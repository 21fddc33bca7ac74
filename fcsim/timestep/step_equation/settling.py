"""Steps whose law depends on their end: solved again until the law finds what it took for that.

With z what an implicit law takes (say the strength of joints in the step) and F(z) what it finds in the answer, F(z) = z is sought by
z <- F(z) from the values at the beginning of the step, every third time by Anderson's mixing of the last values. That takes few rounds
where cracks grow steadily. Where no state is near, a crack that runs on, z <- F(z) runs with it to the next one, and mixing that would
go back to a state it runs away from is left out. What does not settle is no answer, and the step is cut. Each round is a friction
problem of its own, with the last one's W and reactions. Source of the alternation: P. P. Pratapa, P. Suryanarayana, J. E. Pask, J.
Comput. Phys. 306, 2016.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_law.law import Demand, Implicit, Variables
from fcsim.timestep.chain import Attempt
from fcsim.timestep.encounter import Encounter, Redetection
from fcsim.timestep.step_equation.equation import Answer, Equation, Past, StepSolver
from fcsim.timestep.step_equation.loops.mixing import Mixing
from fcsim.timestep.step_equation.loops.turning_links import turning_links
from fcsim.timestep.step_equation.newton import solve_nonlinear
from fcsim.timestep.step_equation.sequence import solve_equation

SETTLED = 1e-6
"""By so much F(z) and z may differ, relative to 1 + z."""

ROUNDS = 400

PERIOD, FARTHEST = 3, 30.0
"""Every so many rounds are mixed, others are plain; no farther beyond F(z) than so many times the last change."""


def solve_settled(
    equation: Equation, solver: StepSolver, past: Past, anew: Callable[[Equation], Redetection | None]
) -> tuple[Answer | None, Past]:
    """Return the answer with the law settled, None where there is none, and the past of the next step; as `solve_equation` and, for models
    with nonlinear bodies, `solve_nonlinear`, whose `anew` is given for an equation."""

    def solve(equation: Equation, past: Past) -> tuple[Answer | None, Past]:
        if not equation.model.nonlinear:
            return solve_equation(equation, solver, past)
        return solve_nonlinear(equation, solver, past, anew(equation))

    law = equation.scheme.law
    equation = turning_links(equation)
    answer, past = solve(equation, past)
    eased = None if answer is not None else equation.met.eased(law)
    if eased is not None:
        answer, past = solve(replace(equation, met=eased), past)
    if not isinstance(law, Implicit):
        return answer, past
    search = Search()
    while answer is not None:
        met, result = answer.met, answer.result
        demands = law.demands(met.meeting, met.outcome(result.u, result.r, answer.v)) if len(met.contacts) else {}
        trial = search.next_trial(met, demands)
        if trial is None:
            return answer, past
        if search.given_up:
            solver.attempts.append(
                Attempt("joints", "the strength before", "did not settle", search.change, search.rounds, equation.share, SETTLED)
            )
            return None, past
        past = past.of_the_same_step(met.contacts, met.contacts, result.r)
        same = not equation.model.nonlinear and met.moments is None
        summed = answer.reduction.local.W if same else None
        equation = replace(equation, met=met.tried(law, trial), summed=summed)
        answer, past = solve(equation, past)
    return None, past


class Search:
    """The state of the iteration: what has been tried."""

    def __init__(self) -> None:
        self._mixing = Mixing()
        self.rounds, self.change, self.given_up = 0, np.inf, False

    def next_trial(self, met: Encounter, demands: Mapping[str, Demand]) -> Variables | None:
        """What the law is to take next for the contacts met; None where it is settled."""
        if not demands:
            return None
        z, F, least, most = (np.concatenate([demand[i] for demand in demands.values()]) for i in range(4))
        scale = 1 + np.abs(z)
        self.change = float((np.abs(F - z) / scale).max())
        if self.change <= SETTLED:
            return None
        self.rounds += 1
        self._note(z, F)
        z = F if self.rounds % PERIOD else self._mixed(z, F, least, most, scale)
        self.given_up = self.rounds > ROUNDS
        parts = np.split(z, len(demands))
        return Variables(met.contacts.identity, dict(zip(demands, parts, strict=True)))

    def _note(self, z: FloatArray, F: FloatArray) -> None:
        if self._mixing.points and len(self._mixing.points[-1]) != len(z):
            self._mixing = Mixing()
        self._mixing = self._mixing.then(z, F)

    def _mixed(self, z: FloatArray, F: FloatArray, least: FloatArray, most: FloatArray, scale: FloatArray) -> FloatArray:
        """What mixing says; F where it would go back from z, to a state that z <- F(z) runs away from."""
        far = FARTHEST * self.change * scale
        mixed = np.clip(F + np.clip(self._mixing.next_point(scale) - F, -far, far), least, most)
        return mixed if ((mixed - z) / scale) @ ((F - z) / scale) > 0 else F
