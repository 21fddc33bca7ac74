"""What limit analysis asks: rigid blocks, their contacts, loads that stay and loads that grow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.assembly.model import Model, build_model
from fcsim.brief import brief, shown
from fcsim.contact_detection import Contacts, Everything
from fcsim.contact_detection.contact_matrix import contact_matrix
from fcsim.errors import InputError
from fcsim.masonry.bodies import force_and_moment, rigid_blocks, supports, vector_of
from fcsim.masonry.problem import MasonryProblem, PointForce, expect_problem
from fcsim.witness import Witness, begin
from fcsim.witness.witness import ALLOW

_WIDEST = 0.25  # of the smallest block: a tolerance
_SMALLEST_LOAD = 1e-60
"""[N] Loads below it, and above its inverse, leave the range of floats in products."""


@dataclass(frozen=True, eq=False)
class LimitProblem:
    """Equilibrium of rigid blocks, H r + dead + lambda live = 0.

    H (n_free, m): rows of the free dofs `free`; dead, live (n_dofs,) [N, N m]: loads that stay, and that grow, at the multiplier 1;
    scale [N]: the largest of them
    """

    problem: MasonryProblem
    model: Model
    contacts: Contacts
    H: sp.csr_array
    free: IntArray
    dead: FloatArray
    live: FloatArray
    scale: float

    __repr__ = brief


def limit_problem(problem: MasonryProblem, *, tolerance: float | None = None) -> LimitProblem:
    """Return the limit problem of the blocks as they were given.

    tolerance [m]: blocks that are nearer are in contact; by default 1e-4 of the smallest block's extent. InputError names blocks that
    overlap, as the witness sees them.
    """
    expect_problem(problem, "limit analysis")
    if tolerance is not None and not (is_number(tolerance) and tolerance > 0):
        raise InputError(f"tolerance: expected a distance > 0 in m, got {shown(tolerance)}")
    if tolerance is not None and tolerance > (most := _WIDEST * problem.smallest):  # blocks would touch through others
        of = f"the smallest block's extent ({problem.smallest_block[0]!r})"
        raise InputError(f"tolerance: expected at most {most:.4g} m, a quarter of {of}, got {tolerance:g}")
    if problem.shaking:
        raise InputError(f"limit analysis of {problem.name!r}: expected ground at rest, got base_acceleration: see `fcsim shake`")
    bodies = rigid_blocks(problem)
    model = build_model(bodies, supports=supports(problem))
    try:
        begin(Witness(), model, np.zeros(model.n_dofs))
    except InputError as error:  # what Python's users may do about it is no option here
        raise InputError(f"masonry problem {problem.name!r}: {str(error).removesuffix(ALLOW)}") from None
    contacts = Everything(model, problem.friction, 1e-4 * problem.smallest if tolerance is None else tolerance)(model.reference)
    H = sp.csr_array(model.contact_matrix(contact_matrix(contacts, model.n_nodes), np.zeros(model.n_dofs)))[model.free_dofs]
    dead, live = (_loads(problem, model, scaled=scaled) for scaled in (False, True))
    scale = max(float(np.abs(dead).max()), float(np.abs(live).max()))
    if not scale > 0:
        raise InputError(f"limit analysis of {problem.name!r}: expected loads, got none")
    for loads in (dead, live):
        largest = float(np.abs(loads).max())
        if largest and not _SMALLEST_LOAD < largest < 1 / _SMALLEST_LOAD:
            raise InputError(f"limit analysis of {problem.name!r}: expected loads that can be added up, got some of {largest:.3g} N (N m)")
    return LimitProblem(problem, model, contacts, H, model.free_dofs, dead, live, scale)


def _loads(problem: MasonryProblem, model: Model, *, scaled: bool) -> FloatArray:
    """Forces and moments (n_dofs,) on the free bodies at the multiplier 1."""
    total = np.zeros(model.n_dofs)
    rows = model.rigid_part(total)
    mass = np.array([body.mass for body in model.rigid])
    rows[:, : model.dimension] = mass[:, None] * vector_of(problem, problem.acceleration(scaled=scaled))
    for load in problem.loads:
        if isinstance(load, PointForce) and load.scaled == scaled:
            number = problem.number[load.block]
            rows[number] += np.concatenate(force_and_moment(problem, load, model.rigid[number]))
    total[model.driven_dofs] = 0.0
    return total
