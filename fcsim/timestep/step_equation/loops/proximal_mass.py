"""Statics of turning bodies whose stress is all that holds them, hanging on two balls: a mass of their own on the way to their answer.

The iterations of `linearisation` with A = M + S have F(x(v)) right and the stiffness of its rotation not: where A has less against a
rotation than that, as eta has alone, they do not settle. With A + s m in place of A, m the deformable bodies' mass, and s m v_i at the
iterate v_i beside the load, their answer is the same, and they settle where s m has more (a proximal point, R. T. Rockafellar, SIAM J.
Control Optim. 14, 1976), as far as bodies turn by some degrees in a step: S turns with them at its beginning alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fcsim.assembly.compliance import SystemFactor
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.step_equation.equation import Equation

TIMES = 100.0
"""Of the stiffness that the forces on a body may have against its turning: s m r^2 for the radii of gyration of bodies smaller than the
model, at least."""


def with_proximal_mass(equation: Equation, system: Callable[[Scheme], SystemFactor]) -> Equation | None:
    """The equation with such a mass, s by the forces on the bodies over their mass and the model's size; None in dynamics, without
    turning bodies, where it has one already, or eta that is as large. system: the factor of a scheme's matrix."""
    model, scheme, elastic = equation.model, equation.scheme, equation.elastic
    if not isinstance(scheme, QuasiStatic) or elastic.rotation is None or elastic.proximal_mass:
        return None
    d, along = model.dimension, np.zeros(model.n_dofs)
    along[: model.n_elastic : d] = 1.0
    mass = float(along @ model.apply_mass(along, 0.0 * equation.factor.rigid_mass))
    force = float(np.linalg.norm(equation.rest[: model.n_elastic].reshape(-1, d), axis=1).sum())
    own, size = scheme.eta / scheme.h**2, float(np.ptp(model.reference, axis=0).max())
    if TIMES * force <= own * mass * size:
        return None
    s = 10.0 ** np.ceil(np.log10(TIMES * force / (mass * size)))  # few different ones, each of which has a factor
    factor = system(replace(scheme, eta=s * scheme.h**2)).with_rigid_mass(equation.factor.rigid_mass * (own / s))
    return replace(equation, factor=factor.turned(elastic.rotation), elastic=replace(elastic, proximal_mass=float(s - own)))
