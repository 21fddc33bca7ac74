"""The response of points between two configurations, at the mean of their strains.

A body that turns by the angle a in a step stands, halfway between both ends, shortened by a^2 / 8: a strain that is none. So forces
between the configurations 0 and 1 take the deformation gradient of the middle, F_m, for their direction, and C_m, the mean of F^T F at
both ends, for the strain:

    C_m = (1 - s) C_0 + s C_1,  U = C_m^(1/2),  S = U^-1 P(U),  P_m = F_m S

S : (C_1 - C_0) / 2 is the work of P_m at s = 1/2 exactly, so that rotation takes none; the moments of P_m vanish, since S is symmetric.
With quadratic energies of F^T F energy is
kept exactly, with others to third order in the change of strain. The derivative is delta S + F_m (2 dS/dC) F_1^T; in its place stands the
symmetric delta S + F_m (2 dS/dC) F_m^T, whose forces have no moment either: iterations converge at the rate of the angle a.
Source: J. C. Simo, N. Tarnow, ZAMP 43 (1992) 757-792 (for the quadratic energy); O. Gonzalez, CMAME 190 (2000) 1763-1783.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.mesh.material.law import Circumstances, PointLaw, Response


def respond_between(
    law: PointLaw, F: tuple[FloatArray, FloatArray, FloatArray], share: float, before: FloatArray, at: Circumstances, tangent: bool
) -> Response:
    """The response of n points with F = (F_0, F_m, F_1), each (n, 3, 3), F_m the share of the way from F_0 to F_1."""
    first, middle, last = F
    C = (1 - share) * first.transpose(0, 2, 1) @ first + share * last.transpose(0, 2, 1) @ last
    usable = np.isfinite(C).all(axis=(1, 2)) & (np.linalg.det(last) > 0) & (np.linalg.det(middle) > 0)
    squares, n = np.linalg.eigh(np.where(usable[:, None, None], C, np.eye(3)))
    stretch = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
    U = (n * stretch[:, None]) @ n.transpose(0, 2, 1)
    inverse = (n / stretch[:, None]) @ n.transpose(0, 2, 1)
    answer = law.respond(U, before, at, tangent)
    S = inverse @ answer.stress
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
