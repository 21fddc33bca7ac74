"""Blocks that friction holds by wedging alone: limit analysis finds forces that bear them, motion from rest does not.

Coulomb's law has two answers there, r = 0 and a free fall along the joints (u_N = 0), and forces as large as one likes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import BoolArray
from fcsim.masonry.bodies import vector_of
from fcsim.masonry.limit_analysis.limit_problem import LimitProblem
from fcsim.masonry.limit_analysis.programs import Program
from fcsim.masonry.problem import PointForce

_UPRIGHT = 1e-6  # sine of the angle that joints may lean and count as upright
_STANDS = 1 - 1e-6  # of the loads


def only_wedged(limit: LimitProblem) -> BoolArray:
    """Which free blocks (n,) fall freely while the others stand without them, no joint closing and none bearing: those to which no chain
    of joints leads from a support that lean so as to bear weight. None where forces that stay act on them, or the others lean on them."""
    problem, contacts = limit.problem, limit.contacts
    weight = problem.acceleration(scaled=False)
    held = np.array([block.support for block in problem.blocks])
    if not (np.any(weight) and held.any() and len(contacts)):
        return np.zeros_like(held)
    lean = contacts.frame[:, 0] @ -np.array(vector_of(problem, weight / np.linalg.norm(weight)))  # normals point to the slave
    upper, lower = np.where(lean[:, None] > 0, contacts.bodies, contacts.bodies[:, ::-1])[np.abs(lean) > _UPRIGHT].T
    borne, count = held.copy(), -1
    while count != (count := int(borne.sum())):
        borne[upper[borne[lower]]] = True
    forced = [problem.number[f.block] for f in problem.loads if isinstance(f, PointForce) and not f.scaled and any((*f.value, *f.moment))]
    falling = ~borne
    if not falling.any() or falling[forced].any() or not _stands_without(limit, falling):
        return np.zeros_like(held)
    return falling


def _stands_without(limit: LimitProblem, falling: BoolArray) -> bool:
    """Whether the other blocks bear their loads without a force from those that fall."""
    apart = ~falling[limit.contacts.bodies].any(axis=1)
    dead = limit.dead.copy()
    limit.model.rigid_part(dead)[falling] = 0.0
    if not dead.any():
        return True
    H = limit.H[:, np.repeat(apart, limit.contacts.dimension)]
    found = Program(replace(limit, contacts=limit.contacts.take(apart), H=H), np.zeros_like(dead), dead).solve(at_most=1.0)
    return found is not None and found.multiplier >= _STANDS
