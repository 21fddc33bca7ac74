"""What is said of sharp edges that sink into the faces of deformable bodies between the places that hold them."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection import Detection, Everything
from fcsim.contact_detection.detection import innermost
from fcsim.contact_detection.general._foot_kernels import feet
from fcsim.contact_detection.skin.shape import shape_of
from fcsim.contact_detection.skin.skin import Shape, Skin
from fcsim.timestep.remarks.of_shapes.entered import SEEN, Deformed
from fcsim.timestep.step import Step

SUNK = 0.01
"""Of how far the bodies are deformed: edges that lie in a face by more, in the mean, are named. Bars across a block's cells, beside those
with vertices all along: 0.02 to 0.2 at 20 and 37 degrees, where they bear 7 to 26 % less; 0.001 to 0.005 at 5 degrees (0.4 to 1.2 %)."""
_PLACES = 16  # looked at along an edge


class SunkEdges:
    """The remark on the first sharp edge that bears on a deformable body's faces under `Everything` in space and lies in it between the
    outermost places that hold it, in the mean by more than `SUNK` of how far contact deforms the bodies (`Deformed`).

    Edges are held where they cross the edges within a face (`fcsim.contact_detection.general.face_edges`). Across the cells there are few
    such places, and a face gives way between them.
    """

    def __init__(self, detection: Detection, steps: int) -> None:
        within = innermost(detection)
        self._everything = within if isinstance(within, Everything) and len(within.faces.within) else None
        self._deformed = Deformed(steps)

    def __call__(self, step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark, {} where there is none."""
        if self._everything is None or "sunk edges" in said:
            return {}
        motion = self._deformed(step)
        if motion is None:
            return {}
        skin = self._everything.skin
        edge, body, first, last = _bearing(step, self._everything)
        if not len(edge):
            return {}
        shape = shape_of(skin, step.model.positions(step.state.x))
        depth = _depths(skin, shape, edge, body, np.linspace(first, last, _PLACES, axis=1))
        deepest = int(np.argmax(depth))
        own = skin.vertex_body[skin.edges[edge[deepest], 0]]
        if depth[deepest] <= max(SUNK * motion, SEEN * float(step.encounter.meeting.proportions.size[[own, body[deepest]]].min())):
            return {}
        one, other = (step.model.bodies[k].name for k in (own, body[deepest]))
        return {
            "sunk edges": f"{when}: a sharp edge of {one!r} lies {depth[deepest]:.2g} m deep in {other!r} between the places that hold it, "
            f"in the mean, beside {motion:.2g} m by which contact deforms the bodies: it bears too little. What helps: edges along the "
            f"cells of {other!r}, smaller ones, or vertices on the edge as near to each other (docs/contact_rules.md)"
        }


def _bearing(step: Step, everything: Everything) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Sharp edges (n,) that are pressed on edges within a face, the body (n,) with that, and between which shares first, last (n,) of the
    edge all places lie at which it is pressed on edges of that body."""
    skin, contacts = everything.skin, step.contacts
    number = contacts.identity - len(skin.node) * skin.n_sides
    presses = np.flatnonzero((number >= 0) & (number < len(skin.edges) ** 2) & (step.contact_force[:, 0] > 0))
    pair = np.stack(np.divmod(number[presses], len(skin.edges)), axis=1)
    inner = np.isin(pair, everything.faces.within)
    share = contacts.weights[presses][:, [1, 3]] * [1.0, -1.0]
    # both ways: an edge, that of the other body, and where on the first
    edge, other, place = (np.concatenate(both) for both in ((pair[:, 0], pair[:, 1]), (pair[:, 1], pair[:, 0]), (share[:, 0], share[:, 1])))
    within = np.concatenate([inner[:, 1], inner[:, 0]])
    key = edge * skin.n_bodies + skin.vertex_body[skin.edges[other, 0]]
    known, of = np.unique(key, return_inverse=True)
    first, last, over = np.ones(len(known)), np.zeros(len(known)), np.zeros(len(known), dtype=bool)
    np.minimum.at(first, of, place)
    np.maximum.at(last, of, place)
    np.logical_or.at(over, of, within)
    edges, bodies = np.divmod(known, skin.n_bodies)
    chosen = over & skin.sharp[edges] & (first < last)
    return edges[chosen], bodies[chosen], first[chosen], last[chosen]


def _depths(skin: Skin, shape: Shape, edge: IntArray, body: IntArray, places: FloatArray) -> FloatArray:
    """How deep [m] each edge (n,) lies in a body (n,), in the mean over its places (n, k): below the nearest facet, 0 outside."""
    ends = shape.point[skin.edges[edge]]
    points = ends[:, :1] + places[:, :, None] * (ends[:, 1] - ends[:, 0])[:, None]
    depth = np.zeros(places.shape)
    for row, of in enumerate(body):  # the few edges that bear so
        facets = np.arange(*skin.first_facet[of : of + 2])
        by = shape.size[facets].max()
        low, high = points[row].min(axis=0) - by, points[row].max(axis=0) + by
        facets = facets[((shape.low[facets] <= high) & (shape.high[facets] >= low)).all(axis=1)]
        vertex, facet = np.repeat(np.arange(_PLACES), len(facets)), np.tile(facets, _PLACES)
        point = np.concatenate([shape.point, points[row]])
        _, _, height, distance, _ = feet(len(shape.point) + vertex, facet, point, skin.facets, skin.sides, shape.normal)
        nearest = np.arange(_PLACES), np.argmin(distance.reshape(_PLACES, -1), axis=1)
        depth[row] = np.maximum(-height.reshape(_PLACES, -1)[nearest], 0.0)
    return depth.mean(axis=1)
