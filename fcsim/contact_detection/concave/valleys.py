"""Points in the valleys of a concave surface: held by all the facets that meet there, each along its own normal.

A point near the edge at which two facets make a valley lies outside of the body where it lies above both of their planes,

    g_1 = (p - x_1) . N_1 >= 0   and   g_2 = (p - x_2) . N_2 >= 0,

two conditions that are each as smooth as a facet, where the nearest facet's alone jumps at the edge. A point that comes to rest in the
valley needs both reactions: with one contact a Newton iteration finds it on one facet and on the other in turns. In space a point in the
corner of three facets has three. Reactions of points that one facet holds are the same with the others beside it, whose gaps are open.
Where more contacts hold a point than it has directions their reactions are not unique, their sum is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.node_to_segment import VALLEY, Configuration, Feet, NodeToSegment
from fcsim.contact_detection.surfaces.projection import project_on_facets
from fcsim.contact_detection.surfaces.surface import OPPOSING

BESIDE = 0.25
"""Of the facets' size: how far beside a facet a point may stand to be held by it, too. Beyond the edge of a valley the plane of the other
facet lies inside the body, so that its gap is open and its contact carries nothing there."""

_LEVEL = 1e-6
"""Facets that make a smaller angle [rad] lie in one plane."""


@dataclass(frozen=True, eq=False)
class InValleys:
    """A node-to-segment rule with facets' own normals, whose points have a contact for each facet of a valley that they are in: up to
    `VALLEY`, numbered in the order of the facets."""

    rule: NodeToSegment

    def at(self, x: FloatArray) -> tuple[Contacts, IntArray]:
        """Contacts at positions x (n_nodes, d) [m], and their pairs."""
        rule, now = self.rule, self.rule.configuration(x)
        candidate, facet = rule.search(now)
        nearest = rule.feet(now, candidate, facet)
        others = _beside(rule, now, nearest, candidate, facet)
        if not len(others.candidate):
            return rule.of_feet(nearest)
        held = np.isin(rule.number(nearest), rule.number(others))
        feet = Feet._make(np.concatenate(both) for both in zip(nearest.take(~held), others, strict=True))
        return rule.of_feet(feet.take(np.lexsort((feet.facet, rule.number(feet)))))


def _beside(rule: NodeToSegment, now: Configuration, nearest: Feet, candidate: IntArray, facet: IntArray) -> Feet:
    """The feet of points in valleys, along facets' own normals: those on the nearest foot's facet and on facets that make a valley with it,
    of all possible pairs (candidate, facet). Nothing of points that have fewer than two."""
    candidate, facet = rule.plausible(now, candidate, facet)
    triangle = rule.masters.nodes[facet, -1] < 0
    weights, normal, _ = project_on_facets(now.point[candidate], now.master.corners[facet], triangle)
    feet = rule.at_weights(now, candidate, facet, weights, normal)
    aside = np.linalg.norm(now.point[feet.candidate] - feet.point - feet.gap[:, None] * feet.normal, axis=1)
    keep = (aside <= BESIDE * feet.scale) & (np.einsum("nd,nd->n", now.outward[candidate], normal) < OPPOSING)
    feet = feet.take(keep & rule.within(feet))
    number, known = rule.number(feet), rule.number(nearest)  # ascending
    place = np.searchsorted(known, number).clip(max=len(known) - 1)
    if not len(known):
        return feet.take(np.zeros(0, dtype=np.int64))
    own = nearest.facet[place]
    chosen = np.flatnonzero((known[place] == number) & ((own == feet.facet) | _make_a_valley(rule, now, own, feet.facet)))
    order = np.lexsort((np.abs(feet.gap[chosen]), feet.facet[chosen] != own[chosen], number[chosen]))
    chosen = chosen[order]
    number, first, count = np.unique(number[chosen], return_index=True, return_counts=True)
    rank = np.arange(len(chosen)) - np.repeat(first, count)
    # the nearest facet itself may be too far aside, above a convex edge beside the valley
    begins = np.repeat(feet.facet[chosen][first] == nearest.facet[np.searchsorted(known, number)], count)
    return feet.take(chosen[begins & np.repeat(count > 1, count) & (rank < VALLEY)])


def _make_a_valley(rule: NodeToSegment, now: Configuration, one: IntArray, other: IntArray) -> np.ndarray:
    """Whether the facets one, other (n,) share an edge (2D: an end) and each rises above the other's plane."""
    vertex, master = rule.topology.vertex, now.master
    real = rule.masters.nodes >= 0
    a, b = vertex[one][:, :, None], vertex[other][:, None, :]
    shared = ((a == b) & real[one][:, :, None] & real[other][:, None, :]).sum(axis=(1, 2))
    arm = master.centre[other] - master.centre[one]
    least = _LEVEL * np.linalg.norm(arm, axis=1)
    rises = (np.einsum("nd,nd->n", arm, master.normal[one]) > least) & (np.einsum("nd,nd->n", -arm, master.normal[other]) > least)
    return rises & (shared == rule.masters.width - 1 if rule.masters.width == 2 else shared == 2)
