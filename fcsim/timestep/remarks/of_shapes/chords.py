"""What is said of bodies that fit each other, a shaft in its hub, whose facets lie farther apart than they are deformed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import BoolArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Detection, Detector, Everything, SurfacePair
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.detection import innermost, left_out
from fcsim.contact_detection.surfaces.model_surfaces import bulges_of_all_chords
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.timestep.remarks.coarse import looked_at
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.look_ahead.lengths import BORNE, places

_INTEGRAL = ("mortar", "mortar-faces", "segments")
NAMED = 0.05
"""Of how far the bodies are deformed: gaps that are wrong by more are named."""
_NODES = 2**31
"""More than a model has nodes."""
_AT = 0.99
"""Of a contact's weight on either side: with more on one node it is at that node."""


class Chords:
    """The remark on the first two bodies that fit each other, a hollow of one around the other, whose gaps are those of their facets and,
    by the curved surfaces that these stand for (`fcsim.mesh.curves.bulges`), wrong by more than `NAMED` of how far the
    contacts deform bodies, twice the elastic energy over the sum of their forces. Steps 1, 4, 16, ... and the last are looked at.

    The same rules with the surfaces smoothed over all edges of less than 45 degrees are the measure, evident curves or not: what they
    agree with is not named.
    """

    def __init__(self, detection: Detection, steps: int) -> None:
        self._detection, self._steps = innermost(detection), steps
        self._left_out = left_out(detection)
        self._smooth: tuple[Detection, BoolArray, BoolArray] | None = None
        self._asked = False

    def __call__(self, step: Step, when: str, said: frozenset[str]) -> dict[str, str]:
        """The remark, {} where there is none."""
        model = step.model
        if "chords" in said or not (looked_at(step.number) or step.number == self._steps):
            return {}
        if not self._asked:
            self._smooth, self._asked = _smooth(model, self._detection), True
        if self._smooth is None:
            return {}
        detection, hollow, round_ = self._smooth
        now = step.encounter.meeting.contacts
        pressed = _of(hollow, round_, now) & (step.contact_force[:, 0] > 0)
        there, here = (of(step.encounter.meeting.positions) for of in (detection, self._detection))  # not those of the load step's end
        there = there.take(~_between(there, self._left_out))
        fits = there.take(_of(hollow, round_, there) & ((there.gap <= 0) | np.isin(there.identity, now.identity[pressed])))
        at, known = _same_places(here, fits)
        own = np.append(here.gap, 0.0)[at]
        wrong = np.where(known, np.abs(fits.gap - own), np.maximum(-fits.gap, 0.0))  # what is not found is open
        force, least = float(step.contact_force[:, 0].sum()), BORNE * step.encounter.meeting.proportions.size
        motion = 2.0 * step.energy.elastic / force if force > 0 else 0.0
        for pair in np.unique(np.sort(fits.bodies, axis=1), axis=0):
            between = (np.sort(fits.bodies, axis=1) == pair).all(axis=1)
            error = float(wrong[between].mean())
            if error > max(NAMED * motion, float(least[pair].min())):
                one, other = (model.bodies[int(k)].name for k in pair)
                mend = (
                    "facets at less than 23 degrees to each other, or cells of second order that follow the curves"
                    if _too_coarse(self._detection, detection)
                    else 'normals="smooth" or candidates="mortar" of their pair, smooth=True of Everything, or facets at less than '
                    "23 degrees to each other"
                )
                return {
                    "chords": f"{when}: {one!r} and {other!r} fit each other along curved surfaces, and where they bear their facets are "
                    f"chords that put the gaps wrong by {error:.2g} m, beside {motion:.2g} m by which contact deforms them: where and how "
                    f"hard they bear is that of the chords. What helps: {mend} (docs/contact_rules.md)"
                }
        return {}


def _too_coarse(own: Detection, smooth: Detection) -> bool:
    """Whether smooth surfaces would be of no use: they are asked for, or facets that meet at more than 23 degrees are chords of none."""
    if isinstance(own, Everything):
        return own.smooth
    if not isinstance(own, Detector) or not isinstance(smooth, Detector):
        return False
    asked = all(pair.normals == "smooth" or pair.candidates in _INTEGRAL for pair in own.pairs)
    surfaces = [
        (one, other) for a, b in zip(own.pairs, smooth.pairs, strict=True) for one, other in ((a.slave, b.slave), (a.master, b.master))
    ]
    return asked or any(one.bulge is None and other.bulge is not None for one, other in surfaces)


