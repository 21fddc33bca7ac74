"""Linear viscoelasticity of small strain by a Prony series: springs and dashpots in shear, elastic volume.

G(t) = G_0 (1 - sum_i g_i (1 - exp(-t / tau_i))). With the deviator e of the strain and the part h_i of it that the i-th spring holds

    s = 2 G_0 [(1 - sum g_i) e + sum g_i h_i],  h_i' = e' - h_i / tau_i

which is integrated exactly for a strain that changes linearly over the step; stored is what the springs hold, dissipated what the
dashpots take, 2 G_0 g_i / tau_i times the integral of h_i : h_i, exact and never negative.
Source: J. C. Simo, T. J. R. Hughes, Computational inelasticity, 1998, section 10.3 (their recurrence, for stresses).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.material.law import PAIR, Circumstances, Response, Variable
from fcsim.mesh.material.linear import Material, lame

_I = np.eye(3)
_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 1, 2]), np.array([0, 1, 2, 1, 2, 0])


@dataclass(frozen=True)
class Viscoelastic:
    """E [Pa] and nu of quick strains, density [kg/m^3]; prony: pairs (g_i, tau_i [s]) of the shear modulus, sum of g_i < 1.

    Internal variables: strain (6), the deviator at the end of the last step, and held_i (6) of each term.
    """

    E: float
    nu: float
    density: float
    prony: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        try:
            Material(self.E, self.nu, self.density)
        except InputError as error:
            raise InputError(str(error).replace("Material", "Viscoelastic")) from None
        terms = numbers_of(self.prony)
        if terms.ndim != 2 or terms.shape[1:] != (2,) or not np.all(terms > 0) or not np.all(np.isfinite(terms)) or terms[:, 0].sum() >= 1:
            got = shown(self.prony)
            raise InputError(f"Viscoelastic, prony: expected pairs (g > 0, tau > 0 in s) with the sum of g below 1, got {got}")

    @property
    def strain(self) -> Literal["finite", "small"]:
        return "small"

    @property
    def variables(self) -> tuple[Variable, ...]:
        return Variable("strain_deviator", 6), *(Variable(f"held_{i}", 6) for i in range(len(self.prony)))

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        first, G = lame(self.E, self.nu)
        K = first + 2 / 3 * G
        volume = np.trace(strain, axis1=1, axis2=2)
        e = strain - volume[:, None, None] / 3 * _I
        change = e - before[:, PAIR]
        lasting = 1 - sum(g for g, _ in self.prony)
        s, energy, dissipated = 2 * G * lasting * e, 0.5 * K * volume**2 + G * lasting * _squares(e), np.zeros(len(e))
        stiffness, after = lasting, [e[:, _ROWS, _COLUMNS]]
        for i, (g, tau) in enumerate(self.prony):
            h = before[:, 6 * (i + 1) + PAIR]
            x = at.dt / tau
            decay, share = float(np.exp(-x)), float(-np.expm1(-x) / x) if x > 0 else 1.0
            new = decay * h + share * change
            s, energy, stiffness = s + 2 * G * g * new, energy + G * g * _squares(new), stiffness + g * share
            if x > 0:
                steady = change / x
                rest = h - steady
                integral = (
                    x * _squares(steady) + 2 * (1 - decay) * np.einsum("nij,nij->n", steady, rest) + 0.5 * (1 - decay**2) * _squares(rest)
                )
                dissipated = dissipated + 2 * G * g * np.maximum(integral, 0.0)
            after.append(new[:, _ROWS, _COLUMNS])
        A = None
        if tangent:
            unit = 0.5 * (np.einsum("ik,jl->ijkl", _I, _I) + np.einsum("il,jk->ijkl", _I, _I))
            both = np.einsum("ij,kl->ijkl", _I, _I)
            A = np.broadcast_to(K * both + 2 * G * stiffness * (unit - both / 3), (len(e), 3, 3, 3, 3))
        return Response(s + (K * volume)[:, None, None] * _I, A, energy, dissipated, np.concatenate(after, axis=1))


def _squares(a: FloatArray) -> FloatArray:
    result: FloatArray = np.einsum("nij,nij->n", a, a)
    return result
