"""What is said of two bodies with the same flat or round sides that are read as curves on one of them only."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Everything
from fcsim.contact_detection.surfaces.model_surfaces import bulges_of_surface
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Body
from fcsim.timestep.remarks.coarse import looked_at
from fcsim.timestep.remarks.of_shapes.chords import NAMED
from fcsim.timestep.step import Step

_THERE = 0.25
"""Of the height of a curve over its chord: what is as near to the ends and to the middle of the chord is on it."""
_BENT = 1e-6
"""Of a chord: a curve that is lower is flat."""


class OtherSides:
    """The remark on the first two bodies that meet, of which one has a side with a curve over it, where nodes of the other lie at its ends
    and in the middle of its chord in the reference configuration: sides of one cell are chords, of two they are flat (a prism of 16
    sides). Said where the curve is higher than `NAMED` of how far the contacts deform bodies, or nothing bears. Steps 1, 4, 16, ... are
    looked at."""

    def __init__(self, detection: Detection) -> None:
        self._chords = not isinstance(detection, Everything) or detection.smooth
        self._found: tuple[IntArray, FloatArray] | None = None

    def __call__(self, step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark, {} where there is none."""
        model, contacts = step.model, step.contacts
        if "other sides" in said or len(model.deformable) < 2 or not looked_at(step.number) or not len(contacts):
            return {}
        if self._found is None:
            self._found = _flat_beside_round(model, self._chords)
        pairs, heights = self._found
        force = step.contact_force[:, 0]
        motion = 2.0 * step.energy.elastic / max(float(np.abs(force).sum()), 1e-300)
        meeting = np.unique(contacts.bodies, axis=0)
        for (one, other), height in zip(pairs, heights, strict=True):
            if np.isin(meeting, (one, other)).all(axis=1).any() and (height > NAMED * motion or not (force > 0).any()):
                return {"other sides": _said(when, model.bodies[one].name, model.bodies[other].name, height)}
        return {}


def _said(when: str, curved: str, flat: str, height: float) -> str:
    return (
        f"{when}: {curved!r} and {flat!r} have the same sides, which are read as chords of a curve on {curved!r}, {height:.2g} m high over "
        f"them, and as flat on {flat!r}: where and how hard they bear is that of two different shapes. What helps: as many cells a side on "
        "both, two or more where sides are flat, smaller facets on both where they stand for a curve (docs/elements.md)"
    )


def _flat_beside_round(model: Model, chords: bool) -> tuple[IntArray, FloatArray]:
    """Pairs (n, 2) of bodies, the second with nodes on chords of curves of the first, and how high [m] (n,) the curves are."""
    bodies = [(k, body) for k, body in enumerate(model.bodies) if isinstance(body, Body)]
    facets = [_facets(model, k, body) for k, body in bodies]
    nodes = np.unique(np.concatenate([f[0].ravel() for f in facets]))
    x, owner = model.reference, np.searchsorted(model.node_offset, nodes, side="right") - 1
    near = KDTree(x[nodes])
    pairs: dict[tuple[int, int], float] = {}
    for (number, _), (of_body, k) in zip(bodies, facets, strict=True):
        ends, height = _curves(model, number, of_body, k, chords)
        reach = _THERE * height
        places = [x[ends[:, 0]], x[ends[:, 1]], x[ends].mean(axis=1)]
        found = [near.query_ball_point(place, reach) for place in places] if len(ends) else [[], [], []]
        for row, of_places in enumerate(zip(*found, strict=True)):  # the few edges of curves that nodes of others lie on
            there = set.intersection(*({int(owner[node]) for node in of_place} for of_place in of_places)) - {number}
            for other in there:
                pairs[number, other] = max(pairs.get((number, other), 0.0), float(height[row]))
    return np.array(list(pairs), dtype=np.int64).reshape(-1, 2), np.array(list(pairs.values()))


def _facets(model: Model, number: int, body: Body) -> tuple[IntArray, int]:
    """The facets (nf, kf) of a body's named surfaces, each once, and how many of their nodes are corners."""
    cell = CELL_TYPES[body.part.cell_type]
    k = CELL_TYPES[cell.facet_type].corners if model.dimension == 3 else 2
    named = [np.asarray(f) for f in body.part.surfaces.values()]
    facets = np.concatenate(named or [np.empty((0, k), dtype=np.int64)]) + model.node_offset[number]
    return facets[np.unique(np.sort(facets, axis=1), axis=0, return_index=True)[1]], k


def _curves(model: Model, number: int, facets: IntArray, k: int, chords: bool) -> tuple[IntArray, FloatArray]:
    """Ends (n, 2) of the edges of facets that curves are over, and how high [m] (n,): at middle nodes, or of the evident curves that facets
    of first order are chords of."""
    edges = k if k > 2 else 1
    side = np.stack([np.arange(edges), (np.arange(edges) + 1) % k], axis=1)
    ends, x = facets[:, side], model.reference
    if facets.shape[1] > k:
        height = np.linalg.norm(x[facets[:, k : k + edges]] - x[ends].mean(axis=2), axis=2)
    else:
        bulge = bulges_of_surface(model, ContactSurface(facets, np.full(len(facets), number))) if chords else None
        height = np.zeros(ends.shape[:2]) if bulge is None else 0.5 * np.abs(bulge[:, side[:, 0], side[:, 1]])
    curved = height > _BENT * np.linalg.norm(np.subtract(x[ends[:, :, 0]], x[ends[:, :, 1]]), axis=2)
    return ends[curved], height[curved]
