"""How far what bore or stuck in the last step has gone apart since, in a way that bodies together take back.

A step's velocities are straight: what turns by omega h goes apart by s (omega h)^2 / 2 from what turns with it, at joints that bear and
stick as well. Gaps of rigid joints in motion, some 1e-8 sizes a step, are of that kind, to 1e-11: motions of the bodies close them all,

    g + H_N^T dq = 0  at contacts with r_N > 0,    t + H_T^T dq = 0  at those that stuck too,                                    (1)

t what the last velocities leave of the way along the surface. Solved by least squares, normals first. The law `Gap` is told -H^T dq: w_N
has it in full and `counted` of what else there is of gaps, w_T has it for what would otherwise have slid by t unseen. A w of this kind only
moves v by dq / h, so that a step is as easy as one without gaps: as many points carry. Where each gap counts for itself, by whatever
measure, the last digits of w say which of a joint's points carry (docs/measures/rigid_masonry.md).

A penetration enters (1) by `NO_GAP` sizes at most, and by no more than the law takes back in a step: w_T drives what sticks, and where
friction holds a body wedged in a groove, the whole dq would throw it out along both faces at |g| / h.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.brief import brief
from fcsim.contact_detection.contacts import EXACT, Contacts
from fcsim.contact_law.coulomb import NO_GAP, Gap
from fcsim.contact_law.proportions import Proportions
from fcsim.linear.factors import SingularMatrix, SuperLU
from fcsim.linear.sparse.columns import transposed_times
from fcsim.timestep.reactions.reactions import Reactions
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

LEAST = 1e-9
"""Shares of a size: where nothing has gone apart by more there is no drift. Bodies at rest leave less."""
MOST = 1e-3
"""The largest gap that is drift, as a share of a size, and the largest way that drift takes along a surface: what goes further, by the
size of the smaller body, does not count as stuck. As a pebble on a turntable, which would otherwise end the drift of all bodies."""
POINTS = {2: 1.5, 3: 3.0}
"""By dimension: contacts a pair of bodies from which these touch in faces. Where single points touch all gaps can be closed as they are."""
STUCK = 1e-6
"""Share of the friction cone next to its surface where a contact is not said to stick."""
FITS = 1e-8
"""Shares of a size: where gaps beyond `CLOSE` bore and dq leaves more at what bore or touches, bodies do not take them back together, and
there is none. Mechanisms that turn faster, by omega h of 3e-3 a step of a vault, part in some of their points; w would keep these within
each other by up to NO_GAP, and steps took ten times the iterations that they take without drift. Gaps up to `CLOSE` count by degrees at
the most, which says no better what carries."""
TURNS = 1e-7
"""The largest turn against each other in a dq [rad] of bodies that stick, in the mean by mass. Mechanisms of hinges, as of a falling vault,
come to that in a tenth of a second, and part in some points not long after (`FITS`). The longer drift has kept all of a joint's points in
contact until then, the harder are the steps that follow (docs/measures/rigid_masonry.md). What turns as a whole about an edge has none."""
ALONG = 1e-2
"""Weight of the second equation (1) beside the first: gaps are closed, and ways along the surface taken back where that allows it."""
CLOSE = 1e-6
"""The largest gap of what is near, as a share of a size."""
STILL = 3e-3
"""Weight of the motion between bodies near each other that neither of these asks for. Without it what few points hold is thrown about: the
least squares of a corner that tears took gaps of 1e-9 sizes back by ways of 3e-4 and more, and its third step 27 749 iterations."""
HELD = 1e-12
"""Weight of dq^2 beside all of these: what nothing holds stays."""


@dataclass(frozen=True, eq=False)
class Drift:
    """What the last step left. reactions: its r; recovery: the law's, by which penetrations are taken back [1/s]; moved: dq (n_dofs,), kept
    for further contacts of the same step, as they are found."""

    reactions: Reactions
    recovery: float
    moved: list[FloatArray | None] = field(default_factory=list)

    __repr__ = brief

    def at(
        self, model: Model, scheme: Scheme, state: State, contacts: Contacts, H: sp.csc_array, proportions: Proportions
    ) -> FloatArray | None:
        """-H^T dq (nc, d) [m] of (1) for a step's contacts; None where there is none, or bodies are not all rigid; all ranks must ask."""
        if not self.moved:
            self.moved.append(self._motion(model, scheme, state, contacts, H, proportions))
        moved = self.moved[0]
        return None if moved is None else -transposed_times(H, moved).reshape(len(contacts), -1)

    def _motion(
        self, model: Model, scheme: Scheme, state: State, contacts: Contacts, H: sp.csc_array, proportions: Proportions
    ) -> FloatArray | None:
        """dq (n_dofs,) of (1)."""
        d = contacts.dimension
        pairs = len(np.unique(np.sort(contacts.bodies, axis=1), axis=0))
        if not len(contacts) or len(contacts) < POINTS[d] * pairs or np.any(contacts.identity >= EXACT):
            return None
        r = self.reactions.transfer(contacts).reshape(-1, d)
        size = proportions.size_at(contacts)
        bore = (r[:, 0] > 0) & (np.abs(contacts.gap) <= MOST * size) & ~contacts.cables
        stuck = bore & (np.linalg.norm(r[:, 1:], axis=1) < (1 - STUCK) * contacts.mu * r[:, 0])
        aside = left_aside(model, scheme, state, contacts)
        deepest = -size * min(NO_GAP, self.recovery * scheme.timing.length_per_u)
        apart = np.column_stack([np.maximum(contacts.gap, deepest), aside[:, 1:]])
        near = (np.abs(contacts.gap) <= CLOSE * size) & ~contacts.cables | bore
        for _ in range(2):
            asked = np.column_stack([bore, *[stuck] * (d - 1)])
            if not np.any(np.abs(np.where(asked, apart, 0.0)) > LEAST * size[:, None]):
                return None
            weight = np.where(near[:, None], STILL, 0.0) * np.ones(d)
            weight[:, 1:][stuck] = ALONG
            weight[bore, 0] = 1.0
            moved = least_motion(H, weight, np.where(asked, apart, 0.0), model.free_dofs)
            if moved is None:
                return None
            brought = transposed_times(H, moved).reshape(-1, d)
            far = np.any(np.abs(brought[:, 1:]) > MOST * size[:, None], axis=1)
            if not far.any():
                fit = fits(apart[:, 0] + brought[:, 0], contacts.gap, bore, size)
                return moved if fit and turn_apart(model, moved, contacts.bodies[stuck]) <= TURNS else None
            stuck &= ~far  # at most once: where the rest still goes as far there is no drift
        return None


