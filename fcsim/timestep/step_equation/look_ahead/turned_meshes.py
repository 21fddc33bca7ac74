"""Meshes that statics turn, on each other or together: they have the contacts of a load step's end.

The contacts of a step's beginning open by R (1 - cos(angle)) as bodies turn on each other, beside which interferences are small, and press
along normals that bodies which turn together have left behind.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.contact_detection.contacts import Contacts
from fcsim.contact_detection.sweep import brought_back
from fcsim.timestep.encounter import Encounter
from fcsim.timestep.state import State
from fcsim.timestep.step_equation.look_ahead.lengths import BENT, BORNE, SLID, TURNED, of_pairs, places, turns, ways

OF_FITS = 0.1
"""Of `SLID`, and its square of `BENT`, between meshes: interferences of what fits are that small, and turning opens with its square."""

_LOST = 0.01
"""Of how far contact deforms bodies: what turning opens by less is left to the step."""

_TILTED = 2e-3
"""[rad] What turns together by less keeps its normals: a force of the sine of that across them."""

_ALIKE = 0.5
"""Of the larger turn: two bodies that turn by turns which differ by less turn together."""


def turned_meshes(model: Model, met: Encounter, there: Contacts, ends: tuple[State, State], reactions: FloatArray | None) -> IntArray:
    """The pairs of bodies (n, 2), one at least deformable, whose meshes turn on each other from the first to the second of the states
    `ends`, where contacts `there` are, so that those of the beginning open by R (1 - cos(angle)): a ring that turns in its casing would
    lose its pressure. What that takes is beside twice the elastic energy over the sum of the `reactions` (m,), which is how far contact
    has deformed the bodies. They have the contacts of the end then, which last and turn by less than `TURNED`; joints with stiffness or
    adhesion do not.
    """
    held, nothing = met.meeting.contacts, np.empty((0, 2), dtype=np.int64)
    remembers = met.compliance is not None or met.terms.adhesion is not None
    if remembers or reactions is None or not len(held) or not len(there) or not model.deformable:
        return nothing
    end = model.positions(ends[1].x)
    size, meant, moved = met.meeting.proportions.size_at(held), brought_back(held, end).gap, end - met.meeting.positions
    place, known = places(there.identity, held.identity)
    place = np.where(known, place, 0)
    lasts = known & (np.einsum("ad,ad->a", there.frame[place, 0], held.frame[:, 0]) > np.cos(TURNED))
    bears = lasts & ((meant < BORNE * size) | (there.gap[place] < -BORNE * size))  # what has opened may bear by those of the end
    off = np.abs(there.gap[place] - meant)
    along, slid = ways(held, moved)
    by_turning = _turned(model, ends, moved)[held.bodies].max(axis=1) > 0.5 * slid
    elastic = held.bodies.min(axis=1) < len(model.deformable)
    wrong = (
        bears & by_turning & elastic & (slid > np.maximum(OF_FITS * SLID * size, along)) & (off > OF_FITS**2 * BENT * size) & ~held.cables
    )
    if wrong.any():
        last = model.elastic.at(ends[1].x)
        force = float(met.forces(reactions)[:, 0].sum())
        motion = 2.0 * model.elastic.energies(last, last)[0][1] / force if force > 0 else 0.0
        wrong &= off > _LOST * motion
    tilted = np.einsum("ad,ad->a", there.frame[place, 0], held.frame[:, 0]) < np.cos(_TILTED)
    tilted = np.flatnonzero(bears & elastic & tilted & ~held.cables)
    wrong[tilted[turn_together(model, ends, held.bodies[tilted])]] = True
    return np.unique(np.sort(held.bodies[wrong], axis=1), axis=0)


def turn_together(model: Model, ends: tuple[State, State], pairs: IntArray) -> BoolArray:
    """Which pairs of bodies (n, 2) turn by the same turn, but for `_ALIKE`, from the first to the second of the states."""
    if not len(pairs):
        return np.zeros(0, dtype=bool)
    turn = rotations(model, ends)
    one, other = (turn[side] for side in pairs.T)
    most = np.maximum(*(np.linalg.norm(each - np.eye(model.dimension), axis=(1, 2)) for each in (one, other)))
    return np.asarray((most > 0.5 * _TILTED) & (np.linalg.norm(one - other, axis=(1, 2)) < _ALIKE * most))


def not_slid_by_turning(model: Model, met: Encounter, ends: tuple[State, State]) -> Encounter:
    """The encounter whose law does not take for slip what turning does to bodies that turn together: of its pairs `turned`.

    Two places that are X = sum_k c_k x_k apart at the beginning of the step are Q X apart where both have turned by Q: along tangents T of
    the end T . (Q - I) X of H^T v is no slip, which w_T takes off. Q is that of the master.
    """
    contacts = met.contacts
    rows = np.flatnonzero(of_pairs(contacts, met.turned))
    rows = rows[turn_together(model, ends, contacts.bodies[rows])]
    if not len(rows):
        return met
    weights = np.where(contacts.nodes[rows] < 0, 0.0, contacts.weights[rows])
    apart = np.einsum("ak,akd->ad", weights, met.meeting.positions[contacts.nodes[rows]])
    turned = np.einsum("aij,aj->ai", rotations(model, ends)[contacts.bodies[rows, 1]], apart) - apart
    slid = np.einsum("aid,ad->ai", contacts.frame[rows, 1:], turned) / met.meeting.timing.length_per_u
    w, scale = met.terms.w.copy(), met.terms.scale
    w[rows, 1:] -= slid if scale is None else scale[rows, 1:] * slid
    return replace(met, terms=replace(met.terms, w=w))


def rotations(model: Model, ends: tuple[State, State]) -> FloatArray:
    """By what bodies turn (nbodies, d, d) from the first to the second of the states: those of small rotations not at all."""
    before, after = (
        np.concatenate([model.elastic.rotation(model.elastic.at(x)), model.rigid_rotation(x)]) for x in (end.x for end in ends)
    )
    return np.asarray(after @ before.transpose(0, 2, 1))


def _turned(model: Model, ends: tuple[State, State], moved: FloatArray) -> FloatArray:
    """How far (nbodies,) [m] turning moves a node of each body beside its mean, of motions (n_nodes, d) between two states: of deformable
    bodies what their frames turn by, not how they bend, of those of small rotations nothing."""
    turned, count = turns(model, moved), len(model.deformable)
    before, after = (model.elastic.rotation(model.elastic.at(state.x)) for state in ends)
    chord = np.linalg.norm(after - before, axis=(1, 2)) / np.sqrt(2.0)  # 2 sin(angle / 2)
    turned[:count] = np.minimum(turned[:count], chord * turns(model, model.positions(ends[0].x))[:count])
    return turned


def turned_arms(model: Model, state: State, met: Encounter, after: State, pairs: IntArray) -> FloatArray:
    """(n_dofs,) the configuration of the lever arms with that of the end for rigid bodies of the pairs (n, 2): a force along a normal of
    the end would turn a wheel, did it act where the wheel had the point at the beginning. Deformable ones are in balance at the end."""
    arms = (state.x if met.arms is None else met.arms).copy()
    rigid = np.unique(pairs) - len(model.deformable)
    rigid = rigid[rigid >= 0]
    model.rigid_part(arms)[rigid] = model.rigid_part(after.x)[rigid]
    return arms


def turned_too_far(met: Encounter, there: Contacts, end: FloatArray) -> bool:
    """Whether a load step that ended with contacts `met` at positions `end` (n_nodes, d) [m] has let meshes overlap that its law holds
    apart, since they have turned by more than `TURNED`: what is `there` is that deep by normals that the step knows nothing of."""
    held = met.meeting.contacts
    if met.compliance is not None or not len(held) or not len(there):
        return False
    place, known = places(there.identity, held.identity)
    place = np.where(known, place, 0)
    turned = known & (np.einsum("ad,ad->a", there.frame[place, 0], held.frame[:, 0]) < np.cos(TURNED)) & ~held.cables
    least = BORNE * met.meeting.proportions.size_at(held)
    turned &= there.gap[place] < -least
    return bool(turned.any()) and bool((turned & (brought_back(held, end).gap > -0.5 * least)).any())
