"""Bodies that supports hold wholly and move alike: where they are to each other never changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcsim.arrays import IntArray
from fcsim.assembly.layout import BodyLayout
from fcsim.assembly.supports.held import HeldDofs
from fcsim.assembly.supports.support import DrivenRotation, Support

_Motion = tuple[str, object, object, object]


def moved_together(layout: BodyLayout, held: HeldDofs, supports: Sequence[Support | DrivenRotation]) -> IntArray:
    """Numbers (nb,), equal for bodies that are never moved to each other: held in all their degrees of freedom, and all at rest, or
    shifted by the same functions or numbers along the same directions. Any other body has a number of its own."""
    driven = np.bincount(np.searchsorted(layout.dof_offset, held.dofs, side="right") - 1, minlength=len(layout.bodies))
    alone, motions = driven < np.diff(layout.dof_offset), [set[_Motion]() for _ in layout.bodies]
    for support in supports:
        k = layout.body_number(support.body)
        if isinstance(support, DrivenRotation):
            alone[k] = True
        elif _moves(support):
            alone[k] |= not support.selection.whole or any(direction.startswith("r") for direction in support.directions)
            way = support.axes, _hashable(support.velocity), _hashable(support.displacement)
            motions[k] |= {(direction, *way) for direction in support.directions}
    numbers, seen = np.arange(len(layout.bodies)), dict[frozenset[_Motion], int]()
    for number in np.flatnonzero(~alone).tolist():
        numbers[number] = seen.setdefault(frozenset(motions[number]), number)
    return numbers


def _moves(support: Support) -> bool:
    return support.displacement is not None or callable(support.velocity) or support.velocity != 0


def _hashable(motion: object) -> object:
    """A function or number; of a user's object that compares by value and has no hash, which object it is."""
    try:
        hash(motion)
    except TypeError:
        return id(motion)
    return motion
