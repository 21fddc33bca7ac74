"""Detection with exact shapes: spheres, capsules, cylinders, planes with each other and with meshed bodies, and these among themselves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.assembly.supports import moved_together
from fcsim.brief import brief, shown
from fcsim.contact_detection.arguments import excluded_pairs, refuse_alert
from fcsim.contact_detection.contacts import EXACT, KIND, Contacts, join
from fcsim.contact_detection.exact.cylinders import cylinders_with_cylinders
from fcsim.contact_detection.exact.cylinders_on_meshes import cylinders_on_meshes
from fcsim.contact_detection.exact.dents import beside, vertices_under
from fcsim.contact_detection.exact.facets import balls_on_meshes, sides_on_meshes
from fcsim.contact_detection.exact.level import in_the_way
from fcsim.contact_detection.exact.looks import looks, met_ahead
from fcsim.contact_detection.exact.mesh_skin import MeshSkin, mesh_skin
from fcsim.contact_detection.exact.meshes_on_planes import meshes_on_planes
from fcsim.contact_detection.exact.pairs import balls_on_cylinders, on_planes, rounded_contacts
from fcsim.contact_detection.exact.solids import Placed, Solids, Touch, placed, placed_on_the_way, round_points, solids_of
from fcsim.contact_detection.frames import frames
from fcsim.contact_detection.friction import Friction, FrictionTable
from fcsim.contact_detection.general.everything import Everything
from fcsim.contact_detection.sweep import with_swept
from fcsim.errors import MODEL, InputError, expect
from fcsim.mesh.exact_shape import endless

_ON_PLANES = {2: 4, 3: 6}
"""By dimension, the kind of vertices on planes: slaves of one node, where others have d + 1."""

_KEPT = 3
"""Configurations whose contacts are kept: a step asks for those at its end twice, and the next one begins where it looked last."""

_ALERT = 0.05  # of the smallest radius; where planes are the only exact shapes, of half the smallest extent of what is meshed


@dataclass(frozen=True, eq=False)
class ExactContacts:
    """Contact between all bodies of a model with bodies of exact shape (`fcsim.mesh.rigid_sphere` and its like), without listing pairs.

    mu, exclude: as for `Everything`; alert [m]: contacts are kept while their gap is not larger, by default 5 % of the smallest radius;
    where planes are the only exact shapes, 2.5 % of the smallest meshed body's extent, its diagonal / sqrt(d); curved, smooth: of meshed
    bodies among themselves, as for `Everything`.

    Gaps, points and normals between exact shapes have no error of facets. Spheres, capsules, cylinders and planes are found with each other
    and with meshed bodies (of cylinders' rims see `cylinders`), these with each other by `Everything`. InputError where the model has no
    exact shape.
    """

    model: Model
    mu: Friction
    alert: float | None = None
    exclude: Iterable[tuple[str, str]] = ()
    curved: Iterable[str] = ()
    smooth: bool = True
    solids: Solids = field(init=False, repr=False)
    skin: MeshSkin | None = field(init=False, repr=False)
    meshed: Everything | None = field(init=False, repr=False)
    distance: float = field(init=False, repr=False)
    friction: FrictionTable = field(init=False, repr=False)
    together: IntArray = field(init=False, repr=False)
    excluded: IntArray = field(init=False, repr=False)
    _meshed_nodes: IntArray = field(init=False, repr=False)
    _meshed_bodies: IntArray = field(init=False, repr=False)
    _recent: tuple[tuple[tuple[bytes, float], list[Touch]], ...] = field(init=False, repr=False, default=())

    __repr__ = brief

    def __post_init__(self) -> None:
        model = self.model
        expect(model, Model, "ExactContacts, model", MODEL)
        solids = solids_of(model)
        if not len(solids.body):
            raise InputError("ExactContacts: expected bodies of exact shape (rigid_sphere and its like), got none: use Everything")
        refuse_alert("ExactContacts", self.alert)
        radii = solids.radius[solids.radius > 0]
        names = [body.name for body in model.bodies]
        excluded = excluded_pairs("ExactContacts", model, self.exclude)
        others = np.setdiff1d(np.arange(len(names)), solids.body)
        self._refuse_curved([names[k] for k in others])
        offset = model.node_offset
        nodes = np.concatenate([np.empty(0, dtype=np.int64), *(np.arange(offset[k], offset[k + 1]) for k in others)])
        rest = _without_exact(model, others) if len(others) else None
        values = {
            "solids": solids,
            "skin": mesh_skin(rest, nodes, others) if rest is not None else None,
            "meshed": self._everything(rest) if rest is not None and (len(others) > 1 or rest.deformable) else None,
            "distance": self.alert if self.alert is not None else _ALERT * float((radii if len(radii) else _half_extents(model)).min()),
            "friction": FrictionTable(self.mu, names),
            "together": moved_together(model, model.held, model.supports),
            "excluded": excluded,
            "_meshed_nodes": nodes,
            "_meshed_bodies": others,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def _refuse_curved(self, meshed: list[str]) -> None:
        """InputError where `curved` names bodies that have no facets; `Everything` has the others."""
        object.__setattr__(self, "curved", self.curved if isinstance(self.curved, str) else tuple(self.curved))
        if isinstance(self.curved, str) or not set(self.curved) <= set(meshed):
            raise InputError(f"ExactContacts, curved: expected names of meshed bodies, some of {shown(meshed)}, got {shown(self.curved)}")
        if not isinstance(self.smooth, bool):
            raise InputError(f"ExactContacts, smooth: expected True or False, got {shown(self.smooth)}")

    def _everything(self, rest: Model) -> Everything:
        """The detection among the meshed bodies alone."""
        known = set(rest.number)
        mu = {key: m for key, m in self.mu.items() if set(key) <= known | {"*"}} if isinstance(self.mu, dict) else self.mu
        exclude = [pair for pair in self.exclude if set(pair) <= known]
        return Everything(rest, mu, None, exclude, self.curved, self.smooth)

    def _may_touch(self, bodies: IntArray) -> BoolArray:
        """Which pairs of bodies (n, 2) may move to each other and are not excluded."""
        a, b = bodies.min(axis=1), bodies.max(axis=1)
        return (self.together[a] != self.together[b]) & ~np.isin(a * len(self.together) + b, self.excluded)

    @property
    def n_nodes(self) -> int:
        return self.model.n_nodes

    @property
    def left_out(self) -> IntArray:
        """The pairs of bodies (n, 2) that are excluded."""
        return np.stack(np.divmod(self.excluded, len(self.together)), axis=1)

    @property
    def nodes(self) -> IntArray:
        """Sorted numbers of the nodes that contacts can touch."""
        own = [] if self.meshed is None else [self._meshed_nodes[self.meshed.nodes]]
        skin = [] if self.skin is None else [self.skin.vertices]
        return np.unique(np.concatenate([self.solids.node.ravel(), *skin, *own]))

    def __call__(self, positions: FloatArray, displacement: FloatArray | None = None) -> Contacts:
        """Contacts at `positions` (n_nodes, d) [m], sorted by identity.

        displacement (n_nodes, d) [m] of the step to come: what is met on that way is found too, see `looks`.
        """
        x = np.asarray(positions, dtype=np.float64)
        if x.shape != (self.n_nodes, self.model.dimension) or not np.isfinite(x).all():
            raise InputError(f"ExactContacts: expected finite positions of shape {(self.n_nodes, self.model.dimension)}, got {x.shape}")
        way = None if displacement is None else np.asarray(displacement, dtype=np.float64)
        contacts = self._along(x, way)
        if self.meshed is None:
            return contacts
        nodes = self._meshed_nodes
        among = self.meshed(x[nodes], None if way is None else way[nodes])
        numbered = np.where(among.nodes < 0, -1, nodes[among.nodes])
        return join([replace(among, nodes=numbered, bodies=self._meshed_bodies[among.bodies]), contacts])

    def _along(self, x: FloatArray, way: FloatArray | None) -> Contacts:
        """Contacts with exact shapes at x and along the way of the step."""
        now, alert = placed(self.solids, x), self.distance
        if way is None:
            return self._contacts(self._standing(now, x, alert))
        count, closing = looks(now, self.skin, x, way, alert)
        touches, ahead = self._with_ahead(self._standing(now, x, alert if count else alert + closing), now, x, way)
        begin = self._contacts(touches)
        if not (count or ahead):
            return begin
        # what an edge ahead does not hold any more, the face behind it may
        further, times = max(alert, closing), np.arange(1, count + 1) / count if count else np.ones(1)

        def met_at(t: float) -> Contacts:
            there = x + t * way
            then = placed_on_the_way(self.solids, there)
            return self._contacts([round_points(touch, then, now) for touch in self._touches(then, there, further)])

        met = with_swept(begin, met_at, x, way, times, alert, passing=partial(self._beside, between=closing))
        return self.on_their_master(met, x)

    def _beside(self, contacts: Contacts, between: float) -> FloatArray:
        """The gap (nc,) [m] that round bodies which touch have had somewhere, at places that are `between` [m] apart on a way; of what has
        corners none is enough.

        Two balls are at most s^2 / (2 R) nearer at the middle of a way of 2 s than at its end, R the sum of their radii; so are a core and
        an edge or a corner, R the radius.
        """
        solids = self.solids
        radius = np.full(len(self.model.bodies), np.inf)
        radius[solids.body] = np.where(np.isin(np.arange(len(solids.kind)), solids.of("cylinder")), 0.0, solids.radius)
        radius[solids.body[solids.of("plane")]] = np.inf
        least = radius[contacts.bodies].min(axis=1)
        least = np.where(np.isfinite(least), least, 0.0)
        return np.where(least > 0, between**2 / np.maximum(8.0 * least, 1e-300), np.inf)

    def on_their_master(self, contacts: Contacts, x: FloatArray) -> Contacts:
        """Contacts found elsewhere with their points on the master at x (n_nodes, d) [m]: a point of a solid moves with weights of both
        signs, so that its place is told by the master's columns, not by the signs."""
        alone = (contacts.identity - EXACT) >> KIND == _ON_PLANES[x.shape[1]]
        master = np.arange(contacts.nodes.shape[1]) >= np.where(alone, 1, x.shape[1] + 1)[:, None]
        weights = np.where(master & (contacts.nodes >= 0), -contacts.weights, 0.0)
        exact = contacts.identity >= EXACT  # those among meshed bodies have theirs
        point = np.where(exact[:, None], np.einsum("ak,akd->ad", weights, x[contacts.nodes]), contacts.point)
        return replace(contacts, point=point)

    def rolled_back(self, contacts: Contacts, there: FloatArray, begin: FloatArray) -> Contacts:
        """Contacts found at positions `there` (n_nodes, d) [m] with the weights of points of round bodies that touched in the same place
        at `begin`, see `round_points`."""
        d = there.shape[1]
        before = placed(self.solids, begin)
        curved = self.solids.body[self.solids.of("sphere", "capsule", "cylinder")]
        rows = np.flatnonzero(np.isin(contacts.bodies, curved).any(axis=1))
        if not len(rows):
            return contacts
        nodes, weights = contacts.nodes[rows], np.where(contacts.nodes[rows] < 0, 0.0, contacts.weights[rows])
        parts = (nodes[:, : d + 1], weights[:, : d + 1]), (nodes[:, d + 1 :], -weights[:, d + 1 :])
        slave, master = (np.einsum("nk,nkd->nd", weight, there[node]) for node, weight in parts)
        touch = Touch(contacts.frame[rows, 0], slave, master, *parts[0], *parts[1], contacts.bodies[rows], contacts.identity[rows])
        touch = round_points(touch, placed(self.solids, there), before)
        back = contacts.weights.copy()
        back[rows] = np.concatenate([touch.slave_weights, -touch.master_weights], axis=1)
        return replace(contacts, weights=back)

    def _standing(self, now: Placed, x: FloatArray, alert: float) -> list[Touch]:
        """`_touches` of solids `placed` at x, those of the last configurations kept."""
        key = (x.tobytes(), alert)
        for known, touches in self._recent:
            if known == key:
                return touches
        touches = self._touches(now, x, alert)
        object.__setattr__(self, "_recent", ((key, touches), *self._recent[: _KEPT - 1]))  # in one piece: steps are written by a thread
        return touches

    def _touches(self, now: Placed, x: FloatArray, alert: float) -> list[Touch]:
        """Contacts of the exact shapes as they stand, up to a gap of `alert` [m], by kind."""
        found = [rounded_contacts(now, alert), on_planes(now, alert)]
        if x.shape[1] == 3:
            found += [balls_on_cylinders(now, alert), cylinders_with_cylinders(now, alert)]
        if self.skin is not None:
            found += self._on_meshes(now, self.skin, x, alert)
        return found

    def _with_ahead(self, found: list[Touch], now: Placed, x: FloatArray, way: FloatArray) -> tuple[list[Touch], bool]:
        """The contacts with what is `met_ahead` on the way (n_nodes, d) [m] of a step, and whether anything is."""
        if self.skin is None:
            return found, False
        known, touches, ahead = np.isin(np.arange(len(self.model.bodies)), self.solids.body), list(found), False
        for kind, touch in enumerate(found):
            if len(touch.bodies) and not known[touch.bodies[:, 1]].any():
                touches[kind], other = met_ahead(touch, now, x, way)
                ahead |= other
        return touches, ahead

    def _on_meshes(self, now: Placed, skin: MeshSkin, x: FloatArray, alert: float) -> list[Touch]:
        """Contacts with meshed bodies, by kind."""
        balls, sides, planes = (
            balls_on_meshes(now, skin, x, alert),
            sides_on_meshes(now, skin, x, alert),
            meshes_on_planes(now, skin, x, alert),
        )
        found = [balls, sides, planes]
        if x.shape[1] == 3:
            rims = cylinders_on_meshes(now, skin, x, alert)
            found = [balls, sides.take(in_the_way(sides, rims, now, skin)), planes, rims.take(in_the_way(rims, rims, now, skin))]
        if not skin.deforms.any():
            return found
        dents = vertices_under(now, skin, x, alert)
        number = np.full(len(self.model.bodies), -1)
        number[self.solids.body] = np.arange(len(self.solids.body))
        stay = [touch if touch is planes else touch.take(beside(touch, dents, number, len(x))) for touch in found]
        return [*stay, dents.touch]

    def _contacts(self, found: list[Touch]) -> Contacts:
        """The contacts of all kinds."""
        # the first has as many nodes as any, so that a contact has them whatever else is found
        return join([self._of_kind(touch, kind) for kind, touch in enumerate(found) if len(touch.bodies) or kind == 0])

    def _of_kind(self, touch: Touch, kind: int) -> Contacts:
        """Contacts of a kind, sorted by identity."""
        touch = touch.take(self._may_touch(touch.bodies))
        touch = touch.take(np.argsort(touch.identity, kind="stable"))
        return Contacts(
            touch.master_point,
            frames(touch.normal),
            touch.gap,
            self.friction(touch.bodies),
            np.concatenate([touch.slave_node, touch.master_node], axis=1),
            np.concatenate([touch.slave_weights, -touch.master_weights], axis=1),
            touch.bodies,
            EXACT + (kind << KIND) + touch.identity,
        )


def _half_extents(model: Model) -> FloatArray:
    """Half the extents [m] of the bodies that are no planes: their diagonals / sqrt(d); of planes alone, which touch nothing, 1."""
    points = [body.points for body in model.bodies if not endless(body)]
    return np.array([0.5 * np.linalg.norm(np.ptp(own, axis=0)) / np.sqrt(own.shape[1]) for own in points] or [1.0])


def _without_exact(model: Model, chosen: IntArray) -> Model:
    """The model of the chosen bodies alone, with their supports and without loads: what `Everything` looks at."""
    bodies = tuple(model.bodies[k] for k in chosen)
    names = {body.name for body in bodies}
    return replace(model, bodies=bodies, supports=tuple(s for s in model.supports if s.body in names), loads=(), gravity=None)