def drift_of(scheme: Scheme, model: Model, reactions: Reactions | None) -> Drift | None:
    """What a step of dynamics asks for drift, after one with these reactions; None but of rigid bodies under the law `Gap` that takes
    nothing back at once, with the pairs' own friction: what slides under another coefficient would be taken for what sticks."""
    law = scheme.law
    if not isinstance(law, Gap) or law.recovery == np.inf or law.friction is not None:
        return None
    if reactions is None or not scheme.timing.moving or model.n_elastic or model.axes_matrix is not None:
        return None
    return Drift(reactions, law.recovery)


def fits(left: FloatArray, gap: FloatArray, bore: BoolArray, size: FloatArray) -> bool:
    """Whether dq leaves nothing (nc,) [m] that counts of the gaps (nc,) [m] of what bore or touches, or what bore is hardly apart."""
    if not np.any(np.abs(gap[bore]) > CLOSE * size[bore]):
        return True
    told = bore | (np.abs(gap) <= NO_GAP * size)
    return not np.any(np.abs(left[told]) > FITS * size[told])


def turn_apart(model: Model, moved: FloatArray, held: IntArray) -> float:
    """How far bodies that stick at contacts of `held` (n, 2), and whose rotations are free, turn in dq (n_dofs,) against their common turn
    [rad], in the mean by their masses. Rigid bodies alone."""
    d = model.dimension
    counts = model.rigid_free[:, d:].any(axis=1) & np.isin(np.arange(len(model.rigid_free)), held)
    turn, mass = model.rigid_part(moved)[counts, d:], model.rigid_bodies.reference_mass[counts, 0, 0]
    if not len(mass):
        return 0.0
    apart = turn - np.average(turn, axis=0, weights=mass)
    return float(np.sqrt(np.average(np.sum(apart**2, axis=1), weights=mass)))


def left_aside(model: Model, scheme: Scheme, state: State, contacts: Contacts) -> FloatArray:
    """(nc, d) [m] in the contacts' frames: how far the last step's velocities brought points apart that should have stayed together,
    s (omega h)^2 / 2, of rigid bodies alone."""
    q = scheme.detection_configuration(model, state)
    way = scheme.timing.length_per_u * scheme.velocity_before(model, state)
    nodes = model.positions(model.advance(q, way)) - model.positions(q) - model.node_velocity(way, q)
    weights = np.where(contacts.nodes < 0, 0.0, contacts.weights)
    return np.einsum("aij,ak,akj->ai", contacts.frame, weights, nodes[contacts.nodes], optimize=True)


def least_motion(H: sp.csc_array, weight: FloatArray, apart: FloatArray, free: IntArray) -> FloatArray | None:
    """dq (n_dofs,), zero but for the unknowns `free`, of the least squares of weight (apart + H^T dq), both (nc, d), each unknown measured
    by what a unit of it moves; None where round-off leaves no answer."""
    rows = np.flatnonzero(weight)
    weights = weight.ravel()[rows]
    A = sp.csr_array(H[:, rows])[free]
    square = A.multiply(A).sum(axis=1)
    scale = np.sqrt(np.where(square > 0, square, 1.0))
    A = sp.csr_array(sp.diags_array(1 / scale) @ A @ sp.diags_array(weights))
    try:
        factor = SuperLU(sp.csc_array(A @ A.T + HELD * sp.eye_array(len(free))), symmetric_pattern=True)
    except SingularMatrix:
        return None
    found = factor.solve(-(A @ (weights * apart.ravel()[rows])))
    moved = np.zeros(H.shape[0])
    moved[free] = found / scale
    return moved if np.all(np.isfinite(moved)) else None
