"""Contact of everything with everything: the detection that needs no list of pairs."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass, field

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.assembly.supports import moved_together
from fcsim.brief import brief
from fcsim.contact_detection.arguments import excluded_pairs, refuse_alert
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.friction import Friction, FrictionTable
from fcsim.contact_detection.general.edges import EdgeContacts, each_place_once, edge_contacts
from fcsim.contact_detection.general.face_edges import FaceEdges, face_edges
from fcsim.contact_detection.general.folding import deformation, folding_bodies, with_folding
from fcsim.contact_detection.general.near import Lengths, NearBodies, near_bodies
from fcsim.contact_detection.general.overlap.convex import shallow_edges, shallow_vertices
from fcsim.contact_detection.general.overlap.overlaps import overlap_contacts
from fcsim.contact_detection.general.smoothing import bulge_of, bulges_of_skin, of_both_sides, smoothed, smoothed_faces
from fcsim.contact_detection.general.vertices import VertexContacts, vertex_contacts
from fcsim.contact_detection.skin.boundary import boundary_of
from fcsim.contact_detection.skin.closed_skin import closed_skin, faces_of
from fcsim.contact_detection.skin.shape import shape_of
from fcsim.contact_detection.skin.skin import Shape, Skin
from fcsim.contact_detection.sweep import samples, with_swept
from fcsim.errors import MODEL, InputError, expect
from fcsim.mesh.curves.bulges import bulges_of_all_edges, highest
from fcsim.mesh.part import Body

_ALERT = 1e-2  # of a body's extent
_ROUND, _DEFORMS = 1e-6, 1e-3  # of a facet: places nearer are one; flush sides of elastic bodies do not stay flush to round-off
_SLOW = 0.1  # bodies that approach by less than this part of the alert distance in a step are looked at once
_CREEPS = 1e-3  # the same of bodies whose corners pass each other
_BETWEEN = 0.25  # of the smaller body, between two looks along the way


@dataclass(frozen=True, eq=False)
class Everything:
    """Contact between all bodies of a model, deformable and rigid, in 2D and 3D, found without listing pairs, and of deformable bodies that
    fold with themselves (`folding`).

    mu        Coulomb friction: a number, a table {("brick", "floor"): 0.5, ("*", "*"): 0.7} or a function of two names
    alert     [m] contacts are kept while their gap is not larger; by default 1 % of the smaller body's extent, its diagonal / sqrt(d)
    exclude   pairs of names that do not touch each other; ("a", "a"): "a" does not touch itself

    curved    names of bodies whose facets stand for a curved surface: normals are interpolated between those that meet at less than 45
              degrees, see `smoothing`; on deformable bodies that are not named, at less than 23 degrees
    smooth    False: bodies that `curved` does not name keep their facets' own normals, deformable ones too, whose sliding along a facet
              does no work then

    Every body's whole closed surface takes part: the boundary of a deformable body's cells, all surfaces of a rigid one. Contacts are
    vertices on facets (both ways) and crossing edges, which together are the corners of flat patches, with the faces' normals; see
    `vertices` and `edges` for the rules. Two bodies that supports hold completely, and do not move to each other, do not touch each other.

    `everything(positions)` returns the contacts sorted by identity; with the step's `displacement` also those met on the way (`sweep`).
    InputError: a surface that is open or inside out, a table of friction without an entry that is asked for, names that do not exist.
    """

    model: Model
    mu: Friction
    alert: float | None = None
    exclude: Iterable[tuple[str, str]] = ()
    curved: Iterable[str] = ()
    smooth: bool = True
    skin: Skin = field(init=False, repr=False)
    lengths: Lengths = field(init=False, repr=False)
    faces: FaceEdges = field(init=False, repr=False)
    friction: FrictionTable = field(init=False, repr=False)
    together: IntArray = field(init=False, repr=False)
    excluded: IntArray = field(init=False, repr=False)
    folding: IntArray = field(init=False, repr=False)
    _reference: Shape = field(init=False, repr=False)
    smoothed_bodies: BoolArray = field(init=False, repr=False)
    patches: IntArray = field(init=False, repr=False)
    face: IntArray = field(init=False, repr=False)
    bulge: FloatArray | None = field(init=False, repr=False)
    _latest: list[tuple[FloatArray, tuple[Contacts, IntArray]]] = field(init=False, repr=False, default_factory=list)

    __repr__ = brief

    def __post_init__(self) -> None:
        model = self.model
        expect(model, Model, "Everything, model", MODEL)
        names = [body.name for body in model.bodies]
        refuse_alert("Everything", self.alert)
        skin = closed_skin(boundary_of(model), model.reference, names)
        excluded = excluded_pairs("Everything", model, self.exclude)
        if isinstance(self.curved, str):
            raise InputError(f"Everything, curved: expected several names of bodies, got {self.curved!r}: write [{self.curved!r}]")
        if not isinstance(self.smooth, bool):
            raise InputError(f"Everything, smooth: expected True or False, got {self.smooth!r}")
        named = np.isin(np.arange(len(names)), [model.body_number(name) for name in self.curved])
        reference = shape_of(skin, model.reference)
        folding = folding_bodies(skin, reference, [body.part if isinstance(body, Body) else None for body in model.bodies])
        driven = np.bincount(np.searchsorted(model.dof_offset, model.driven_dofs, side="right") - 1, minlength=len(names))
        values = {
            "skin": skin,
            "faces": face_edges(skin, reference, len(model.deformable)),
            "friction": FrictionTable(self.mu, names),
            "together": moved_together(model, model.held, model.supports),
            "excluded": excluded,
            "folding": folding[(driven < np.diff(model.dof_offset))[folding] & ~np.isin(folding * (len(names) + 1), excluded)],
            "_reference": reference,
            "smoothed_bodies": named | np.array([self.smooth and isinstance(body, Body) for body in model.bodies]),
            "patches": np.where(named[skin.facet_body], skin.side, skin.patch),
        }
        values["face"] = faces_of(skin, reference.normal, values["smoothed_bodies"], values["patches"])
        values["bulge"] = bulge = bulges_of_skin(skin, reference, values["smoothed_bodies"], values["patches"])
        values["lengths"] = _lengths(skin, reference, len(model.deformable), self.alert, bulge)
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def with_all_chords(self) -> Everything:
        """The same with all facets that meet at less than 45 degrees taken for chords of curves, see `bulges_of_all_edges`."""
        skin, every = self.skin, np.ones(self.skin.n_bodies, dtype=bool)
        other = copy(self)
        bulge = bulges_of_skin(skin, self._reference, every, skin.side, bulges_of_all_edges)
        lengths = _lengths(skin, self._reference, len(self.model.deformable), self.alert, bulge)
        values: dict[str, object] = {"smoothed_bodies": every, "patches": skin.side, "face": skin.side, "bulge": bulge, "lengths": lengths}
        values["_latest"] = []
        for name, value in values.items():
            object.__setattr__(other, name, value)
        return other

    @property
    def n_nodes(self) -> int:
        return self.model.n_nodes

    @property
    def left_out(self) -> IntArray:
        """The pairs of bodies (n, 2) that are excluded."""
        return np.stack(np.divmod(self.excluded, self.skin.n_bodies), axis=1)

    @property
    def reference_normals(self) -> FloatArray:
        """Unit normals (nf, 3) of the skin's facets in the reference configuration."""
        return self._reference.normal

    @property
    def dimension(self) -> int:
        return self.skin.dimension

    @property
    def nodes(self) -> IntArray:
        """Sorted numbers of the nodes that contacts can touch."""
        return self.skin.node

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        """Contacts at `positions` (n_nodes, d) [m]; displacement (n_nodes, d) [m] of the step to come, see `Detection`."""
        x = self._checked("positions", positions)
        now, beyond = self._here(x)
        if displacement is None:
            return now
        way = self._checked("displacement", displacement)
        fast, count, alert, own = self._fast(x, way, beyond)
        if not count:
            return now
        times, farther = np.arange(count + 1) / count, fast.take(fast.alert > own)
        if not len(farther.bodies):  # all that is found at the beginning of those with their own alert distances is among `now`
            times = times[1:]
        return with_swept(now, lambda t: self._at(x + t * way, fast if t > 0.0 else farther)[0], x, way, times, alert)

    def _here(self, x: FloatArray) -> tuple[Contacts, IntArray]:
        """`_at` x of all bodies. The last two answers are kept: a step looks ahead where the next begins, and at its end."""
        for place, answer in self._latest:
            if np.array_equal(place, x):
                return answer
        self._latest[:] = [(x.copy(), self._at(x)), *self._latest[:1]]
        return self._latest[0][1]

    def _at(self, x: FloatArray, among: NearBodies | None = None) -> tuple[Contacts, IntArray]:
        """Contacts at x of all bodies, or of those pairs, and which bodies have corners beyond each other's rims, see `vertex_contacts`."""
        shape = shape_of(self.skin, x)
        if among is None:
            near = self._may_touch(near_bodies(shape.body_low, shape.body_high, self.lengths))
            among = with_folding(near, self.folding, self.lengths)
        vertices, beyond, met = vertex_contacts(self.skin, shape, among, self._reference, len(self.model.deformable), self.face)
        vertices = shallow_vertices(self.skin, shape, among, vertices)
        edges = edge_contacts(self.skin, shape, among, vertices, self._reference, self.faces)
        edges = shallow_edges(self.skin, shape, among, edges)
        vertices, edges = each_place_once(self.skin, shape, vertices, edges, self.faces)
        edges = smoothed_faces(self.skin, shape, edges, self.faces.within, self.smoothed_bodies, self.patches)
        unseen = overlap_contacts(self.skin, shape, among, vertices, edges)
        if unseen is not None:
            unseen = shallow_vertices(self.skin, shape, among, unseen)
            vertices = VertexContacts._make(np.concatenate(both) for both in zip(vertices, unseen, strict=True))
        vertices = smoothed(self.skin, shape, vertices, self.smoothed_bodies, self.patches)
        vertices = of_both_sides(self.skin, shape, vertices, met, self.smoothed_bodies, self.patches) if len(met) else vertices
        return self._contacts(x, vertices, edges, bulge_of(self.skin, shape, self.bulge, self.patches, vertices, edges)), beyond

    def _may_touch(self, near: NearBodies) -> NearBodies:
        a, b = near.bodies.T
        keep = self.together[a] != self.together[b]
        if len(self.excluded):
            keep &= ~np.isin(a * self.skin.n_bodies + b, self.excluded)
        return near if keep.all() else near.take(keep)

    def _fast(self, x: FloatArray, way: FloatArray, beyond: IntArray) -> tuple[NearBodies, int, float, FloatArray]:
        """Bodies that may meet on their way, into how many parts it is cut, the largest of their alert distances [m], and what these are
        where nothing moves. Slow ones have all that they may meet among their contacts at x, but corners `beyond` each other's rims."""
        skin = self.skin
        here, move = (np.pad(field[skin.node], ((0, 0), (0, 3 - skin.dimension))) for field in (x, way))
        least, most = (f.reduceat(move, skin.first_vertex[:-1], axis=0) for f in (np.minimum, np.maximum))
        low = np.minimum.reduceat(np.minimum(here, here + move), skin.first_vertex[:-1], axis=0)
        high = np.maximum.reduceat(np.maximum(here, here + move), skin.first_vertex[:-1], axis=0)
        near = with_folding(self._may_touch(near_bodies(low, high, self.lengths)), self.folding, self.lengths)
        a, b = near.bodies.T
        motion = np.maximum(np.abs(most[a] - least[b]), np.abs(most[b] - least[a]))
        for row in np.flatnonzero(near.itself):
            own = slice(*skin.first_vertex[a[row] : a[row] + 2])
            motion[row] = np.ptp(deformation(here[own], move[own]), axis=0)
        distance = np.sqrt(np.einsum("pd,pd->p", motion, motion))
        moving = distance > np.where(np.isin(a * skin.n_bodies + b, beyond), _CREEPS, _SLOW) * near.alert
        near, distance = near.take(moving), distance[moving]
        if not len(distance):
            return near, 0, 0.0, near.alert
        a, b = near.bodies.T
        spacing = np.maximum(near.alert, _BETWEEN * np.minimum(self.lengths.extent[a], self.lengths.extent[b]))
        most_looks = int(np.argmax(distance / spacing))
        count = samples(float(distance[most_looks]), float(spacing[most_looks]))
        # at every look, all that the motion to the next one may close
        fast = near._replace(alert=np.maximum(near.alert, distance / max(count, 1)))
        return fast, count, float(near.alert.max()), near.alert

    def _contacts(self, x: FloatArray, vertices: VertexContacts, edges: EdgeContacts, bulge: FloatArray | None) -> Contacts:
        """Contacts of both kinds, sorted by identity: (vertex, smooth side of the other body), then (edge, edge)."""
        skin, d = self.skin, self.dimension
        corners = skin.facets[vertices.facet]
        along = edges.place[:, :, None] * [-1.0, 1.0] + [1.0, 0.0]
        width = 2 if d == 2 else 4
        node = np.full((len(vertices.gap) + len(edges.gap), 1 + width), -1)
        weights = np.zeros(node.shape)
        nv = len(vertices.gap)
        node[:nv, 0], weights[:nv, 0] = skin.node[vertices.vertex], 1.0
        node[:nv, 1:], weights[:nv, 1:] = skin.node[corners[:, :width]], -vertices.weights[:, :width]
        node[:nv, 1:][weights[:nv, 1:] == 0.0] = -1
        node[nv:, :4] = skin.node[skin.edges[edges.edges].reshape(-1, 4)[:, : 1 + width]]
        weights[nv:, :4] = (along * np.array([1.0, -1.0])[:, None]).reshape(-1, 4)[:, : 1 + width]
        bodies = np.concatenate(
            [
                np.column_stack([skin.vertex_body[vertices.vertex], skin.facet_body[vertices.facet]]),
                skin.vertex_body[skin.edges[edges.edges, 0]].reshape(-1, 2),
            ]
        )
        crossing = len(skin.node) * skin.n_sides + edges.edges[:, 0] * len(skin.edges) + edges.edges[:, 1]
        identity = np.concatenate([self._identity(vertices), crossing])
        normal = np.concatenate([vertices.normal, edges.normal])[:, :d]
        foot = -np.einsum("ak,akd->ad", np.minimum(weights, 0.0), x[node])
        gap = np.concatenate([vertices.gap, edges.gap])
        gap = gap if bulge is None else gap - bulge
        contacts = Contacts(foot, frames(normal), gap, self.friction(bodies), node, weights, bodies, identity, bulge)
        return contacts.take(np.unique(identity, return_index=True)[1])

    def _identity(self, vertices: VertexContacts) -> IntArray:
        """Numbers of vertices on sides; of the faces of one side that a vertex in their corner touches the first has that number, and
        others numbers of their own beyond those of edges."""
        skin, face = self.skin, self.face[vertices.facet]
        number = vertices.vertex * skin.n_sides + skin.side[vertices.facet]
        order = np.lexsort((face, number))
        again = order[1:][(number[order][1:] == number[order][:-1]) & (face[order][1:] != face[order][:-1])]
        if len(again):
            beyond = len(skin.node) * skin.n_sides + len(skin.edges) ** 2
            number[again] = beyond + vertices.vertex[again] * len(skin.facets) + face[again]
        return number

    def _checked(self, what: str, values: FloatArray) -> FloatArray:
        x = np.asarray(values, dtype=np.float64)
        if x.shape != (self.n_nodes, self.dimension):
            raise InputError(f"Everything, {what}: expected shape {(self.n_nodes, self.dimension)}, got {x.shape}")
        if not np.isfinite(x).all():
            raise InputError(f"Everything, {what}: expected finite numbers, got NaN or infinity")
        return x


def _lengths(skin: Skin, shape: Shape, deformable: int, alert: float | None, bulge: FloatArray | None) -> Lengths:
    """Lengths of the bodies, of which the first so many are deformable, in the reference configuration."""
    extent = (shape.body_high - shape.body_low)[:, : skin.dimension]
    diagonal = np.sqrt(np.einsum("bd,bd->b", extent, extent) / skin.dimension)
    sizes = np.split(shape.size, skin.first_facet[1:-1])
    largest, typical = (np.array([f(size) for size in sizes]) for f in (np.max, np.median))
    share = np.where(np.arange(len(sizes)) < deformable, _DEFORMS, _ROUND)
    alerts = _ALERT * diagonal if alert is None else np.full(len(sizes), alert)
    outside = np.zeros(len(skin.facets)) if bulge is None else highest(bulge)
    over_facets = np.maximum.reduceat(outside, skin.first_facet[:-1])
    return Lengths(alerts, 0.5 * largest, share * typical, _DEFORMS * typical, diagonal, over_facets)
