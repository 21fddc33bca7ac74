"""What goes through another body on the way that an answer takes.

Contacts are looked for along the way that bodies would go without them, and again where the answer leads. An impact may turn what is
slender by a radian within a step: it is on the other side of a wall then, where it has no contact, by a way that nobody has looked at. So
the answer's own way, on which bodies turn, is followed in parts that are short beside them, by the depths that the witness measures: those
know nothing of contacts. A step on which bodies go through each other was too long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection import Everything, ExactContacts, innermost
from fcsim.contact_law.coulomb import Velocity
from fcsim.contact_law.law import Implicit
from fcsim.timestep.encounter import Encounter
from fcsim.timestep.scheme import StepSetup
from fcsim.timestep.state import State
from fcsim.witness._overlap_kernels import meeting_boxes
from fcsim.witness.folding import NONE
from fcsim.witness.overlap import PairOverlaps, measure, measured
from fcsim.witness.skin import Skins

DEEP = 0.1
"""Of the smaller body's extent: bodies that are deeper in each other than where the way begins, by so much, go through each other."""

BETWEEN = 0.25
"""Of the smaller body's extent: how far two bodies move on each other between two looks."""

MOST = 400
"""Looks at one way: of a longer one it is `BETWEEN` that grows."""


@dataclass(frozen=True)
class Passed:
    """Two bodies by their numbers that lie depth [m], a share of the smaller one's extent, in each other on the way of a step."""

    bodies: tuple[int, int]
    depth: float
    share: float

    def said(self, model: Model, when: str, h: float) -> str:
        """The message of a run that ends there."""
        one, other = (model.bodies[k].name for k in self.bodies)
        return (
            f"{when}: {one!r} and {other!r} go through each other within {h:.3g} s: on the way they lie {self.depth:.3g} m in each other, "
            f"{100 * self.share:.3g} % of the smaller one's extent. Their contacts are not found where bodies turn or part by so much in "
            "a step: choose a shorter h, or more cuttings"
        )


def passed(setup: StepSetup, met: Encounter, v: FloatArray, state: State, skins_of_bodies: Callable[[], Skins | None]) -> Passed | None:
    """The two bodies that go through each other as the velocities v (n_dofs,) lead the bodies from where the contacts of `met` were found
    to where the next ones are; None where there are none, in statics, and of laws that let bodies overlap; state: of the step's beginning.
    skins_of_bodies: asked where something moves so far.
    """
    model, scheme = setup.model, setup.scheme
    law, answers = scheme.law, isinstance(innermost(setup.detection), Everything | ExactContacts)
    if not answers or not scheme.timing.moving or isinstance(law, Velocity | Implicit):
        return None
    begin, step = scheme.detection_configuration(model, state), scheme.timing.length_per_u * v
    moved = model.node_velocity(step, begin)
    if np.ptp(moved, axis=0).max(initial=0.0) <= DEEP * setup.proportions.size.min(initial=np.inf):
        return None
    if (len(met.contacts) and not met.keeps_apart(law)) or (skins := skins_of_bodies()) is None:
        return None
    pairs, looks = _near(model, skins, model.positions(begin), model.positions(model.advance(begin, step)), moved)
    if not len(pairs):
        return None
    seen = _of_bodies(skins, np.unique(pairs))
    borne = _depths(seen, pairs, model.positions(begin), 0.0)
    for look in range(1, looks + 1):
        depth = _depths(seen, pairs, model.positions(model.advance(begin, look / looks * step)), DEEP) - borne
        share = depth / skins.size[pairs].min(axis=1)
        worst = int(np.argmax(share))
        if share[worst] > DEEP:
            one, other = (int(k) for k in pairs[worst])
            return Passed((one, other), float(depth[worst]), float(share[worst]))
    return None


