"""What is said of spheres that press deformable bodies whose facets are too few within the contact to tell how stiff it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection import Detection, ExactContacts
from fcsim.contact_detection.detection import innermost
from fcsim.contact_detection.exact.mesh_skin import MeshSkin, normals
from fcsim.contact_detection.exact.solids import Placed, placed
from fcsim.timestep.remarks.dented import FACING
from fcsim.timestep.step import Step

FEWEST = 2.0
"""Facets in the radius of the contact: from as many on a sphere has Hertz' force on linear bodies within some per cent."""
_LOOKED = 4  # pairs in a step, those that are pressed most


class Pressed(NamedTuple):
    """The most that a pair of bodies was pressed: force [N], radius of the contact and length of a facet [m], when."""

    force: float
    radius: float
    facet: float
    when: str


class FewFacets:
    """The remark on the first sphere that pressed a deformable body most with fewer than `FEWEST` facets in the radius of the contact.

    The radius is that of the outermost contact that bears, by the angle between its normal and that of the body's surface below the sphere,
    undeformed, or, where a body has turned, the direction of the resultant: so that halves and quarters of a contact between planes of
    symmetry are measured from their axis. A facet is as long as the side of a square made of two triangles of the skin. One contact
    alone, a first touch, says nothing. What grows is small at first: the step in which a pair's force is largest is told of, in the
    last one.
    """

    def __init__(self, detection: Detection, steps: int) -> None:
        self._steps, within = steps, innermost(detection)
        self._detection = within if isinstance(within, ExactContacts) and _dents(within) else None
        self._most: dict[tuple[int, int], Pressed] = {}

    def __call__(self, step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark, {} where there is none."""
        if self._detection is None or self._detection.skin is None or "few facets" in said:
            return {}
        self._look(step, self._detection, self._detection.skin, when)
        if step.number != self._steps:
            return {}
        for (ball, body), most in self._most.items():
            if most.radius < FEWEST * most.facet:
                one, other = (step.model.bodies[k].name for k in (ball, body))
                few = f"within {most.radius:.2g} m around, which is {most.radius / most.facet:.2g} of its facets of {most.facet:.2g} m"
                return {
                    "few facets": f"{most.when}: {one!r} touches {other!r} {few}: too few to tell how stiff the contact is. With one "
                    "the force was off by up to 27 %, with two by 3 %. What helps: facets there of a third of that (docs/contact_rules.md)"
                }
        return {}

    def _look(self, step: Step, detection: ExactContacts, skin: MeshSkin, when: str) -> None:
        """Keep the pairs that are pressed more than before."""
        contacts, solids, force = step.contacts, detection.solids, step.contact_force[:, 0]
        number = np.full(len(step.model.bodies), -1)
        spheres = solids.of("sphere")
        number[solids.body[spheres]] = spheres
        soft = np.zeros(len(number), dtype=bool)
        soft[skin.body[skin.deforms]] = True
        ball, body = contacts.bodies.T
        those = np.flatnonzero((number[ball] >= 0) & soft[body] & (force > 0))
        if not len(those):
            return
        pair = ball[those] * len(number) + body[those]
        keys, of = np.unique(pair, return_inverse=True)
        total, count = np.bincount(of, force[those]), np.bincount(of)
        x, now = step.model.positions(step.state.x), None
        for k in np.argsort(np.where(count > 1, -total, 0.0), kind="stable")[: min(_LOOKED, np.count_nonzero(count > 1))]:
            one, other = divmod(int(keys[k]), len(number))
            if (one, other) in self._most and total[k] <= self._most[one, other].force:
                continue
            now = placed(solids, x) if now is None else now
            radius, facet = _extent(step, skin, those[of == k], now, int(number[one]), x)
            if facet > 0:
                self._most[one, other] = Pressed(float(total[k]), radius, facet, when)


def _dents(detection: ExactContacts) -> bool:
    """Whether a sphere may dent a body. Disks of 2D are left out, whose force says less of the contact than of the depth of the body: with
    one facet in the half width it is within 6 %, and what has more than one contact has about that."""
    soft = detection.skin is not None and bool(detection.skin.deforms.any())
    return soft and detection.model.dimension == 3 and len(detection.solids.of("sphere")) > 0


def _extent(step: Step, skin: MeshSkin, those: IntArray, now: Placed, solid: int, x: FloatArray) -> tuple[float, float]:
    """Radius of the contact of a solid with a body by `those` contacts, and the length of a facet there [m]; 0 where none is below."""
    contacts = step.contacts
    away = contacts.frame[those, 0]
    weight = step.contact_force[those, 0]
    nodes = contacts.nodes[those][(contacts.nodes[those] >= 0) & (contacts.weights[those] < 0)]
    near = np.isin(skin.facets, nodes).any(axis=1) & (skin.body == contacts.bodies[those[0], 1])
    part = skin._replace(facets=skin.facets[near])
    resultant = weight @ away
    resultant = resultant / np.linalg.norm(resultant)
    facing = normals(part, x) @ resultant > FACING
    if not facing.any():
        return 0.0, 0.0
    size = _areas(x[part.facets[facing]])
    facet = float(np.sqrt(2.0 * size.mean()))
    below = size @ normals(part, step.model.reference)[facing]
    below = below / max(float(np.linalg.norm(below)), 1e-300)
    spread = float((away @ resultant).min())
    axes = [resultant, below] if below @ resultant >= 2.0 * spread**2 - 1.0 else [resultant]  # within twice the angle
    cosine = min(float((away @ axis).min()) for axis in axes)
    radius = float(now.solids.radius[solid]) * float(np.sqrt(max(1.0 - cosine**2, 0.0)))
    return radius, facet


def _areas(corners: FloatArray) -> FloatArray:
    """Areas (n,) of triangles [m^2] from their corners (n, 3, 3)."""
    return np.asarray(0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1))
