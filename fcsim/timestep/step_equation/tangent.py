"""The tangent of contact at an iterate of Newton's method: B = -d(H r)/dx, and E, by which gaps and slips change beyond H."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray
from fcsim.timestep.encounter import Redetection
from fcsim.timestep.step_equation.contact_tangent.slopes import contact_slopes
from fcsim.timestep.step_equation.contact_tangent.stiffness import by_formulas, contact_stiffness
from fcsim.timestep.step_equation.equation import Equation

STICKS = 1e-3
"""By how much less than its limit the friction of a contact that sticks is."""

SURELY_STICKS = 0.1
"""The same of contacts whose slip is held by a stiffness, which pulls at those that slip after all: reactions that are carried on as
vectors in space leave the cone's edge by the angle that facets turn in an iteration, and a contact that slips would stick and slip in
turns."""

HELD = (30.0, 300.0, 3000.0)
"""Stiffness that is given to pressed contacts, of the largest entry of their geometric stiffness: the first that serves is taken."""

type Tangent = tuple[sp.csr_array | None, tuple[sp.csr_array, FloatArray] | None]
"""B (n_dofs, n_dofs), None where there is none; E of the pressed contacts with the velocity there, None where gaps close along normals."""


def tangent_by_formulas(equation: Equation, anew: Redetection, v: FloatArray, r: FloatArray) -> Tangent:
    """B of points on facets with their own normals at the velocities v and reactions r, without E."""
    met, model = equation.met, equation.model
    return contact_stiffness(model, met.contacts, met.reaction(r), model.advance(equation.state.x, v)), None


def tangent_by_differences(equation: Equation, anew: Redetection, v: FloatArray, r: FloatArray) -> Tangent:
    """B and E by differences of the detection; nothing where formulas are exact, and in space where they leave out how slips change."""
    met, model, x = equation.met, equation.model, equation.model.advance(equation.state.x, v)
    reaction = met.reaction(r)
    if by_formulas(model, met.contacts, reaction, x) and not _sticks_in_the_plane(met.contacts.mu, r.reshape(-1, met.rows)):
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


def sticking(mu: FloatArray, r: FloatArray, less: float = STICKS) -> BoolArray:
    """Which contacts press and stick, by their reactions r (nc, rows); less: see `STICKS`."""
    stick: BoolArray = np.linalg.norm(r[:, 1:], axis=1) < (1 - less) * mu * r[:, 0]
    return stick


def made_positive(
    equation: Equation, bent: sp.csr_array, v: FloatArray, r: FloatArray, largest: float
) -> tuple[Equation, FloatArray] | None:
    """The equation with B = bent, and with g H_a (H_a^T v + w_a) for the rows a of contacts that press or stick by r (m,) where B alone
    costs A + B its positive definiteness, and what B and that add to the right side (n_dofs,); None where neither is positive.

    v (n_dofs,): of the iterate; largest [N/m]: entry of the geometric stiffness, of which g is `HELD`."""
    met = equation.met
    of_contact = r.reshape(-1, met.rows)
    kept = np.repeat(sticking(met.contacts.mu, of_contact, SURELY_STICKS)[:, None], met.rows, axis=1)
    kept[:, 0] = of_contact[:, 0] > 0
    pressed = np.flatnonzero(kept)
    normal = sp.csr_array(met.scaled_H[:, pressed])
    for held in (0.0, *(times * largest for times in HELD)):
        bending = replace(equation, bent=bent + held * (normal @ normal.T), slanted=None) if held else replace(equation, bent=bent)
        own = bending.of_bodies
        if own.bent is not None and bending.bent is not None and own.positive:
            return bending, bending.bent @ v - held * (normal @ (normal.T @ v + met.w[pressed])) if held else bent @ v
    return None


def _sticks_in_the_plane(mu: FloatArray, r: FloatArray) -> bool:
    """Whether the slips of contacts in the plane bind: those that press and stick, by r (nc, 2).

    Slips change as frames turn and weights move, which no formula says here. In space that is left out: differences took
    four times the time on a punch that is drawn along a bed, and saved nothing."""
    return r.shape[1] == 2 and bool(np.any(sticking(mu, r)))
