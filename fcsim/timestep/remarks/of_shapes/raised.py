"""What is said of bodies that fit each other, of cells of second order whose middle nodes lie on the chords of evident curves."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.surfaces.model_surfaces import bulges_of_all_chords
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.contact_detection.sweep import brought_back
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Body
from fcsim.timestep.remarks.coarse import looked_at
from fcsim.timestep.remarks.of_shapes.chords import NAMED
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.look_ahead.lengths import BORNE

_STRAIGHT = 0.1
"""Of what a curve is over the middle of its chord: a node as near to the chord is on it."""


class Raised:
    """The remark on the first two bodies that fit each other, a hollow of one around the other, of cells of second order whose middle
    nodes lie on the chords of evident curves, where that puts the gaps wrong by more than `NAMED` of how far the contacts deform bodies
    (twice the elastic energy over the forces), or where nothing bears that would overlap on the curves. Steps 1,
    4, 16, ... and the last are looked at.

    Detection takes all nodes for places of the surface: what is flat on either side of each edge is a polygon to it, where the same facets
    of first order are chords of a curve.
    """

    def __init__(self, steps: int) -> None:
        self._steps = steps
        self._over: tuple[FloatArray, FloatArray] | None = None

    def __call__(self, step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark, {} where there is none."""
        model, contacts = step.model, step.contacts
        if "raised" in said or not model.deformable or not (looked_at(step.number) or step.number == self._steps):
            return {}
        if self._over is None:
            self._over = over_chords(model)
        height, bent = self._over
        if not height.any() or not len(contacts):
            return {}
        weights = np.where(contacts.nodes < 0, 0.0, contacts.weights)
        one, other = ((np.maximum(side, 0.0) * bent[contacts.nodes]).sum(axis=1) for side in (weights, -weights))
        wrong = (np.abs(weights) * height[contacts.nodes]).sum(axis=1)
        force, gap = step.contact_force[:, 0], brought_back(contacts, model.positions(step.state.x)).gap
        motion = 2.0 * step.energy.elastic / max(float(np.abs(force).sum()), 1e-300)
        bodies, least = np.sort(contacts.bodies, axis=1), BORNE * step.encounter.meeting.proportions.size
        for pair in np.unique(bodies[one * other < 0], axis=0):
            names = [model.bodies[int(k)].name for k in pair]
            between, smaller = (one * other < 0) & (bodies == pair).all(axis=1), float(least[pair].min())
            over = (wrong - gap)[between]
            if (force[between] > 0).any():
                error = float(np.abs(wrong[between][(force[between] > 0) | (over > 0)]).mean())
                if error > max(NAMED * motion, smaller):
                    return {"raised": _said(when, names, error, f"beside {motion:.2g} m by which contact deforms them")}
            elif not (force[between] != 0).any() and over.mean() + over.std() > smaller:  # as far as such heights agree
                error = float(np.abs(wrong[between]).mean())
                return {"raised": _said(when, names, error, "so that nothing bears, where the curves overlap or may")}
        return {}


def _said(when: str, names: list[str], error: float, beside: str) -> str:
    return (
        f"{when}: {names[0]!r} and {names[1]!r} fit each other along curved surfaces, and middle nodes of their cells of second order lie "
        f"on the chords of these, which puts the gaps wrong by {error:.2g} m, {beside}: where "
        "and how hard they bear is that of polygons. What helps: a mesh made of second order by the mesher (gmsh: Mesh.ElementOrder = 2), "
        "whose middle nodes are on the curves, smaller facets where these meet at more than 23 degrees, else cells of first order "
        "(docs/elements.md)"
    )


def over_chords(model: Model) -> tuple[FloatArray, FloatArray]:
    """How high [m] (n_nodes,) an evident curve is over the middle nodes of facets of second order that lie on its chords, < 0 in hollows, 0
    elsewhere; and how (n_nodes,) the surface is bent: 1 where it is round, -1 where it is hollow, 0 where it is flat, or
    nothing is of second order."""
    height, bent = np.zeros(model.n_nodes), np.zeros(model.n_nodes)
    if not any(isinstance(body, Body) and CELL_TYPES[body.part.cell_type].order == 2 for body in model.bodies):
        return height, bent  # what is bent does not matter
    for number, (body, first) in enumerate(zip(model.bodies, model.node_offset, strict=False)):
        if not isinstance(body, Body):
            if body.shape is not None:
                bent[first : model.node_offset[number] + len(body.points)] = 1.0
            continue
        cell = CELL_TYPES[body.part.cell_type]
        k = CELL_TYPES[cell.facet_type].corners if model.dimension == 3 else 2
        facets = np.concatenate([np.asarray(f) for f in body.part.surfaces.values()] or [np.empty((0, k), dtype=np.int64)]) + first
        facets = facets[np.unique(np.sort(facets, axis=1), axis=0, return_index=True)[1]]
        _look(model, number, facets, k, height, bent)
    return height, bent


def _look(model: Model, number: int, facets: IntArray, k: int, height: FloatArray, bent: FloatArray) -> None:
    """Enter what the facets (nf, kf) of a body, the first k of whose nodes are corners, say of their nodes."""
    bulge = bulges_of_all_chords(model, ContactSurface(facets[:, :k], np.full(len(facets), number)))
    if bulge is None:
        return
    for corner in range(k):
        bent[facets[:, corner]] += np.sign(bulge[:, corner].sum(axis=1))
    for place in range(k, facets.shape[1]):
        side = [place - k, (place - k + 1) % k] if place < k + (k if k > 2 else 1) else list(range(k))
        over = bulge[:, side][:, :, side].mean(axis=(1, 2))
        off = np.linalg.norm(model.reference[facets[:, place]] - model.reference[facets[:, side]].mean(axis=1), axis=1)
        bent[facets[:, place]] += np.sign(over)
        height[facets[:, place]] = np.where(off <= _STRAIGHT * np.abs(over), over, 0.0)
    np.sign(bent, out=bent)
