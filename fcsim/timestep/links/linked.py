"""The links in one step: G^T v + b = 0 with compliances for springs, and the second look that keeps joints closed where bodies turn.

Rows are taken where contacts are, at x_m, and closed as gaps are (`theta`): g(x_m) + L G^T v = 0 with L = h for velocities, 1 for
increments, so an error dies in one step. Where bodies turn, x_m' of the next step is not x_m + L v, and what is missing there,

    g(x_m') = g(x_m) + L G^T v + bend,                                                                                      (1)

enters b, and the step is solved again until the joints are closed at x_m'. A link that lasts then does no work at theta = 1/2 to the order
of the scheme, as contacts do (`look_ahead`).

A spring of stiffness k and damping c pulls with F = - k (theta g+ + (1 - theta) g) - c (theta u+ + (1 - theta) u), g its lengthening, g+ =
g(x_m) + L theta u+: with l = F / phi, phi the force of a unit l,

    u+ + C l + b = 0,  1 / C = (k theta^2 L + c theta L / h) / phi,                                                         (2)
    b = C (k (theta g(x_m) + (1 - theta) g) + c (1 - theta) u) / phi

Where deformable bodies are linked the directions of all rows, and the arms of their forces, are those of the configuration in which the
scheme adds up moments (`Scheme.working_configuration`), and that depends on the answer: each round takes them anew, and with them

    dir = (p + p+) / (|p| + |p+|),  g+ the lengthening at the end as it is                                                  (4)

of a spring between the points p apart at the beginning and p+ at the end. At theta = 1/2 moment of momentum is then kept by all links,
and F (|p+| - |p|) is the change of a spring's energy less what its dashpot takes (a discrete gradient: O. Gonzalez, "Time integration and
discrete Hamiltonian systems", J. Nonlinear Sci. 6, 1996) where both of its bodies are deformable, or one is the ground.

In statics equilibrium is that of the end of the step, so each round takes the rows anew where the last one ended, x',

    G = G(x'),  b = g(x') - G^T v,  of springs b = C k (g(x') - G^T v),                                                     (3)

Newton's method on the links; with those of the beginning a body that turns by an angle takes a moment times its cosine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.model import Model
from fcsim.brief import brief
from fcsim.contact_detection import Detection
from fcsim.contact_detection.contacts import CABLES
from fcsim.errors import InputError
from fcsim.linkage.linkage import Linkage, Rows
from fcsim.linkage.stiffness import link_stiffness
from fcsim.timestep.scheme import Scheme, Timing
from fcsim.timestep.state import State


class Bending(NamedTuple):
    """How forces of links turn in statics: B (n_dofs, n_dofs) of `link_stiffness` at the increments v (n_dofs,) where the rows were taken,
    so that the step's equation has B (v' - v) beside G l; convex: that part of B which holds, None = none; whole: whether the problem's
    matrix with B may be positive definite only where the links leave a motion."""

    B: sp.csr_array
    convex: sp.csr_array | None
    v: FloatArray
    whole: bool = True


@dataclass(frozen=True, eq=False)
class Linked:
    """The rows of a step: G (n_dofs, p), b (p,) [m/s; quasi-statics: m], compliance (p,) C, 0 where a row is kept exactly.

    target (p,) [m]: the gap of a row that is kept, at x_m + L v; 0 but for what is driven; bending: see there, None = none."""

    linkage: Linkage
    rows: Rows
    G: sp.csr_array
    b: FloatArray
    compliance: FloatArray
    target: FloatArray
    bending: Bending | None = None

    __repr__ = brief

    @property
    def kept(self) -> BoolArray:
        """Which rows (p,) are kept exactly."""
        return self.compliance == 0

    def missing(self, model: Model, scheme: Scheme, v: FloatArray, after: State) -> FloatArray:
        """How far the rows (p,) [m] are from kept where the next step will look; of springs, in statics, from what they were taken for."""
        gap = self.linkage.rows(scheme.detection_configuration(model, after), self.rows).gap
        if scheme.timing.moving or self.kept.all():
            return np.where(self.kept, gap - self.target, 0.0)
        stiffness = np.where(self.kept, 1.0, self.linkage.stiffness)
        taken = self.G.T @ v + np.divide(self.b, self.compliance * stiffness, out=np.zeros_like(gap), where=stiffness * self.compliance > 0)
        return np.where(self.kept, gap - self.target, np.where(stiffness > 0, gap - taken, 0.0))

    def bent(self, model: Model, scheme: Scheme, v: FloatArray, ends: tuple[State, State], missing: FloatArray) -> Linked:
        """The rows after the answer v (n_dofs,), which led from the one of `ends` to the other: what is missing in b, (1), directions
        where the scheme adds up moments, and springs between their lengths at both ends, (4); in statics those of the end, (3)."""
        before, after = ends
        timing, x = scheme.timing, scheme.working_configuration(model, before, after)
        if x is None:
            return replace(self, b=self.b + missing / timing.length_per_u)
        if timing.moving:
            return self._working(scheme, v, ends, x, missing)
        return self.at(x, v, None)

    def at(self, x: FloatArray, v: FloatArray, l: FloatArray | None) -> Linked:
        """The rows of statics, (3), in the configuration x (n_dofs,) that the increments v (n_dofs,) lead to, with `bending` under the
        multipliers l (p,) [N]; None: without."""
        rows = self.linkage.rows(x)
        G = self.linkage.matrix(rows, x, balanced=False)
        short = rows.gap - self.target - G.T @ v
        stiffness = np.where(self.kept, 1.0, self.linkage.stiffness)
        bending = None
        if l is not None:  # along the directions that l is of, which across an axis are not those of the new rows
            those = rows._replace(direction=np.where(self.linkage.straight[:, None], rows.direction, self.rows.direction))
            B = link_stiffness(self.linkage, those, l, x)
            bending = None if B is None else Bending(B, link_stiffness(self.linkage, those, l, x, convex=True), v)
        b = np.where(self.kept, short, self.compliance * stiffness * short)
        return replace(self, rows=rows, G=G, b=b, bending=bending)

    def _working(self, scheme: Scheme, v: FloatArray, ends: tuple[State, State], x: FloatArray, missing: FloatArray) -> Linked:
        """`bent` in dynamics, of deformable bodies; x (n_dofs,): where moments are added up."""
        linkage, timing = self.linkage, scheme.timing
        rows = linkage.rows(x, self.rows)
        springs, direction = np.flatnonzero(~self.kept), rows.direction
        first, last = (linkage.rows(end.x).gap[springs] for end in ends)
        if len(springs):
            length, both = rows.gap[springs] + linkage.rest[springs], 0.5 * (first + last) + linkage.rest[springs]
            direction = direction.copy()
            direction[springs] *= np.divide(length, both, out=np.ones_like(both), where=both > 0)[:, None]
        rows = rows._replace(direction=direction, gap=self.rows.gap)
        G = linkage.matrix(rows, x)
        u = G.T @ v
        b = self.b + missing / timing.length_per_u + self.G.T @ v - u
        if len(springs):  # (4)
            theta, k, c = timing.theta, linkage.stiffness[springs], linkage.damping[springs]
            beside = last - timing.length_per_u * theta * u[springs]
            pull = k * (theta * beside + (1 - theta) * first) + c * (beside - first) / timing.h
            b[springs] = self.compliance[springs] * pull / timing.force_per_reaction
        return replace(self, rows=rows, G=G, b=b)

    def change(self, later: Linked, model: Model, scheme: Scheme, extent: float) -> float:
        """How much `later` rows, of the same step, differ: of unit forces, of arms and of springs' lengthening relative to extent [m]."""
        if later.G is self.G or not scheme.timing.moving:
            return 0.0
        turned = sp.coo_array(later.G - self.G)
        arm = np.ones(model.n_dofs)
        model.rigid_part(arm)[:, model.dimension :] = 1 / extent
        directions = float(np.abs(turned.data * arm[turned.coords[0]]).max(initial=0.0))
        longer = np.where(self.kept, 0.0, later.b - self.b) * scheme.timing.length_per_u / extent
        return max(directions, float(np.abs(longer).max(initial=0.0)))

    def reach(self, model: Model, x: FloatArray, at: FloatArray, way: FloatArray, extent: float) -> float:
        """How far the increments `way` (n_dofs,), beyond `at` from the configuration x (n_dofs,), lead in statics: angles [rad] of rigid
        bodies, and what links' points go from each other along rods and springs and across them, over their length."""
        linkage, d = self.linkage, model.dimension
        turned = float(np.abs(model.rigid_part(way)[:, d:]).max(initial=0.0))
        places = model.advance(x, at)
        rods = np.flatnonzero(linkage.straight)
        if not len(rods):
            return turned
        length = np.maximum(linkage.rows(places).gap[rods] + linkage.rest[rods], 1e-9 * extent)
        moved = sp.csr_array(self.rows.weights)[rods] @ model.node_velocity(way, places)
        return max(turned, float((np.linalg.norm(moved, axis=1) / length).max()))

    def unbalanced(self, later: Linked, model: Model, l: FloatArray, extent: float) -> float:
        """How much the forces G l of the multipliers l (p,) [N] differ from those of `later` rows, of the largest l; moments by extent."""
        largest = float(np.abs(l).max(initial=0.0))
        if not largest:
            return 0.0
        off = np.asarray((later.G - self.G) @ l)
        model.rigid_part(off)[:, model.dimension :] /= extent
        return float(np.abs(off).max(initial=0.0)) / largest

    def refuse_contradictions(self, v: FloatArray, timing: Timing, extent: float) -> None:
        """InputError where v (n_dofs,) does not keep a row that is to be kept exactly; not in dynamics where that is round-off beside v,
        of links near a dead point: such a step does not close, and is cut."""
        length_per_u = timing.length_per_u
        off = np.where(self.kept, self.G.T @ v + self.b, 0.0)
        worst = int(np.argmax(np.abs(off))) if len(off) else 0
        if len(off) and abs(off[worst]) * length_per_u > 1e-6 * extent:
            name = self.linkage.names[int(self.linkage.of_row[worst])]
            way = float(np.abs(v).max()) * length_per_u
            if abs(off[worst]) * length_per_u < 1e-6 * way:  # round-off beside what nothing but eta holds
                if timing.moving:
                    return
                raise InputError(
                    f"link {name!r}: links and supports leave bodies a motion that eta alone holds (a mechanism), by {way:.3g} in one step "
                    f"of a model of {extent:.3g} m. What helps: a larger eta, by so much; or dynamics, which follow it"
                )
            raise InputError(
                f"link {name!r}: expected links and supports that can be kept together, got some that contradict each other: it is off by "
                f"{abs(off[worst]) * length_per_u:.3g} m in one step"
            )

    def stored(self, x: FloatArray) -> float:
        """Energy [J] of the springs in the configuration x (n_dofs,)."""
        springs = ~self.kept
        if not springs.any():
            return 0.0
        gap = self.linkage.rows(x).gap[springs]
        return 0.5 * float(self.linkage.stiffness[springs] @ gap**2)


