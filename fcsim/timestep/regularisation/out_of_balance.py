"""What is said of statics that the mass regularisation holds up: eta / h^2 M dx is no force of the problem."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.kinematics.following import When
from fcsim.timestep.energy import pushing
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.step import Step

ON_THE_WAY, AT_THE_END = 0.2, 0.02
"""Share of the forces on a body from which on it is named, while loads grow and in the last step of a run."""

NONE = 1e-6
"""Of the largest forces on a body of the model: bodies with less are asked relative to that."""


def out_of_balance(step: Step, steps: int, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark, by its kind, on the body of which eta / h^2 M dx carries the largest share of the forces on it; steps: of the run."""
    scheme, last = step.scheme, step.number == steps
    kind = "out of balance at the end" if last else "out of balance"
    if not isinstance(scheme, QuasiStatic) or not scheme.eta or kind in said:
        return {}
    shares = _shares(step, scheme)
    worst = int(np.argmax(shares))
    if shares[worst] < (AT_THE_END if last else ON_THE_WAY):
        return {}
    means = "smaller steps of the loads" if not last else "more steps in which loads stand"
    return {
        kind: f"{when}: {shares[worst]:.2g} of the forces on body {step.model.bodies[worst].name!r} are carried by the mass that "
        f"regularises statics, eta = {scheme.eta:g} at h = {scheme.h:g}: it is not in equilibrium. What helps: {means}, or a smaller eta"
    }


def _shares(step: Step, scheme: QuasiStatic) -> FloatArray:
    """(nb,) Sum of the sizes of eta / h^2 M dx on a body's free dofs over that of the forces on it; moments over the body's size."""
    model, x = step.model, step.state.x
    begin = model.dof_offset[:-1]
    weight = np.ones(model.n_dofs)
    for first, end, body in zip(begin.tolist(), model.dof_offset[1:].tolist(), model.bodies, strict=True):
        if first >= model.n_elastic:
            weight[first + model.dimension : end] = 1 / max(float(np.ptp(body.points, axis=0).max(initial=0.0)), 1e-300)
    dx = scheme.h * step.state.v
    inertia = scheme.eta / scheme.h**2 * model.apply_mass(dx, model.rigid_mass(step.previous.x))
    inertia -= model.driven_share(inertia)
    contact = step.H @ step.reaction
    rigid = model.n_elastic  # the forces of contacts on it cancel each other in a body's dofs where it is squeezed
    contact[rigid:] = np.abs(step.H)[rigid:] @ np.abs(step.reaction)
    forces = [model.load(step.state.t, x) + pushing(model, x, When.at(step.state.t)), contact, step.support_impulse]
    if step.linked is not None and step.result.multiplier is not None:
        forces.append(step.linked.G @ step.result.multiplier)
    held, *others = (np.add.reduceat(weight * np.abs(force), begin) for force in (inertia, *forces))
    size = np.maximum.reduce([held, *others])
    size = np.maximum(size, NONE * float(size.max(initial=0.0)))
    return np.divide(held, size, out=np.zeros_like(held), where=size > 0)