def _same_places(known: Contacts, asked: Contacts) -> tuple[IntArray, BoolArray]:
    """Where (n,) among the contacts `known` those `asked` are, and which are there: by identity, or of the same two nodes, whichever of
    them is the vertex on the other's surface."""
    at, found = places(known.identity, asked.identity)
    if not len(known) or not len(asked):
        return at, found
    keys = [_two_nodes(contacts) for contacts in (known, asked)]
    order = np.argsort(keys[0], kind="stable")
    place = order[np.minimum(np.searchsorted(keys[0][order], keys[1]), len(order) - 1)]
    alike = ~found & (keys[1] >= 0) & (keys[0][place] == keys[1])
    return np.where(alike, place, at), found | alike


def _two_nodes(contacts: Contacts) -> IntArray:
    """One number (nc,) for the two nodes that a contact is at, -1 where it is at others."""
    weights = np.where(contacts.nodes < 0, 0.0, contacts.weights)
    rows, sides = np.arange(len(weights)), np.stack([weights.argmax(axis=1), weights.argmin(axis=1)], axis=1)
    pair = np.sort(contacts.nodes[rows[:, None], sides], axis=1)
    at_both = (np.abs(weights[rows[:, None], sides]) > _AT).all(axis=1)
    return np.where(at_both, pair[:, 0] * _NODES + pair[:, 1], -1)


def _between(contacts: Contacts, pairs: IntArray) -> BoolArray:
    """Which contacts (nc,) are of those pairs of bodies (n, 2), the lower number first."""
    return np.asarray((np.sort(contacts.bodies, axis=1)[:, None] == pairs).all(axis=2).any(axis=1))


def _of(hollow: BoolArray, round_: BoolArray, contacts: Contacts) -> BoolArray:
    """Which contacts (nc,) are those of a hollow place of one body with a round one of the other, by their nodes (n_nodes,)."""
    real = contacts.nodes >= 0
    sides = (real & (contacts.weights > 0), real & (contacts.weights < 0))
    inward, outward = ([(side & of[contacts.nodes]).any(axis=1) for side in sides] for of in (hollow, round_))
    return np.asarray(inward[0] & outward[1] | inward[1] & outward[0])


def _smooth(model: Model, detection: Detection) -> tuple[Detection, BoolArray, BoolArray] | None:
    """The same detection of smooth surfaces, and the nodes (n_nodes,) around which these are hollow, and round; None where no surface
    differs from its facets but where the detection knows it, or none is hollow."""
    if not model.deformable:
        return None
    other: Detection
    if isinstance(detection, Everything):
        other = detection.with_all_chords()
        if other.bulge is None or (detection.bulge is not None and np.array_equal(other.bulge, detection.bulge)):
            return None
        surfaces = [(other.skin.node[other.skin.facets], other.bulge)]
    elif isinstance(detection, Detector):
        pairs = [_smooth_pair(model, pair) for pair in detection.pairs]
        surfaces = [(s.facets, s.bulge) for pair in pairs for s in (pair.slave, pair.master) if s.bulge is not None]
        if not surfaces:
            return None
        other = Detector(pairs, model.n_nodes, detection.edge_tolerance, detection.penetration)
    else:
        return None
    hollow, round_ = (np.zeros(model.n_nodes, dtype=bool) for _ in range(2))
    for facets, bulge in surfaces:
        for marked, those in ((hollow, (bulge < 0).any(axis=(1, 2))), (round_, (bulge > 0).any(axis=(1, 2)))):
            marked[facets[those][facets[those] >= 0]] = True
    return (other, hollow, round_) if hollow.any() and round_.any() else None


def _smooth_pair(model: Model, pair: SurfacePair) -> SurfacePair:
    """The pair with surfaces that are curved over all edges of less than 45 degrees."""

    def of(surface: ContactSurface) -> ContactSurface:
        return replace(surface, bulge=bulges_of_all_chords(model, surface))

    integral = pair.candidates in _INTEGRAL
    return replace(pair, slave=of(pair.slave), master=of(pair.master), normals="facet" if integral else "smooth")
