"""Plasticity of von Mises with isotropic and kinematic hardening: small strain, and multiplicative finite strain.

Small strain, radial return (J. C. Simo, T. J. R. Hughes, Computational inelasticity, 1998, box 3.2): with the deviator s of the trial
stress,
xi = s - back stress, n = xi / |xi|, equivalent stress q = sqrt(3/2) |xi|

    q - (3 mu + H_k) e = sigma_y(alpha + e),  d eps_p = sqrt(3/2) e n,  d back = sqrt(2/3) H_k e n,  d alpha = e
    C = K 1 (x) 1 + 2 mu t (I - 1 (x) 1 / 3) - 2 mu (t - 1 + 3 mu / (3 mu + H_k + sigma_y')) n (x) n,  t = 1 - 3 mu e / q

Finite strain: F = F_e F_p, the same return in the logarithms of the principal elastic stretches, whose trial values are those of
b = F C_p^-1 F^T; volume stays elastic (J. C. Simo, CMAME 99 (1992) 61-112; G. Weber, L. Anand, CMAME 79 (1990) 173-202).
Stored are the elastic energy and that of the back stress; the rest of the plastic work is dissipated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.material.hardening import Hardening, as_hardening, plastic_flow
from fcsim.mesh.material.law import PAIR, Circumstances, Response, Variable
from fcsim.mesh.material.linear import Material, lame

_I = np.eye(3)
_DEVIATOR = 0.5 * (np.einsum("ik,jl->ijkl", _I, _I) + np.einsum("il,jk->ijkl", _I, _I)) - np.einsum("ij,kl->ijkl", _I, _I) / 3
_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 1, 2]), np.array([0, 1, 2, 1, 2, 0])


@dataclass(frozen=True)
class Plastic:
    """Elastic-plastic material of small strain: E [Pa], nu, density [kg/m^3], yield stress [Pa] or `Hardening`, kinematic [Pa] H_k of
    Prager.

    Internal variables: plastic_strain (6) and back_stress (6) in the order xx, yy, zz, xy, yz, zx, equivalent_plastic_strain.
    """

    E: float
    nu: float
    density: float
    hardening: Hardening | float
    kinematic: float = 0.0

    def __post_init__(self) -> None:
        _refuse("Plastic", self.E, self.nu, self.density, self.hardening)
        if not (is_number(self.kinematic) and self.kinematic >= 0):
            raise InputError(f"Plastic, kinematic: expected a modulus >= 0 in Pa, got {shown(self.kinematic)}")

    @property
    def strain(self) -> Literal["finite", "small"]:
        return "small"

    @property
    def variables(self) -> tuple[Variable, ...]:
        return Variable("plastic_strain", 6), Variable("back_stress", 6), Variable("equivalent_plastic_strain")

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        mu, K, H = *_moduli(self.E, self.nu), self.kinematic
        plastic, back, alpha = before[:, PAIR], before[:, 6 + PAIR], before[:, 12]
        volume = np.trace(strain, axis1=1, axis2=2)
        elastic = strain - plastic
        s = 2 * mu * (elastic - np.trace(elastic, axis1=1, axis2=2)[:, None, None] / 3 * _I)
        xi = s - back
        q = np.sqrt(1.5 * np.einsum("nij,nij->n", xi, xi))
        hardening = as_hardening(self.hardening)
        e, flows = plastic_flow(q, 3 * mu + H, hardening, alpha)
        n = xi * (np.sqrt(1.5) / np.where(q > 0, q, 1.0))[:, None, None]
        flow = (np.sqrt(1.5) * e)[:, None, None] * n
        moved = 2 / 3 * H * flow
        s = s - 2 * mu * flow
        after = np.concatenate([(plastic + flow)[:, _ROWS, _COLUMNS], (back + moved)[:, _ROWS, _COLUMNS], (alpha + e)[:, None]], axis=1)
        held = _squares(back + moved) / (4 / 3 * H) if H else np.zeros_like(q)
        held_before = _squares(back) / (4 / 3 * H) if H else np.zeros_like(q)
        energy = 0.5 * K * volume**2 + _squares(s) / (4 * mu) + held
        dissipated = np.einsum("nij,nij->n", s, flow) - (held - held_before)
        stress = s + (K * volume)[:, None, None] * _I
        A = None
        if tangent:
            t = 1 - 3 * mu * e / np.where(q > 0, q, 1.0)
            along = np.where(flows, t - 1 + 3 * mu / (3 * mu + H + hardening.slope(alpha + e)), 0.0)
            A = K * np.einsum("ij,kl->ijkl", _I, _I) + (2 * mu * t)[:, None, None, None, None] * _DEVIATOR
            A = A - np.einsum("n,nij,nkl->nijkl", 2 * mu * along, n, n, optimize=True)
        return Response(stress, A, energy, dissipated, after)


@dataclass(frozen=True)
class FinitePlastic:
    """Elastic-plastic material of finite strain: E [Pa], nu (of Hencky's elasticity in logarithmic strains), density, yield stress of
    Kirchhoff's stress [Pa] or `Hardening`.

    Internal variables: plastic_metric (6), C_p^-1 in the order xx, yy, zz, xy, yz, zx, equivalent_plastic_strain.
    """

    E: float
    nu: float
    density: float
    hardening: Hardening | float

    def __post_init__(self) -> None:
        _refuse("FinitePlastic", self.E, self.nu, self.density, self.hardening)

    @property
    def strain(self) -> Literal["finite", "small"]:
        return "finite"

    @property
    def variables(self) -> tuple[Variable, ...]:
        return Variable("plastic_metric", 6, (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)), Variable("equivalent_plastic_strain")

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        mu, K = _moduli(self.E, self.nu)
        F, metric, alpha = strain, before[:, PAIR], before[:, 6]
        usable = (np.linalg.det(F) > 0) & np.isfinite(F).all(axis=(1, 2))
        F = np.where(usable[:, None, None], F, _I)
        transposed = F.transpose(0, 2, 1)
        squares, n = np.linalg.eigh(F @ metric @ transposed)  # b_a, its directions as columns
        usable &= squares[:, 0] > 0
        squares = np.where(usable[:, None], squares, 1.0)
        logs = 0.5 * np.log(squares)
        volume = logs.sum(axis=1)
        deviator = 2 * mu * (logs - volume[:, None] / 3)
        q = np.sqrt(1.5 * (deviator**2).sum(axis=1))
        hardening = as_hardening(self.hardening)
        e, flows = plastic_flow(q, 3 * mu, hardening, alpha)
        direction = np.sqrt(1.5) * deviator / np.where(q > 0, q, 1.0)[:, None]  # unit vectors
        flow = np.sqrt(1.5) * e[:, None] * direction
        deviator = deviator - 2 * mu * flow
        tau = deviator + (K * volume)[:, None]
        inverse = np.linalg.inv(F)
        elastic = np.einsum("nia,na,nja->nij", n, np.exp(2 * (logs - flow)), n, optimize=True)
        new = inverse @ elastic @ inverse.transpose(0, 2, 1)
        after = np.concatenate([new[:, _ROWS, _COLUMNS], (alpha + e)[:, None]], axis=1)
        energy = 0.5 * K * volume**2 + (deviator**2).sum(axis=1) / (4 * mu)
        dissipated = (deviator * flow).sum(axis=1)
        kirchhoff = np.einsum("nia,na,nja->nij", n, tau, n, optimize=True)
        P = np.where(usable[:, None, None], kirchhoff @ inverse.transpose(0, 2, 1), np.nan)
        A = None
        if tangent:
            t = 1 - 3 * mu * e / np.where(q > 0, q, 1.0)
            along = np.where(flows, t - 1 + 3 * mu / (3 * mu + hardening.slope(alpha + e)), 0.0)
            D = (
                K
                + (2 * mu * t)[:, None, None] * (_I - 1 / 3)
                - (2 * mu * along)[:, None, None] * direction[:, :, None] * direction[:, None]
            )
            A = _tangent(F, inverse, metric, squares, n, tau, D, kirchhoff)
        return Response(P, A, energy, dissipated, after)


def _tangent(
    F: FloatArray,
    inverse: FloatArray,
    metric: FloatArray,
    squares: FloatArray,
    n: FloatArray,
    tau: FloatArray,
    D: FloatArray,
    T: FloatArray,
) -> FloatArray:
    """dP/dF of P = tau F^-T, tau an isotropic function of b = F metric F^T with dtau_a / d(ln l_b) = D_ab; T (n, 3, 3): tau itself."""
    by_squares = D / (2 * squares[:, None])  # dtau_a / db_b
    difference = squares[:, :, None] - squares[:, None]
    near = np.abs(difference) < 1e-6 * (squares[:, :, None] + squares[:, None])
    diagonal = np.einsum("naa->na", by_squares)
    limit = 0.5 * (diagonal[:, :, None] + diagonal[:, None] - by_squares - by_squares.transpose(0, 2, 1))
    divided = np.where(near, limit, (tau[:, :, None] - tau[:, None]) / np.where(near, 1.0, difference))
    own = np.zeros((len(F), 3, 3, 3, 3))
    for a in range(3):
        for b in range(3):
            if a == b:
                own[:, a, a, range(3), range(3)] = by_squares[:, a]
            else:
                own[:, a, b, a, b] = 0.5 * divided[:, a, b]
                own[:, a, b, b, a] = 0.5 * divided[:, a, b]
    basis = np.einsum("nia,njb->nabij", n, n).reshape(-1, 9, 9)
    by_b = (basis.transpose(0, 2, 1) @ own.reshape(-1, 9, 9) @ basis).reshape(-1, 3, 3, 3, 3)  # dtau_ij / db_kl
    MFt = metric @ F.transpose(0, 2, 1)  # db_kl = dF_kM MFt_Ml + the transposed
    dtau = 2 * (by_b.reshape(-1, 27, 3) @ MFt.transpose(0, 2, 1)).reshape(-1, 3, 3, 3, 3)  # [i, j, k, M]
    A = np.einsum("nijkM,nJj->niJkM", dtau, inverse, optimize=True)
    P = T @ inverse.transpose(0, 2, 1)
    return A - np.einsum("niM,nJk->niJkM", P, inverse)


def _refuse(what: str, E: float, nu: float, density: float, hardening: Hardening | float) -> None:
    try:
        Material(E, nu, density)
    except InputError as error:
        raise InputError(str(error).replace("Material", what)) from None
    if is_number(hardening, infinite=True):
        if not 0 < hardening < np.inf:
            raise InputError(f"{what}, hardening: expected a yield stress > 0 in Pa, or a Hardening, got {hardening}")
    elif not (hasattr(hardening, "stress") and hasattr(hardening, "slope")):
        raise InputError(f"{what}, hardening: expected a yield stress in Pa or a Hardening, got {type(hardening).__name__}")


def _moduli(E: float, nu: float) -> tuple[float, float]:
    """Shear and bulk modulus [Pa]."""
    first, mu = lame(E, nu)
    return mu, first + 2 / 3 * mu


def _squares(s: FloatArray) -> FloatArray:
    result: FloatArray = np.einsum("nij,nij->n", s, s)
    return result
