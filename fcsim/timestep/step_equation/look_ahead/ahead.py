"""Where a step would lead: gaps that bend since bodies turn, and contacts that its impacts bring about.

The law 0 <= g + h u_N knows the contacts found at the beginning, x_m, and takes their motion for straight. Both are wrong by what a step
turns: a face at the distance R from the centre of its body, which turns by omega h, comes nearer by R (omega h)^2 / 2 than its velocity
says, and a body thrown aside by an impact may meet in the same step what it had not approached before. So contacts are detected once more
at x_m' = x_m + h v+, where the next step will find them. Of each that lies deeper there than its law meant, the bend

    b = g(x_m') - (g(x_m) + h u_N)                                                                        (1)

enters the law, 0 <= g + b + h u_N ⊥ r_N >= 0; those that are new are brought back to x_m as the sweep does; the step is solved again, until
nothing is deeper. A contact that lasts then has u_N = -b/h at the beginning of each step and +b/h at its end, and its reaction does no
work at theta = 1/2, where without b it does work of the order of b. What stands still is not looked at, nor, but under `Everything`,
what does not turn or meet anything, and nothing in its step changes.

Bodies that turn away from each other within a step end it apart by R (omega h)^2 / 2 although they were held as if they touched: such b > 0
is left out where none was given before. Twelve tumbling rocks end their contacts up to 1.2 % of a rock apart at h = 5 ms, 0.15 % at 2 ms.
With it they ended less than 0.1 % apart, but then overlapped between the places of detection, by 0.12 % and 0.04 %, where now none do.
Joints that hold, rigid and glued, have it: they stood open by R (omega h)^2 / 2, which the first two steps of two halves of mass m that
spin as the run begins paid with 1 - 3/8 and 1 + 3/8 of m omega^2 R at theta = 1/2, with 0 and 3/2 at theta = 1, however short they were.
Now these are 1 + 1/8 and 1 - 1/8 (x_m lies off the circle by R (omega h)^2 / 8), and 1/2 and 1 (the step began before the force).
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.contact_detection import Everything, innermost
from fcsim.contact_detection.sweep import with_met
from fcsim.contact_law.law import Implicit
from fcsim.linear.sparse._vectors_kernels import farthest
from fcsim.ranks import largest
from fcsim.timestep.encounter import Encounter, asked_again
from fcsim.timestep.scheme import StepSetup
from fcsim.timestep.state import State
from fcsim.timestep.step_equation.look_ahead.lengths import BORNE, THROWN, back_at, moves, of_other_facets, places, turns
from fcsim.timestep.step_equation.look_ahead.load_steps import came_together

ROUNDS = 4
"""How often a step is solved again."""

BORNE_BY_CABLES = 1e-8
"""The same of cables: those that turn grow longer in every step, by (h u_T)^2 / 2 L, and what no step sees adds up; surfaces part again."""

_TURNS_A_CABLE = 1e-4
"""Of the smallest body: a cable whose ends pass each other by less has grown by less than is borne."""

MEANT = 0.1
"""Of `BORNE`: how far contacts may be, in the mean, from where an answer that says where to look has them."""

FEW = 5e-3
"""Of the contacts: where a look has found no more new ones, the next answer is likely to be the last."""

DOFS_FROM = 100_000
"""Degrees of freedom from which ranks share looking at how far nodes go: a tenth of a millisecond."""

_TURNED_ASIDE = 2e-3
"""Of the smallest body: velocities that impacts change by less than this over the step bring no new contact about."""


def looked_ahead(
    setup: StepSetup, state: State, met: Encounter, v: FloatArray, after: State, reactions: FloatArray | None = None
) -> Encounter | None:
    """Return the encounter of a step with what its answer v (n_dofs,) and the state after it show; None where all is as it was meant.
    reactions (m,): of that answer, for statics."""
    model, detection, scheme, timing = setup.model, setup.detection, setup.scheme, setup.scheme.timing
    if not timing.moving:
        return came_together(setup, state, met, v, after, reactions)
    if not (_found_late(setup, met, after) or _may_miss(setup, state, met, v, after)):
        return None
    held = met.meeting.contacts
    positions = model.positions(scheme.detection_configuration(model, after))
    there = detection(positions)
    size = met.meeting.proportions.size_at(there)
    place, known = places(held.identity, there.identity)
    bend = np.zeros(len(held)) if met.meeting.bend is None else met.meeting.bend.copy()
    straight = held.gap + timing.length_per_u * met.relative(v).reshape(-1, held.dimension)[:, 0]
    meant = np.where(known, np.append(straight + bend, 0.0)[place], 0.0)
    deeper = there.gap < np.minimum(meant, 0.0) - np.where(there.cables, BORNE_BY_CABLES, BORNE) * size
    drawn = known & np.append(_glued(met), False)[place] & (meant <= BORNE * size) & (there.gap > np.maximum(meant, 0.0) + BORNE * size)
    given = np.append(bend, 0.0)[place]
    too_far = known & (given < 0) & (meant <= BORNE * size) & (there.gap > np.maximum(meant, 0.0) + THROWN * size)
    if not (deeper.any() or too_far.any() or drawn.any()):
        return None
    anew = known & (deeper | drawn | (given < 0) & (there.gap > meant))
    at = place[anew]
    bend[at] = np.where((deeper | drawn)[anew], there.gap[anew] - straight[at], np.minimum(there.gap[anew] - straight[at], 0.0))  # (1)
    new = there.take(deeper & ~known & ~of_other_facets(met, there, positions))
    new = back_at(met.meeting.positions, detection, new, positions)
    order = np.argsort(np.concatenate([held.identity, new.identity]), kind="stable")
    every = with_met(held, new, there, model.body_of_node)
    again = asked_again(model, scheme, state, met, every, np.concatenate([bend, np.zeros(len(new))])[order])
    same = len(again.contacts) == len(held) and np.array_equal(again.terms.w, met.terms.w)
    return None if same else again  # a law that does not ask for gaps


def _glued(met: Encounter) -> BoolArray:
    """Which contacts (nc,) adhesion holds without springs, which would give way."""
    adhesion = met.terms.adhesion
    if adhesion is None or met.compliance is not None:
        return np.zeros(len(met.meeting.contacts), dtype=bool)
    return adhesion[:, 0] > 0


def borne_at_first(setup: StepSetup, met: Encounter, seen: Encounter | None = None) -> float:
    """The residual [m/s] that each contact of `met` may have at an answer which says where to look, 0 where it is to be the step's own.

    seen: the encounter before it, None where it is the first. Between rigid bodies whose joints have stiffness most steps are solved
    again with contacts that their first answer met, and such joints are so stiff that each time many reactions are others: what the first
    answers have of them is of no use. Velocities that move no contact by more than a share of what counts show the same contacts. The last
    answer is always one by the settings' tolerance.
    """
    timing = setup.scheme.timing
    joints = met.compliance is not None and not isinstance(setup.scheme.law, Implicit)
    if not joints or setup.model.deformable or not isinstance(innermost(setup.detection), Everything) or not timing.moving:
        return 0.0
    if seen is not None and len(met.contacts) - len(seen.contacts) <= FEW * len(met.contacts):
        return 0.0
    return MEANT * BORNE * float(met.meeting.proportions.size.min(initial=np.inf)) / timing.length_per_u


def _found_late(setup: StepSetup, met: Encounter, after: State) -> bool:
    """Whether bodies move by a length that counts under a detection of everything: what approaches beside a face, a corner above
    a corner, is its contact when it is there. (It keeps what it finds where the next step begins: looking costs nothing.)"""
    if not isinstance(innermost(setup.detection), Everything):
        return False
    return moves(met, setup.model.positions(setup.scheme.detection_configuration(setup.model, after)) - met.meeting.positions)


def _may_miss(setup: StepSetup, state: State, met: Encounter, v: FloatArray, after: State) -> bool:
    """Whether some node leaves the straight way, or the way along which contacts were looked for, by a length that counts; or whether a
    contact slides on a body that turns by so much that its normal is another one."""
    model, scheme = setup.model, setup.scheme
    h, begin = scheme.timing.h, scheme.detection_configuration(model, state)
    sizes = met.meeting.proportions.size
    smallest = float(sizes.min(initial=np.inf))
    aside, off, longest = _farthest(setup, state, met, v, after)
    if aside > _TURNED_ASIDE * smallest:
        return True
    counts = 0.5 * BORNE * smallest
    if off > counts:
        return True
    held = met.meeting.contacts
    if not len(held):
        return False
    slide = scheme.timing.length_per_u * reduce(np.maximum, np.abs(met.relative(v).reshape(len(held), -1)[:, 1:]).T)
    if slide.max(where=held.cables, initial=0.0) > _TURNS_A_CABLE * smallest:
        return True
    if slide.max() * longest <= 0.25 * smallest * counts:  # no node moves by more than twice that beside the mean
        return False
    angle = (turns(model, h * model.node_velocity(v, begin)) / (0.5 * np.maximum(sizes, 1e-300)))[held.bodies].max(axis=1)
    return bool(np.any(slide * angle > counts))  # N . du less N' . du, of nodes that go straight


def _farthest(setup: StepSetup, state: State, met: Encounter, v: FloatArray, after: State) -> FloatArray:
    """In their largest components (3,) [m]: how far nodes are beside the way along which contacts were looked for, beside the straight way,
    and how long that is. Of deformable bodies each rank looks at some."""
    model, scheme = setup.model, setup.scheme
    h, d, n = scheme.timing.h, model.dimension, model.n_elastic
    begin, end, way = scheme.detection_configuration(model, state), scheme.detection_configuration(model, after), scheme.way(model, state)
    reference, met_at = model.reference.ravel(), met.meeting.positions.ravel()
    nothing = v[:0] if way is None else way

    def look(first: int, last: int) -> FloatArray:
        return farthest(h, v[first:last], nothing[first:last], end[first:last], reference[first:last], met_at[first:last])

    elastic = largest("ways", n, DOFS_FROM, look)
    rigid = model.rigid_part(begin)
    straight = h * model.rigid_bodies.velocity(rigid, model.rigid_part(v))
    beside = straight[:0] if way is None else model.rigid_bodies.velocity(rigid, h * model.rigid_part(v) - model.rigid_part(way))
    moved = model.reference[n // d :] + model.rigid_bodies.displacement(model.rigid_part(end)) - met.meeting.positions[n // d :]
    return np.maximum(elastic, [np.abs(some).max(initial=0.0) for some in (beside, moved - straight, straight)])
