"""Ready energies: St. Venant-Kirchhoff, neo-Hooke in two forms, Mooney-Rivlin, Ogden; densities in kg/m^3, moduli in Pa.

Each is a `Hyperelastic` (Ogden: `OfStretches`) like any user's; I1bar = J^(-2/3) tr C, I2bar = J^(-4/3) (tr^2 C - tr C^2) / 2.
Source: G. A. Holzapfel, Nonlinear solid mechanics, 2000, chapter 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING

from fcsim.arrays import is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.material.hyperelastic import Hyperelastic, OfStretches
from fcsim.mesh.material.linear import Material, lame

if TYPE_CHECKING:
    from ufl.core.expr import Expr


def saint_venant_kirchhoff(E: float, nu: float, density: float) -> Hyperelastic:
    """W = lambda/2 (tr E)^2 + mu E : E, E = (F^T F - 1) / 2: small strain, any rotation; no use in strong compression, where it softens."""
    return Hyperelastic(_saint_venant_kirchhoff, density, _lame("saint_venant_kirchhoff", E, nu, density))


def neo_hooke(E: float, nu: float, density: float) -> Hyperelastic:
    """W = mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2, compressible (P. Wriggers)."""
    return Hyperelastic(_neo_hooke, density, _lame("neo_hooke", E, nu, density))


def neo_hooke_isochoric(mu: float, K: float, density: float) -> Hyperelastic:
    """W = mu/2 (I1bar - 3) + K/4 (J^2 - 1 - 2 ln J), shear modulus mu and bulk modulus K: volume and shape apart (J. C. Simo)."""
    _positive("neo_hooke_isochoric", mu=mu, K=K)
    return Hyperelastic(_neo_hooke_isochoric, density, {"mu": mu, "K": K})


def mooney_rivlin(C10: float, C01: float, K: float, density: float) -> Hyperelastic:
    """W = C10 (I1bar - 3) + C01 (I2bar - 3) + K/2 (J - 1)^2; shear modulus 2 (C10 + C01)."""
    _positive("mooney_rivlin", **{"C10 + C01": C10 + C01, "K": K})
    return Hyperelastic(_mooney_rivlin, density, {"C10": C10, "C01": C01, "K": K})


def ogden(mu: Sequence[float], alpha: Sequence[float], K: float, density: float) -> OfStretches:
    """W = sum_i 2 mu_i / alpha_i^2 (lbar_1^alpha_i + lbar_2^alpha_i + lbar_3^alpha_i - 3) + K/2 (J - 1)^2, lbar = J^(-1/3) l; mu_i sum to
    the
    shear modulus (the convention of Abaqus; R. W. Ogden's own mu_i are 2 mu_i / alpha_i)."""
    if len(mu) != len(alpha) or not len(mu):
        raise InputError(f"ogden: expected as many mu as alpha, at least one, got {len(mu)} and {len(alpha)}")
    if any(a == 0 for a in alpha):
        raise InputError(f"ogden: expected exponents alpha that are not 0, got {tuple(alpha)}")
    _positive("ogden", **{"sum of mu": sum(mu), "K": K})
    numbers = {f"mu{i}": m for i, m in enumerate(mu)} | {f"alpha{i}": a for i, a in enumerate(alpha)} | {"K": K}
    return OfStretches(_ogden(len(mu)), density, numbers)


def _lame(what: str, E: float, nu: float, density: float) -> dict[str, float]:
    try:
        Material(E, nu, density)
    except InputError as error:
        raise InputError(str(error).replace("Material", what)) from None
    first, second = lame(E, nu)
    return {"lambda": first, "mu": second}


def _positive(what: str, **values: float) -> None:
    for name, value in values.items():
        if not (is_number(value) and value > 0):
            raise InputError(f"{what}: expected {name} > 0 in Pa, got {shown(value)}")


def _saint_venant_kirchhoff(F: Expr, p: Mapping[str, Expr]) -> Expr:
    import ufl

    E = 0.5 * (F.T * F - ufl.Identity(3))
    return 0.5 * p["lambda"] * ufl.tr(E) ** 2 + p["mu"] * ufl.inner(E, E)


def _neo_hooke(F: Expr, p: Mapping[str, Expr]) -> Expr:
    import ufl

    ln_J = ufl.ln(ufl.det(F))
    return 0.5 * p["mu"] * (ufl.inner(F, F) - 3) - p["mu"] * ln_J + 0.5 * p["lambda"] * ln_J**2


def _neo_hooke_isochoric(F: Expr, p: Mapping[str, Expr]) -> Expr:
    import ufl

    J = ufl.det(F)
    return 0.5 * p["mu"] * (J ** (-2 / 3) * ufl.inner(F, F) - 3) + 0.25 * p["K"] * (J**2 - 1 - 2 * ufl.ln(J))


def _mooney_rivlin(F: Expr, p: Mapping[str, Expr]) -> Expr:
    import ufl

    J, C = ufl.det(F), F.T * F
    I1, I2 = ufl.tr(C), 0.5 * (ufl.tr(C) ** 2 - ufl.inner(C, C))
    return p["C10"] * (J ** (-2 / 3) * I1 - 3) + p["C01"] * (J ** (-4 / 3) * I2 - 3) + 0.5 * p["K"] * (J - 1) ** 2


@cache
def _ogden(terms: int) -> Callable[[Expr, Mapping[str, Expr]], Expr]:
    def energy(l: Expr, p: Mapping[str, Expr]) -> Expr:
        J = l[0] * l[1] * l[2]
        W = 0.5 * p["K"] * (J - 1) ** 2
        for i in range(terms):
            mu, alpha = p[f"mu{i}"], p[f"alpha{i}"]
            W += 2 * mu / alpha**2 * (J ** (-alpha / 3) * (l[0] ** alpha + l[1] ** alpha + l[2] ** alpha) - 3)
        return W

    return energy
