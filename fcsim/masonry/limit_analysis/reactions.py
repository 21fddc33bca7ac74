"""How far equilibrium leaves the supports' forces undetermined: the least and the largest that admissible contact forces give them.

A hyperstatic structure of dry blocks has many states of equilibrium; the thrust of an arch lies between a least and a largest one, which
its supports choose when they give way or press in (J. Heyman, "The stone skeleton", Int. J. Solids Struct. 2, 1966). Each bound is a
program like that of the collapse load: the support's own equation joins those of the free blocks, its force as what is made largest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, is_number
from fcsim.brief import brief, shown
from fcsim.contact_detection.contact_matrix import contact_matrix
from fcsim.errors import InputError
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem
from fcsim.masonry.limit_analysis.programs import Program

_UNBOUNDED = 1e4
"""Times all loads: forces that can be larger than this can be as large as one likes, by wedging."""
_EXACT = 15  # digits: a bound is one number, which no rounds enlarge
_STANDS = 1 - 1e-6  # of the loads


@dataclass(frozen=True, eq=False)
class SupportForces:
    """The force (d,) [N] by which a support holds the structure, along the axes of the problem: least and largest by component;
    -inf, inf where blocks can be wedged as hard as one likes."""

    name: str
    least: FloatArray
    largest: FloatArray

    __repr__ = brief


def support_forces(problem: LimitProblem, multiplier: float = 0.0) -> tuple[SupportForces, ...]:
    """Return what each support that is touched may bear under the loads that stay and `multiplier` times those that grow.

    Components are bounded one by one: their extremes need not come together. InputError where no admissible forces bear the loads.
    """
    if not is_number(multiplier):
        raise InputError(f"multiplier: expected a finite number, got {shown(multiplier)}")
    load = problem.dead + multiplier * problem.live
    found = Program(problem, np.zeros_like(load), load).solve(at_most=1.0)
    if found is None or found.multiplier < _STANDS:
        raise InputError(
            f"{problem.problem.name!r}: expected a structure that bears its loads at the multiplier {multiplier:g}, got one that falls"
        )
    model, d = problem.model, problem.model.dimension
    numbers = [k for k, block in enumerate(problem.problem.blocks) if block.support and (problem.contacts.bodies == k).any()]
    forces = float(np.abs(model.rigid_part(load)[:, :d]).sum())
    H = sp.csr_array(model.contact_matrix(contact_matrix(problem.contacts, model.n_nodes), np.zeros(model.n_dofs)))
    return tuple(_of_support(problem, H, load, number, _UNBOUNDED * forces) for number in numbers)


def _of_support(problem: LimitProblem, H: sp.csr_array, load: FloatArray, number: int, most: float) -> SupportForces:
    """The bounds of one support's force: H (n_dofs, m) with the rows of held dofs, load (n_dofs,) [N, N m], most [N]."""
    model, d = problem.model, problem.model.dimension
    bounds = np.empty((2, d))
    number_of = np.arange(model.n_dofs)
    for axis in range(d):
        dof = int(model.rigid_part(number_of)[number, axis])
        free = np.union1d(problem.free, [dof])
        along = np.zeros(model.n_dofs)
        along[dof] = 1.0
        program = Program(replace(problem, H=H[free], free=free, live=along), load, along, _EXACT)
        for row, sign in enumerate((-1.0, 1.0)):
            answer = program.solve(at_least=-most, at_most=most, sign=sign)
            value = np.nan if answer is None else answer.multiplier
            bounds[row, axis] = sign * np.inf if abs(value) > 0.99 * most else value
    return SupportForces(problem.problem.blocks[number].name, bounds[0], bounds[1])
