"""What is said of bodies that their own stress would bend further, or hold straight: of columns beyond Euler's load, of strings."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.assembly.floating import floating
from fcsim.assembly.groups import Group
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.assembly.kinematics.prestress import FIRM, Prestress, positive_definite
from fcsim.assembly.model import Model
from fcsim.timestep.remarks.coarse import looked_at
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.tangent import sticking

NAMED = 0.05
"""Share of the load that buckles from which a body of small rotations is named: what bends it across is found too small by as much."""
SLENDER = 0.1
"""Strain at which a body buckles that is no column, sheet or strip: at more small strains end before."""
STILL = 0.01
"""Kinetic over elastic energy below which motion does no more than statics."""
_SAID = frozenset(("buckling", "buckled", "drawn"))
STRAINED = 1e-7
"""Strain below which only what is a thousand times as long as thick would be near that."""


class Buckled:
    """The remarks on deformable bodies under pressure or tension: call it with the steps in turn.

    Bodies of small rotations, which know nothing of that (`fcsim.assembly.kinematics.prestress`), in steps 1, 4, 16, ... and the last: the
    one that is nearest to buckling, the one that tension holds straight most; in dynamics where they hardly move. In statics bodies of laws
    of points whose last tangent had lost its definiteness: whether it is definite where contacts hold them; if not, the equilibrium is one
    that they would leave. In both, contacts that press do not give way along their normals, and those that stick not at all. Bodies that
    supports do not hold, those over ranks and models with links are not asked.
    """

    def __init__(self) -> None:
        self._prestress: dict[int, Prestress] = {}
        self._free: frozenset[int] | None = None

    def __call__(self, step: Step, found: Deformation, steps: int, when: str, said: frozenset[str]) -> dict[str, str]:
        """Remarks by their kinds, of those that are not among the `said`; {} where there is none."""
        model = step.model
        if model.shares is not None or step.linked is not None:
            return {}
        if self._free is None:
            self._free = frozenset(floating(model))
        texts: dict[str, str] = {}
        if not said >= _SAID and (looked_at(step.number) or step.number == steps) and _still(step):
            texts |= self._of_small_rotations(step, found, when, said)
        if "unstable" not in said and not step.scheme.timing.moving and step.linearised and step.linearised[-1].stiffened > 0:
            texts |= self._lost(step, when)
        return texts

    def _of_small_rotations(self, step: Step, found: Deformation, when: str, said: frozenset[str]) -> dict[str, str]:
        model, pressed, drawn = step.model, (NAMED, -1), (NAMED, -1)
        of_laws = _of_laws(step)
        for group in model.groups:
            own = [int(b) for b in group.members if b not in (self._free or ()) and found.strain[b] > STRAINED]
            if (group.laws is not None and group.rotates) or group.over_ranks or not own or group.driven.all():
                continue
            prestress = self._prestress.setdefault(id(group), Prestress(group))
            for body in own:
                x = _displacement(step, group, body)
                stress = prestress.stress(x) if group.laws is None else prestress.of_cells(of_laws[body])
                if stress.largest <= NAMED * prestress.bears:
                    continue
                firm = _firm(step, body)
                share = prestress.share(stress, pressed[0], firm)
                if found.strain[body] < SLENDER * share:
                    pressed = max(pressed, (share, body))
                share = 0.0 if share else prestress.straightened(stress, x, firm)
                if share > NAMED and found.strain[body] < SLENDER * share:
                    drawn = max(drawn, (share, body))
        every = _pressed(model, *pressed) | _drawn(model, *drawn)
        return {kind: f"{when}: {text}" for kind, text in every.items() if kind not in said}

    def _lost(self, step: Step, when: str) -> dict[str, str]:
        model = step.model
        inner = model.nonlinear.inner(step.state.x, step.previous.internal, step.state.t, step.scheme.h, tangent=True)
        groups = [group for group in model.groups if group.laws is not None]
        for group, blocks in zip(groups, inner.blocks, strict=True):
            assert group.laws is not None
            for body, own in zip((int(b) for b in group.members), blocks, strict=True):
                if body not in (self._free or ()) and not _definite(group, group.laws.graph.matrix(own), _firm(step, body)):
                    return {
                        "unstable": f"{when}: body {model.deformable[body].name!r} is in an equilibrium that it would leave (it has "
                        "lost its stiffness: it buckles, snaps or softens), with loads and supports that do not follow it. Of several "
                        "equilibria statics has found this one: a small load across leads away from it, dynamics follows the body"
                    }
        return {}


_KNOWS = "its kinematics of small rotations knows nothing of that. saint_venant_kirchhoff(E, nu, density), of finite strain, does"


def _pressed(model: Model, share: float, body: int) -> dict[str, str]:
    if body < 0:
        return {}
    stress = f"the stress of body {model.deformable[body].name!r}"
    if share < 1:
        small = f"what bends it across is too small by {100 * share / (1 - share):.0f} %"
        return {"buckling": f"{stress} is {100 * share:.2g} % of what buckles it: {small}, since {_KNOWS}"}
    return {"buckled": f"{stress} presses it {share:.3g} times as much as what buckles it: it would not stay where it is; {_KNOWS}"}


def _drawn(model: Model, share: float, body: int) -> dict[str, str]:
    if body < 0:
        return {}
    large = f"holds it straight, so that what bends it across is too large by some {100 * share:.0f} %"
    return {"drawn": f"the tension in body {model.deformable[body].name!r} {large}: {_KNOWS}"}


def _of_laws(step: Step) -> dict[int, FloatArray]:
    """Stresses (nc, 6) [Pa] of the bodies of laws of points whose rotation strains them, by their numbers."""
    model = step.model
    if all(group.laws is None or group.rotates for group in model.groups):
        return {}
    found = model.nonlinear.at_cells(step.state.x, step.state.internal, step.state.t)
    return {int(b): inner.stress[k] for group, inner, _ in found if not group.rotates for k, b in enumerate(group.members)}


def _still(step: Step) -> bool:
    return not step.scheme.timing.moving or step.energy.kinetic < STILL * step.energy.elastic


def _displacement(step: Step, group: Group, body: int) -> FloatArray:
    """Displacements (nn, d) [m] of a body that strain it."""
    begin = int(step.model.node_offset[body])
    return step.model.strained_displacement(step.state.x)[begin : begin + len(group.part.points)]


def _firm(step: Step, body: int) -> sp.csr_array:
    """Directions (n_part, m), along the supports' axes, in which contacts hold a body."""
    model, r = step.model, step.result.r.reshape(len(step.contacts), step.encounter.rows)
    kept = np.zeros_like(r, dtype=bool)
    d = step.contacts.dimension
    kept[:, :d] = sticking(step.contacts.mu, r[:, :d])[:, None]
    kept[:, 0] = r[:, 0] > 0
    H = step.encounter.acting_H
    H = sp.csr_array(H if model.axes_matrix is None else model.axes_matrix @ H)
    rows = sp.csr_array(H[int(model.dof_offset[body]) : int(model.dof_offset[body + 1])])
    own = rows[:, np.flatnonzero(kept.ravel())]
    return sp.csr_array(own[:, np.flatnonzero(np.diff(sp.csc_array(own).indptr))])


def _definite(group: Group, K: sp.csr_array, held: sp.csr_array) -> bool:
    """Whether a body's tangent K (n_part, n_part), in world axes, is positive definite where contacts hold it."""
    T, free = group.axes_matrix, ~group.driven
    K = sp.csr_array(sp.csr_array(K if T is None else T @ K @ T.T)[free][:, free])
    rows = sp.csr_array(held[free])
    return positive_definite(sp.csr_array(K + FIRM * K.diagonal().max() * (rows @ rows.T)))
