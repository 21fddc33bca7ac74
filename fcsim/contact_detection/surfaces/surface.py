"""What may touch what: contact surfaces and the rules between two of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import BoolArray, FloatArray, IntArray, is_number
from fcsim.brief import brief, shown
from fcsim.contact_detection.surfaces.parents import Parents
from fcsim.errors import InputError, expect

CandidateRule = Literal["nodes", "faces", "gauss", "mortar", "mortar-faces", "segments"]
NormalRule = Literal["facet", "smooth"]
OPPOSING = -0.1  # a candidate's outward direction n and the master's normal N face each other while n . N < OPPOSING


def _integers(values: ArrayLike, what: str, ndim: int) -> IntArray:
    array = np.asarray(values)
    if array.ndim != ndim or not (np.issubdtype(array.dtype, np.integer) or array.size == 0):
        raise InputError(f"{what}: expected integers in {ndim} dimension(s), got {array.dtype} of shape {array.shape}")
    array = np.array(array, dtype=np.int64, order="C")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class ContactSurface:
    """Facets of one or of many bodies: all bed-joint faces of a wall are one surface.

    facets (nf, k) global node numbers: 2D segments (k = 2), triangles (k = 3), quadrilaterals (k = 4); a triangle among quadrilaterals
           has -1 in its last place. The right-hand normal points out of the body; in 2D the body lies on the left of a -> b and the
           outward normal is (t_y, -t_x)
    bodies (nf,) number of the body that owns the facet; a node belongs to one body only
    parents the facets of second order that these are pieces of (`contact_surface` makes them); None where there are none
    bulge   (nf, k, k) [m] how far the curved surface that they stand for bulges over them, see `bulges` (`contact_surface` makes it); None:
            the facets are the surface
    """

    facets: IntArray
    bodies: IntArray
    parents: Parents | None = None
    bulge: FloatArray | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        facets = _integers(self.facets, "ContactSurface, facets", 2)
        bodies = _integers(self.bodies, "ContactSurface, bodies", 1)
        if facets.shape[1] not in (2, 3, 4):
            hint = ": cut facets of second order at their nodes, as contact_surface does" if facets.shape[1] in (6, 8, 9) else ""
            raise InputError(f"ContactSurface, facets: expected 2, 3 or 4 nodes a facet, got shape {facets.shape}{hint}")
        if len(bodies) != len(facets):
            raise InputError(f"ContactSurface, bodies: expected one number for each of {len(facets)} facets, got {len(bodies)}")
        if self.parents is not None and len(self.parents.kind) != len(facets):
            raise InputError(f"ContactSurface, parents: expected one for each of {len(facets)} facets, got {len(self.parents.kind)}")
        if self.bulge is not None and self.bulge.shape != (*facets.shape, facets.shape[1]):
            raise InputError(f"ContactSurface, bulge: expected shape {(*facets.shape, facets.shape[1])}, got {self.bulge.shape}")
        if bodies.size and bodies.min() < 0:
            raise InputError(f"ContactSurface, bodies: expected numbers >= 0, got {bodies.min()}")
        real = facets[:, :3] if facets.shape[1] == 4 else facets
        if real.size and (real.min() < 0 or facets.min() < -1):
            raise InputError("ContactSurface, facets: expected node numbers >= 0 (-1 only in the 4th place, for a triangle)")
        nodes, first = np.unique(facets, return_index=True)
        owner = np.repeat(bodies, facets.shape[1])
        wrong = (owner[first][np.searchsorted(nodes, facets)] != bodies[:, None]) & (facets >= 0)
        if wrong.any():
            raise InputError(f"ContactSurface: expected every node in one body, got node {facets[wrong][0]} in facets of several")
        object.__setattr__(self, "facets", facets)
        object.__setattr__(self, "bodies", bodies)

    @property
    def dimension(self) -> int:
        return 2 if self.facets.shape[1] == 2 else 3

    def take(self, chosen: BoolArray) -> ContactSurface:
        """The chosen facets (a mask (nf,))."""
        parents = None if self.parents is None else self.parents.take(chosen)
        return ContactSurface(self.facets[chosen], self.bodies[chosen], parents, None if self.bulge is None else self.bulge[chosen])


@dataclass(frozen=True, eq=False)
class SurfacePair:
    """One rule: candidate points of `slave` may touch facets of `master` (never those of their own body).

    slave      the finer surface, or the softer body's; with "mortar" a slave node has a weight for every node under its facets
    mu         Coulomb friction coefficient >= 0
    alert      [m] >= 0: a contact is kept while its gap is not larger
    candidates node-to-segment: "nodes" of the slave surface, "faces" (facet centres) or "gauss" (2 x 2 points of a quadrilateral, 3 of
               a triangle, 2 of a segment); integrated over the overlaps of the surfaces: "mortar" (a weighted gap for each slave node),
               "mortar-faces" (for each slave facet) or "segments" (Gauss points of each overlap)
    normals    node-to-segment only: the master's, "facet" or "smooth" (interpolated between nodal means, see `smoothed_normals`)
    """

    slave: ContactSurface
    master: ContactSurface
    mu: float
    alert: float
    candidates: CandidateRule = "nodes"
    name: str = ""
    normals: NormalRule = "facet"

    __repr__ = brief

    def __post_init__(self) -> None:
        what = f"SurfacePair {self.name!r}" if self.name else "SurfacePair"
        for role, surface in (("slave", self.slave), ("master", self.master)):
            expect(surface, ContactSurface, f"{what}, {role}", "a surface, as contact_surface(model, [('block', 'z-')]) gives")
        if not (is_number(self.mu) and self.mu >= 0):
            raise InputError(f"{what}: expected a friction coefficient mu >= 0, got {shown(self.mu)}")
        if not (is_number(self.alert) and self.alert >= 0):
            raise InputError(f"{what}: expected an alert distance >= 0 in m, got {shown(self.alert)}")
        if not isinstance(self.candidates, str) or self.candidates not in get_args(CandidateRule):
            raise InputError(f"{what}: expected candidates among {', '.join(get_args(CandidateRule))}, got {shown(self.candidates)}")
        if not isinstance(self.normals, str) or self.normals not in get_args(NormalRule):
            raise InputError(f"{what}: expected normals among {', '.join(get_args(NormalRule))}, got {shown(self.normals)}")
        if self.normals == "smooth" and self.candidates in ("mortar", "mortar-faces", "segments"):
            raise InputError(f"{what}: expected normals 'facet' with candidates {self.candidates!r}, which go by the slave's normals")
        if self.slave.dimension != self.master.dimension:
            raise InputError(
                f"{what}: expected surfaces of one dimension, got slave {self.slave.dimension}D, master {self.master.dimension}D"
            )


def two_pass(
    first: ContactSurface,
    second: ContactSurface,
    mu: float,
    alert: float,
    candidates: CandidateRule = "nodes",
    name: str = "",
    normals: NormalRule = "facet",
) -> tuple[SurfacePair, SurfacePair]:
    """Return the two pairs of a two-pass rule: `first` as slave of `second`, and `second` as slave of `first`.

    The problem holds the contacts of both passes, each with a reaction r in its own Coulomb cone, so that neither surface enters the other.
    Nothing is halved: the two passes share the load, and what acts on a body is the sum over both, with friction at most mu times the
    sum of normal forces. `Step.contact_force_on` sums so.

    Hyperstaticity: the sum is determined, the share of a pass is not. On matching meshes each pair of nodes is two equal contacts and W has
    half its rows for a rank; in general the rank is at most d (slave + master nodes - fields that both sides have).

    Patch test: node-to-segment in two passes passes in 2D on any meshes, as the trapezoidal rule on the union of both sides' nodes is
    a set of reactions that gives the forces of a uniform pressure. R. L. Taylor and P. Papadopoulos, On a patch test for contact
    problems in two dimensions, 1991.
    """
    names = (f"{name}, first on second", f"{name}, second on first") if name else ("", "")
    return (
        SurfacePair(first, second, mu, alert, candidates, names[0], normals),
        SurfacePair(second, first, mu, alert, candidates, names[1], normals),
    )
