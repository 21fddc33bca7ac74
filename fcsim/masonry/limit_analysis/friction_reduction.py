"""The factor of safety by reduction of friction: how much less of it a structure could do with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem
from fcsim.masonry.limit_analysis.programs import Program

_LARGEST = 1e3  # factors beyond it are called none
_STANDS = 1 - 1e-6  # of the loads


def friction_factor(problem: LimitProblem, multiplier: float = 0.0, *, resolution: float = 1e-5) -> float:
    """Return F: with mu / F at every joint contact forces bear the loads just still, those that grow at `multiplier`.

    Below 1 the structure falls with the friction that it has. inf: a thousandth of it would do (what is wedged needs some, however little);
    0: no friction holds it. By bisection to `resolution` of F; what bears the loads is found by the static theorem, so that for Coulomb's
    slip F is an upper bound, as limit loads are.
    """
    if not (is_number(multiplier) and multiplier >= 0):
        raise InputError(f"multiplier: expected a number >= 0, got {shown(multiplier)}")
    if not (is_number(resolution) and 0 < resolution < 1):
        raise InputError(f"resolution: expected a share between 0 and 1, got {shown(resolution)}")
    if _stands(problem, multiplier, 1 / _LARGEST):
        return np.inf
    if not _stands(problem, multiplier, _LARGEST):
        return 0.0
    low, high = 1 / _LARGEST, _LARGEST  # of mu: falls, stands
    while high > (1 + resolution) * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if _stands(problem, multiplier, middle) else (middle, high)
    return 1 / high


def _stands(problem: LimitProblem, multiplier: float, share: float) -> bool:
    """Whether forces in cones of `share` times the friction bear the loads."""
    contacts = problem.contacts
    weaker = replace(problem, contacts=replace(contacts, mu=share * contacts.mu))
    found = Program(weaker, np.zeros_like(problem.dead), problem.dead + multiplier * problem.live).solve(at_most=1.0)
    return found is not None and found.multiplier >= _STANDS
