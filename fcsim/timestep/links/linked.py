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

In statics equilibrium is that of the end of the step, so each round takes the rows anew where the last one ended, x',

    G = G(x'),  b = g(x') - G^T v,  of springs b = C k (g(x') - G^T v),                                                     (3)

Newton's method on the links; with those of the beginning a body that turns by an angle takes a moment times its cosine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.model import Model
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.linkage.linkage import Linkage, Rows
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State


@dataclass(frozen=True, eq=False)
class Linked:
    """The rows of a step: G (n_dofs, p), b (p,) [m/s; quasi-statics: m], compliance (p,) C, 0 where a row is kept exactly.

    target (p,) [m]: the gap of a row that is kept, at x_m + L v; 0 but for what is driven."""

    linkage: Linkage
    rows: Rows
    G: sp.csr_array
    b: FloatArray
    compliance: FloatArray
    target: FloatArray

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

    def bent(self, model: Model, scheme: Scheme, v: FloatArray, after: State, missing: FloatArray) -> Linked:
        """The rows with what is missing after v (n_dofs,) in b, (1); in statics those of the end, (3)."""
        if scheme.timing.moving:
            return replace(self, b=self.b + missing / scheme.timing.length_per_u)
        rows = self.linkage.rows(after.x)
        G = self.linkage.matrix(rows, after.x)
        short = rows.gap - self.target - G.T @ v
        stiffness = np.where(self.kept, 1.0, self.linkage.stiffness)
        return replace(self, rows=rows, G=G, b=np.where(self.kept, short, self.compliance * stiffness * short))

    def refuse_contradictions(self, v: FloatArray, length_per_u: float, extent: float) -> None:
        """InputError where v (n_dofs,) does not keep a row that is to be kept exactly."""
        off = np.where(self.kept, self.G.T @ v + self.b, 0.0)
        worst = int(np.argmax(np.abs(off))) if len(off) else 0
        if len(off) and abs(off[worst]) * length_per_u > 1e-6 * extent:
            name = self.linkage.names[int(self.linkage.of_row[worst])]
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


def linked(linkage: Linkage | None, model: Model, scheme: Scheme, state: State) -> Linked | None:
    """The rows of a step from a state; None where there are none."""
    if linkage is None or not linkage.n_rows:
        return None
    timing = scheme.timing
    middle = scheme.detection_configuration(model, state)
    rows = linkage.rows(middle)
    G = linkage.matrix(rows, middle)
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
