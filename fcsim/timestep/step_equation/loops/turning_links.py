"""Which part of the geometric stiffness of links a problem of statics has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fcsim.timestep.step_equation.equation import Equation
from fcsim.timestep.step_equation.linked_compliance import LinkedCompliance

MARGIN = 1e-3
"""Of the stiffness without it: what the whole leaves at least of every motion that links leave."""

LARGEST = 1200
"""Unknowns from which the whole is not tried, since that asks for their eigenvalues."""


def turning_links(equation: Equation) -> Equation:
    """The equation with all of B, with which the rounds of the links converge quadratically, where that leaves every motion stable that
    links do; else, and where contacts ask for W without negative eigenvalues, with its convex part: with that the rounds converge to
    stable equilibria only, and away from others, such as a pendulum on its head."""
    linked = equation.linked
    if linked is None or linked.bending is None:
        return equation
    bending = linked.bending
    if not len(equation.met.contacts) and _stable(equation):
        return equation
    convex = None if bending.convex is None else bending._replace(B=bending.convex, whole=False)
    return replace(equation, linked=replace(linked, bending=convex))


def _stable(equation: Equation) -> bool:
    """Whether A + B is positive on the motions that the links leave: I + L^T B L with L L^T the compliance, links kept, of what B
    touches."""
    assert equation.linked is not None
    bent = equation.of_bodies.bent
    if bent is None:
        return False
    touched = np.unique(sp.coo_array(bent).coords[0])
    if not 0 < len(touched) <= LARGEST:
        return False
    d = equation.model.dimension
    plain = replace(equation, linked=replace(equation.linked, bending=None)).compliance
    assert isinstance(plain, LinkedCompliance)
    size = plain.unknowns
    columns = sp.csc_array((np.ones(len(touched)), (touched, np.arange(len(touched)))), shape=(size, len(touched) + -len(touched) % d))
    C = plain.delassus(columns, d)
    C = (C if isinstance(C, np.ndarray) else C.toarray())[: len(touched), : len(touched)]
    values, vectors = np.linalg.eigh(0.5 * (C + C.T))
    L = vectors * np.sqrt(np.maximum(values, 0.0))
    B = bent[touched][:, touched].toarray()
    return bool(np.linalg.eigvalsh(np.eye(len(L)) + L.T @ B @ L)[0] > MARGIN)
