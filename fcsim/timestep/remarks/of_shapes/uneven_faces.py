"""What is said of pairs with one contact for each piece of a facet of second order: no pressure on them is even."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fcsim.contact_detection.surfaces.parents import KINDS
from fcsim.contact_detection.surfaces.surface import SurfacePair

_UNEVEN = [KINDS.index(kind) for kind in ("line3", "quadrilateral9")]
"""A uniform pressure gives the nodes of these facets 1 : 4 : 1, forces at the centres of their linear pieces 1 : 2 : 1. Triangles' pieces
are one more than they have nodes without such forces, and give them."""


def uneven_faces(pairs: Sequence[SurfacePair], names: Sequence[str], deformable: int) -> Iterator[str]:
    """Say of the first pair of candidates "faces" that one side of it has such facets, beside a slave that is `deformable`: as the first
    bodies by number, whose names these are."""
    for number, pair in enumerate(pairs):
        if pair.candidates != "faces" or not (pair.slave.bodies < deformable).any():
            continue
        if not any(side.parents is not None and np.isin(side.parents.kind, _UNEVEN).any() for side in (pair.slave, pair.master)):
            continue
        called = repr(pair.name) if pair.name else str(number + 1)
        one, other = (names[int(surface.bodies[0])] for surface in (pair.slave, pair.master))
        yield (
            f'pair {called} (slave {one!r}, master {other!r}): the centres that candidates "faces" have on cells of second order bear no '
            "even pressure, also where meshes match: what is near them moves too far or too little. What helps: candidates "
            '"gauss" on meshes that match and are of one order, or "mortar"'
        )
        return