def _near(model: Model, skins: Skins, begin: FloatArray, end: FloatArray, moved: FloatArray) -> tuple[IntArray, int]:
    """The pairs of bodies (n, 2) that may go through each other, and at how many places of their way they are looked at.

    begin, end (n_nodes, d) [m]: the ends of the way; moved (n_nodes, d) [m]: along the arcs on which bodies turn.
    """
    low, high, mean, turn = _swept(model, skins, begin, end, moved)
    bodies = np.flatnonzero(np.isfinite(low).all(axis=1))
    axes = np.argsort(-np.std(np.clip(low[bodies], begin.min(axis=0), begin.max(axis=0)), axis=0), kind="stable")
    low, high = np.ascontiguousarray(low[:, axes]), np.ascontiguousarray(high[:, axes])
    order = bodies[np.argsort(low[bodies, 0], kind="stable")]
    first, second = meeting_boxes(order, low, high, model.dimension)
    motion = np.linalg.norm(mean[first] - mean[second], axis=1) + turn[first] + turn[second]
    size = np.minimum(skins.size[first], skins.size[second])
    far = (motion > 2.0 * DEEP * size) & (skins.movable[first] | skins.movable[second]) & measured(skins, first, second)
    looks = np.ceil((motion[far] / (BETWEEN * size[far])).max(initial=1.0))
    return np.stack([first, second], axis=1)[far], int(min(looks, MOST))


def _swept(
    model: Model, skins: Skins, begin: FloatArray, end: FloatArray, moved: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Of each body the box (nbodies, d) [m], low and high, that it sweeps, no number without a skin; its nodes' mean motion (nbodies, d)
    [m]; and how far any of its points goes beside that (nbodies,) [m]."""
    count = np.diff(model.node_offset)
    some, first = np.flatnonzero(count), model.node_offset[:-1][count > 0]
    low, high = np.full((2, len(count), model.dimension), np.nan)
    mean, turn = np.zeros((len(count), model.dimension)), np.zeros(len(count))
    mean[some] = np.add.reduceat(moved, first, axis=0) / count[some, None]
    beside = moved - np.repeat(mean[some], count[some], axis=0)
    turn[some] = np.sqrt(np.maximum.reduceat(np.einsum("nd,nd->n", beside, beside), first))
    low[some] = np.minimum.reduceat(np.minimum(begin, end), first, axis=0)
    high[some] = np.maximum.reduceat(np.maximum(begin, end), first, axis=0)
    exact = skins.exact
    reach = exact.radius + exact.half
    reach[exact.of("plane")] = np.inf
    round_ = exact.body[exact.of("sphere")]
    turn[exact.body] *= np.where(np.isfinite(reach), reach / exact.arm, 0.0)
    turn[round_] = 0.0
    low[exact.body] = np.minimum(begin[exact.first], end[exact.first]) - reach[:, None]
    high[exact.body] = np.maximum(begin[exact.first], end[exact.first]) + reach[:, None]
    low, high = low - 0.5 * turn[:, None], high + 0.5 * turn[:, None]  # an arc of the length l is within l / 2 of its chord
    low[~skins.closed], high[~skins.closed] = np.nan, np.nan
    return np.clip(low, -1e300, 1e300), np.clip(high, -1e300, 1e300), mean, turn


def _of_bodies(skins: Skins, bodies: IntArray) -> Skins:
    """The skins of some bodies (n,), which do not look at themselves."""
    exact, roots = skins.exact, np.full(len(skins.roots), -1)
    roots[bodies] = skins.roots[bodies]
    chosen = np.flatnonzero(np.isin(exact.body, bodies))
    rows = (exact.first[chosen], exact.radius[chosen], exact.half[chosen], exact.axis[chosen], exact.arm[chosen])
    own = type(exact)(exact.body[chosen], tuple(exact.kind[k] for k in chosen), *rows)
    return skins._replace(roots=roots, exact=own, folding=NONE)


def _depths(skins: Skins, pairs: IntArray, positions: FloatArray, least: float) -> FloatArray:
    """How deep the pairs of bodies (n, 2) lie in each other at positions (n_nodes, d) [m], where that is more than `least` of the smaller
    one's extent, else 0: (n,) [m]."""
    found: PairOverlaps = measure(skins, positions, least)
    count, depth = len(skins.roots), np.zeros(len(pairs))
    if not len(found.depth):
        return depth
    known, number = np.unique(np.sort(found.bodies, axis=1) @ [count, 1], return_inverse=True)
    deepest = np.zeros(len(known))
    np.maximum.at(deepest, number.ravel(), found.depth)
    sought = np.sort(pairs, axis=1) @ [count, 1]
    place = np.minimum(np.searchsorted(known, sought), len(known) - 1)
    return np.where(known[place] == sought, deepest[place], 0.0)
