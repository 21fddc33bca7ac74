"""The tangent of contact at an iterate of Newton's method: B = -d(H r)/dx, and E, by which gaps and slips change beyond H."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.timestep.encounter import Anew
from fcsim.timestep.step_equation.contact_tangent.slopes import contact_slopes
from fcsim.timestep.step_equation.contact_tangent.stiffness import by_formulas, contact_stiffness
from fcsim.timestep.step_equation.equation import Equation

type Tangent = tuple[sp.csr_array | None, tuple[sp.csr_array, FloatArray] | None]
"""B (n_dofs, n_dofs), None where there is none; E of the pressed contacts with the velocity there, None where gaps close along normals."""


def tangent_by_formulas(equation: Equation, anew: Anew, v: FloatArray, r: FloatArray) -> Tangent:
    """B of points on facets with their own normals at the velocities v and reactions r, without E."""
    met, model = equation.met, equation.model
    return contact_stiffness(model, met.contacts, met.reaction(r), model.advance(equation.state.x, v)), None


def tangent_by_differences(equation: Equation, anew: Anew, v: FloatArray, r: FloatArray) -> Tangent:
    """B and E by differences of the detection; nothing where formulas are exact."""
    met, model, x = equation.met, equation.model, equation.model.advance(equation.state.x, v)
    reaction = met.reaction(r)
    if by_formulas(model, met.contacts, reaction, x):
        return None, None
    detection, d = anew.detection, met.contacts.dimension
    those = np.flatnonzero(np.any(reaction.reshape(-1, d) != 0, axis=1))
    pressed = met.contacts.take(those)
    force = np.einsum("aij,ai->aj", pressed.frame, reaction.reshape(-1, d)[those])
    motion = model.node_velocity(v, x)
    slopes = contact_slopes(detection, pressed, force, motion, anew.joined, model.positions(x))
    if slopes is None:
        return None, None
    B, E = slopes
    bent = sp.csr_array(model.contact_matrix(model.contact_matrix(B, x).T, x).T)
    if met.terms.scale is not None:
        return bent, None
    rows = (d * those[:, None] + np.arange(d)).ravel()
    columns = sp.csr_array((np.ones(len(rows)), (np.arange(len(rows)), rows)), shape=(len(rows), d * len(met.contacts)))
    return bent, (sp.csr_array(model.contact_matrix(E, x) @ columns), v)
