"""The response of points between two configurations, at the mean of their strains.

A body that turns by the angle a in a step stands, halfway between both ends, shortened by a^2 / 8: a strain that is none. So forces
between the configurations 0 and 1 take the deformation gradient of the middle, F_m, for their direction, and C_m, the mean of F^T F at
both ends, for the strain:

    C_m = (1 - s) C_0 + s C_1,  U = C_m^(1/2),  S = U^-1 P(U),  P_m = F_m S

S : (C_1 - C_0) / 2 is the work of P_m at s = 1/2 exactly, so that rotation takes none; the moments of P_m vanish, since S is symmetric.
With quadratic energies of F^T F energy is kept exactly, with others to third order in the change of strain. Of elastic laws that change
is integrated more closely at s = 1/2: in points whose C changes by more than `CHANGE`, S is the mean over the way from C_0 to C_1,

    S = sum_k w_k S(C_0 + t_k (C_1 - C_0)),  t_k, w_k the points and weights of Gauss' rule,                                         (1)

which is a gradient between both ends to the order 2 `GAUSS` + 1, and has no difference of energies in it that round-off would spoil. Laws
with internal variables have the mean strain alone: theirs are those of the end of a step.

The derivative is delta S + F_m (2 dS/dC) F_1^T; in its place stands the
symmetric delta S + F_m (2 dS/dC) F_m^T, whose forces have no moment either: iterations converge at the rate of the angle a.
Source: J. C. Simo, N. Tarnow, ZAMP 43 (1992) 757-792 (for the quadratic energy); O. Gonzalez, CMAME 190 (2000) 1763-1783;
(1): G. R. W. Quispel, D. I. McLaren, "A new class of energy-preserving numerical integration methods", J. Phys. A 41, 2008.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.nonlinear.strain_measures import InStrain, PlaneStress
from fcsim.mesh.material.law import Circumstances, PointLaw, Response

CHANGE = 1e-5
"""Largest entry of C_1 - C_0 from which (1) is taken: below, it differs from S(C_m) by less than 1e-10 of the moduli."""

GAUSS = 3
"""Points of (1)."""


def respond_between(
    law: PointLaw, F: tuple[FloatArray, FloatArray, FloatArray], share: float, before: FloatArray, at: Circumstances, tangent: bool
) -> Response:
    """The response of n points with F = (F_0, F_m, F_1), each (n, 3, 3), F_m the share of the way from F_0 to F_1."""
    first, middle, last = F
    C = (1 - share) * first.transpose(0, 2, 1) @ first + share * last.transpose(0, 2, 1) @ last
    usable = np.isfinite(C).all(axis=(1, 2)) & (np.linalg.det(last) > 0) & (np.linalg.det(middle) > 0)
    U, inverse = _roots(np.where(usable[:, None, None], C, np.eye(3)))
    answer = law.respond(U, before, at, tangent)
    S = inverse @ answer.stress
    if share == 0.5 and is_elastic(law):
        _integrate(law, first, last, np.flatnonzero(usable), before, at, S)
    S = np.where(usable[:, None, None], 0.5 * (S + S.transpose(0, 2, 1)), np.nan)
    A = None
    if answer.tangent is not None:
        moduli = answer.tangent.copy()
        for i in range(3):
            moduli[:, i, :, i, :] -= S
        turned = middle @ inverse
        A = (turned @ moduli.reshape(-1, 3, 27)).reshape(moduli.shape)
        A = np.einsum("niJNL,nkN->niJkL", A, turned, optimize=True)
        for i in range(3):
            A[:, i, :, i, :] += S
    return Response(middle @ S, A, answer.energy, answer.dissipated, answer.variables)


def is_elastic(law: PointLaw) -> bool:
    """Whether the law's stress is one of the strain alone: it has no internal variables, but for what plane stress keeps."""
    while isinstance(law, InStrain | PlaneStress):
        law = law.law
    return not law.variables


def _integrate(
    law: PointLaw, first: FloatArray, last: FloatArray, usable: IntArray, before: FloatArray, at: Circumstances, S: FloatArray
) -> None:
    """(1) into S (n, 3, 3), of the usable points where it makes a difference."""
    C = first.transpose(0, 2, 1) @ first
    way = last.transpose(0, 2, 1) @ last - C
    some = usable[np.abs(way[usable]).max(axis=(1, 2), initial=0.0) > CHANGE]
    if not len(some):
        return
    here = Circumstances(at.X[some], at.t, at.dt)
    points, weights = np.polynomial.legendre.leggauss(GAUSS)
    total = np.zeros((len(some), 3, 3))
    for t, w in zip(0.5 + 0.5 * points, 0.5 * weights, strict=True):
        U, inverse = _roots(C[some] + t * way[some])
        total += w * (inverse @ law.respond(U, before[some], here, False).stress)
    S[some] = total


def _roots(C: FloatArray) -> tuple[FloatArray, FloatArray]:
    """C^(1/2) and its inverse, of C (n, 3, 3)."""
    squares, n = np.linalg.eigh(C)
    stretch = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
    transposed = n.transpose(0, 2, 1)
    return (n * stretch[:, None]) @ transposed, (n / stretch[:, None]) @ transposed
