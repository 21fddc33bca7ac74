"""What is said of bodies that roll on the corners between their facets: each corner that comes down is an impact."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.assembly.model import Model
from fcsim.contact_detection.skin.boundary import boundary_of_meshed
from fcsim.contact_detection.surfaces.model_surfaces import bulges_of_all_chords, bulges_of_surface
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.problem import STICK
from fcsim.timestep.remarks.of_laws.carried_round import has_turned
from fcsim.timestep.step import Step

TAKEN = 0.02
"""Of the energy that the run began with and was supplied with: less is not said."""
ROLLED = 0.5
"""[rad] Through which a body has turned since it first bore: less is a blow, or a body that settles."""

EVEN = 0.4
"""The median of |ln| of the sizes of two facets that meet, of rigid bodies that are meshed curves: of hulls of 40 to 2000 random points on
an ellipsoid it is 0.6 to 1, of points spread evenly on one, of a net of meridians, of a turned polygon 0 to 0.15."""


class Corners:
    """The remark on the first round body that lost more than `TAKEN` of the energy there to its own corners: call it with steps in turn.

    A body of facets of length L that rolls at omega turns about the corner that bears until the next one comes down, with up to omega L
    where a curve would with 0, and along the plane as fast where it pivots. What contact takes of that is r times the mean of u before and
    after; counted are the contacts of round places that come down no faster, and those that stick and came along no faster; stiff bodies
    hop from corner to corner. Falls and blows are faster, and a block that rocks on its edges has no round places: facets at less than 45
    degrees to each other are chords of a deformable body's curve (`bulges_of_all_chords`), of a rigid one, which may be meant as a
    polyhedron, evident curves at less than 23 alone (`bulges_of_surface`), and those of a mesh (`EVEN`): a rock is the hull of points at
    random, on an ellipsoid or not.
    """

    def __init__(self) -> None:
        self._round: FloatArray | None = None
        self._bore: BoolArray = np.zeros(0, dtype=bool)
        self._has_round: BoolArray = np.zeros(0, dtype=bool)
        self._taken, self._turned = np.zeros(0), np.zeros(0)

    def __call__(self, step: Step, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark by its kind; {} where there is none, or where it is `said`."""
        model, number = step.model, len(step.model.bodies)
        if "corners" in said or not step.scheme.timing.moving or not has_turned(step, found):
            return {}
        if self._round is None:
            self._round, self._bore = _round_places(model), np.zeros(number, dtype=bool)
            self._has_round = np.bincount(model.body_of_node, self._round, number) > 0
            self._taken, self._turned = np.zeros(number), np.zeros(number)
        if not self._has_round.any():
            return {}
        self._look(step, self._round)
        share = np.where(self._turned > ROLLED, self._taken, 0.0) / max(step.ledger.supplied, 1e-300)
        worst = int(np.argmax(share))
        if share[worst] < TAKEN:
            return {}
        return {
            "corners": f"{when}: {model.bodies[worst].name!r} rolls on the corners between its facets, and where they come down contact "
            f"has taken {self._taken[worst]:.3g} J, {100 * share[worst]:.2g} % of the energy there; what is round loses none. What helps: "
            "smaller facets, of half the length they lose about half, or an exact shape, rigid_cylinder or rigid_sphere with ExactContacts "
            "(docs/contact_rules.md)"
        }

    def _look(self, step: Step, round_: FloatArray) -> None:
        """Add what the corners of each body have taken in the step, and how far it has turned."""
        model, contacts, meeting, number = step.model, step.contacts, step.encounter.meeting, len(self._bore)
        force = step.encounter.forces(step.encounter.reaction(step.result.r))
        rows = np.flatnonzero(force[:, 0] > 0)
        bodies = contacts.bodies[rows]
        self._bore |= self._has_round & np.isin(np.arange(number), bodies)
        if not self._bore.any():
            return
        rate, soft = np.zeros(number), len(model.deformable)
        rate[soft:] = np.linalg.norm(model.rigid_part(step.state.v)[:, model.dimension :], axis=1)
        if len(those := np.flatnonzero(self._bore[:soft])):
            rate[those] = turning_rates(model, step.state.x, step.state.v, those)
        self._turned += step.scheme.h * step.substeps * rate
        before, after = meeting.before[rows], step.encounter.relative(step.state.v).reshape(force.shape)[rows]
        work = force[rows] * (meeting.timing.theta * after + (1.0 - meeting.timing.theta) * before)
        down, along = -before[:, 0], np.linalg.norm(before[:, 1:], axis=1)
        along[step.contact_status[rows] != STICK] = np.inf
        nodes = contacts.nodes[rows]
        for side, sign in enumerate((1.0, -1.0)):
            own = (nodes >= 0) & (sign * contacts.weights[rows] > 0)
            length = np.where(own, round_[nodes], 0.0).max(axis=1)
            body = bodies[:, side]
            fastest = rate[body] * length
            for rolls, taken in (((down > 0) & (down <= fastest), work[:, 0]), (along <= fastest, work[:, 1:].sum(axis=1))):
                rolls &= length > 0
                self._taken -= np.bincount(body[rolls], taken[rolls], minlength=number)