def refuse_linkage(linkage: Linkage | None, model: Model) -> None:
    """InputError for links of another model, or of bodies that they cannot hold."""
    if linkage is not None and linkage.model.bodies != model.bodies:
        raise InputError("linkage: expected the links of the simulation's model, got those of another one")


def refuse_unseen_cables(linkage: Linkage | None, model: Model, detection: Detection, initial: State | None) -> None:
    """InputError for cables that the detection does not find: contacts are all that holds them, so they would hold nothing."""
    if linkage is None or not linkage.cables:
        return
    found = detection(model.positions(np.zeros(model.n_dofs) if initial is None else initial.x))
    unseen = np.setdiff1d(CABLES + np.arange(len(linkage.cables)), found.identity) - CABLES
    if unseen.size:
        raise InputError(
            f"link {linkage.cables[int(unseen[0])].link.name!r}: expected a detection that knows of cables, WithCables(detector, linkage), "
            f"got {type(detection).__name__} without them: nothing would hold it"
        )


def linked(linkage: Linkage | None, model: Model, scheme: Scheme, state: State) -> Linked | None:
    """The rows of a step from a state; None where there are none."""
    if linkage is None or not linkage.n_rows:
        return None
    timing = scheme.timing
    middle = scheme.detection_configuration(model, state)
    rows = linkage.rows(middle)
    G = linkage.matrix(rows, middle, balanced=timing.moving)
    at = state.t + timing.h * (2 - timing.theta)  # where the next step looks; in statics theta is 1
    target = linkage.target(at)
    b = (rows.gap - target) / timing.length_per_u
    compliance = np.zeros(len(b))
    springs = np.flatnonzero(np.isfinite(linkage.stiffness))
    if len(springs):  # (2)
        theta, L, phi = timing.theta, timing.length_per_u, timing.force_per_reaction
        k, c = linkage.stiffness[springs], linkage.damping[springs]
        rate = (G.T @ scheme.velocity_before(model, state))[springs] if timing.moving else 0.0
        now = linkage.rows(state.x).gap[springs]
        stiff = (k * theta**2 * L + c * theta * L / timing.h) / phi
        pull = (k * (theta * rows.gap[springs] + (1 - theta) * now) + c * (1 - theta) * rate) / phi
        compliance[springs], b[springs] = 1 / stiff, pull / stiff
    return Linked(linkage, rows, G, b, compliance, target)
