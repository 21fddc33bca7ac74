"""Every law of points as one of finite strain: F -> P, dP/dF.

    "linear"   eps = sym F - 1, P = sigma: small strain and small rotation
    "turning"  E = (F^T F - 1) / 2 in the place of eps, P = F S: small strain, any rotation, no stress from rotation
    finite     as the law says
    plane stress: F_33 such that P_33 = 0 (small strain: eps_33, sigma_33), by Newton's method in each point; an internal variable keeps it

Source: J. Bonet, R. D. Wood, Nonlinear continuum mechanics for finite element analysis, 2008, chapters 4 to 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.mesh.material.law import Circumstances, PointLaw, Response, Variable

_I = np.eye(3)


@dataclass(frozen=True, eq=False)
class InStrain:
    """A law of small strain asked with F: of small rotation too, or (turning) by Green and Lagrange's strain."""

    law: PointLaw
    turning: bool

    @property
    def density(self) -> float:
        return self.law.density

    @property
    def strain(self) -> Literal["finite", "small"]:
        return "finite"

    @property
    def variables(self) -> tuple[Variable, ...]:
        return self.law.variables

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        F = strain
        transposed = F.transpose(0, 2, 1)
        if not self.turning:
            return self.law.respond(0.5 * (F + transposed) - _I, before, at, tangent)
        answer = self.law.respond(0.5 * (transposed @ F - _I), before, at, tangent)
        S, A = answer.stress, None
        if answer.tangent is not None:
            n = len(F)
            CF = (answer.tangent.reshape(n, 27, 3) @ transposed).reshape(n, 3, 3, 3, 3)  # [M, J, L, k], since C has minor symmetries
            A = (F @ CF.reshape(n, 3, 27)).reshape(n, 3, 3, 3, 3).swapaxes(3, 4).copy()
            for i in range(3):
                A[:, i, :, i, :] += S
        return Response(F @ S, A, answer.energy, answer.dissipated, answer.variables)


PLANE_STRESS_ITERATIONS = 30


@dataclass(frozen=True, eq=False)
class PlaneStress:
    """A law without stress across the plane: F_33 (small strain: eps_33) is found, and remembered as its last internal variable."""

    law: PointLaw

    @property
    def density(self) -> float:
        return self.law.density

    @property
    def strain(self) -> Literal["finite", "small"]:
        return self.law.strain

    @property
    def variables(self) -> tuple[Variable, ...]:
        return (*self.law.variables, Variable("across", 1, 1.0 if self.law.strain == "finite" else 0.0))

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        inner, across = before[:, :-1], before[:, -1].copy()
        strain = strain.copy()
        open_points = np.ones(len(strain), dtype=bool)
        for _ in range(PLANE_STRESS_ITERATIONS):
            strain[:, 2, 2] = across
            answer = self.law.respond(strain, inner, at, True)
            assert answer.tangent is not None
            stiffness = answer.tangent[:, 2, 2, 2, 2]
            size = np.abs(answer.stress).max(axis=(1, 2)) + 1e-6 * np.abs(stiffness)
            open_points = np.abs(answer.stress[:, 2, 2]) > 1e-13 * size
            if not open_points.any():
                break
            with np.errstate(invalid="ignore", divide="ignore"):
                change = np.where(open_points, -answer.stress[:, 2, 2] / stiffness, 0.0)
            across = across + (np.clip(change, -0.5 * across, across) if self.law.strain == "finite" else change)
        stress = np.where(
            open_points[:, None, None] & (np.abs(answer.stress[:, 2:, 2:]) > 1e-8 * size[:, None, None]), np.nan, answer.stress
        )
        A = None
        if tangent and answer.tangent is not None:
            outer = np.einsum("nij,nkl->nijkl", answer.tangent[..., 2, 2], answer.tangent[:, 2, 2])
            A = answer.tangent - outer / stiffness[:, None, None, None, None]
        variables = np.concatenate([answer.variables, across[:, None]], axis=1)
        return Response(stress, A, answer.energy, answer.dissipated, variables)