def _round_places(model: Model) -> FloatArray:
    """(n_nodes,) [m] The longest side of the facets at a node where their curve goes outwards, 0 elsewhere."""
    skin, longest, soft = boundary_of_meshed(model), np.zeros(model.n_nodes), len(model.deformable)
    for kind, bulges_of in ((skin.body < soft, bulges_of_all_chords), (skin.body >= soft, bulges_of_surface)):
        bulge = bulges_of(model, ContactSurface(skin.facets[kind], skin.body[kind]))
        if bulge is None:
            continue
        bent = np.flatnonzero(kind)[(bulge > 0).any(axis=(1, 2))]
        if bulges_of is bulges_of_surface:
            bent = bent[_even(model.reference, skin.facets[bent], skin.body[bent])]
        facets = skin.facets[bent]
        after = np.roll(facets, -1, axis=1)
        after = np.where(after < 0, facets[:, :1], after)
        length = np.linalg.norm(model.reference[facets] - model.reference[after], axis=2)
        length[facets < 0] = 0.0
        np.maximum.at(longest, facets[facets >= 0], np.broadcast_to(length.max(axis=1)[:, None], facets.shape)[facets >= 0])
    return longest


def turning_rates(model: Model, x: FloatArray, v: FloatArray, bodies: IntArray) -> FloatArray:
    """How fast deformable bodies turn, (n,) [rad/s]: |omega| of the rotation about its middle that is nearest to its nodes' velocities.

    x, v: displacement and velocity of all degrees of freedom; bodies (n,): numbers of deformable bodies, n > 0.
    """
    first, count = model.node_offset[bodies], model.node_offset[bodies + 1] - model.node_offset[bodies]
    start = np.cumsum(count) - count
    nodes = np.repeat(first - start, count) + np.arange(int(count.sum()))
    dofs = model.dof_of_node[nodes]
    place, speed = model.reference[nodes] + x[dofs], v[dofs]

    def totals(of_nodes: FloatArray) -> FloatArray:
        return np.add.reduceat(of_nodes, start, axis=0)

    place, speed = (a - np.repeat(totals(a) / count[:, None], count, axis=0) for a in (place, speed))
    if model.dimension == 2:
        spin = totals(place[:, 0] * speed[:, 1] - place[:, 1] * speed[:, 0])
        return np.abs(spin) / np.maximum(totals(np.sum(place * place, axis=1)), 1e-300)
    square = totals(place[:, :, None] * place[:, None, :])
    inertia = np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(3) - square
    omega = np.linalg.pinv(inertia, hermitian=True) @ totals(np.cross(place, speed))[:, :, None]
    return np.linalg.norm(omega[:, :, 0], axis=1)


def _even(points: FloatArray, facets: IntArray, body: IntArray) -> BoolArray:
    """Which facets (nf,), of points (n, d) [m] and bodies (nf,), are of bodies where facets that meet are of about one size, see `EVEN`."""
    if points.shape[1] == 2:
        size = np.linalg.norm(points[facets[:, 1]] - points[facets[:, 0]], axis=1)
        facet, meets = np.repeat(np.arange(len(facets)), 2), facets.ravel()
    else:
        first, second, third, last = points[np.where(facets < 0, facets[:, 2:3], facets)].transpose(1, 0, 2)
        size = np.linalg.norm(np.cross(third - first, last - second), axis=1)
        after = np.roll(facets, -1, axis=1)
        after = np.where(after < 0, facets[:, :1], after)
        facet = np.nonzero(facets >= 0)[0]
        ends = np.sort(np.column_stack([facets[facets >= 0], after[facets >= 0]]), axis=1)
        meets = ends @ np.array([len(points), 1])
    order = np.argsort(meets, kind="stable")
    pairs = np.flatnonzero(meets[order][1:] == meets[order][:-1])
    one, other = facet[order[pairs]], facet[order[pairs + 1]]
    unlike = np.abs(np.log(size[one] / size[other])) > EVEN
    number = int(body.max(initial=-1)) + 1
    even = 2 * np.bincount(body[one], unlike, number) < np.bincount(body[one], minlength=number)
    return np.asarray(even[body], dtype=np.bool_)
