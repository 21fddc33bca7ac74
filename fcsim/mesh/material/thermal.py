"""Thermal strain: a material that expands with a temperature that is given as a field and function of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.material.law import AnyMaterial, Circumstances, LinearLaw, LinearMaterial, PointLaw, Response, Variable


@dataclass(frozen=True, eq=False)
class Thermal:
    """`material` with the expansion [1/K] for a temperature above the stress-free one: temperature(X, t) [K], (n,) at points X (n, 3) [m]
    in the part's axes and the time t [s]; a number: constant in time and space, at once from the first step on.

    Small strain: sigma(eps - expansion T); finite strain: W(F / (1 + expansion T)). What a change of temperature brings into the stored
    energy is booked as (negative) dissipation of the material. Statics of nearly incompressible materials need temperatures that grow over
    steps: the pressure 3 K expansion dT of what a step adds must stay below the shear modulus.
    """

    material: AnyMaterial
    expansion: float
    temperature: Callable[[FloatArray, float], FloatArray] | float

    def __post_init__(self) -> None:
        if not is_number(self.expansion):
            raise InputError(f"Thermal, expansion: expected a finite number in 1/K, got {shown(self.expansion)}")
        if not callable(self.temperature) and not is_number(self.temperature):
            raise InputError(f"Thermal, temperature: expected a function of (X, t) or a number in K, got {shown(self.temperature)}")
        if not isinstance(self.material, LinearMaterial | PointLaw):
            raise InputError(f"Thermal, material: expected a material, got {type(self.material).__name__}")
        self._refuse_shape()

    @property
    def density(self) -> float:
        return self.material.density

    @property
    def _law(self) -> PointLaw:
        return self.material if isinstance(self.material, PointLaw) else LinearLaw(self.material)

    @property
    def strain(self) -> Literal["finite", "small"]:
        return self._law.strain

    @property
    def variables(self) -> tuple[Variable, ...]:
        return self._law.variables

    def _refuse_shape(self) -> None:
        """Refuses a field of a wrong shape before anything runs; its values are looked at in the body alone: where this is is not known
        here, and a field need not be finite, or there at all, elsewhere (a/r at the origin)."""
        if not callable(self.temperature):
            return
        try:
            with np.errstate(all="ignore"):
                found = np.shape(self.temperature(np.zeros((13, 3)), 0.0))
        except Exception:
            return  # it may be right in the body, and is raised there if not
        if found not in ((), (13,)):
            raise InputError(_expected(13, 0.0, f"an array of shape {found}"))

    def _stretch(self, X: FloatArray, t: float) -> FloatArray:
        """1 + expansion T (n,)."""
        T = self.temperature(X, t) if callable(self.temperature) else self.temperature
        values = np.asarray(T, dtype=float)
        if values.shape not in ((), (len(X),)):
            raise InputError(_expected(len(X), t, f"an array of shape {values.shape}"))
        if not np.all(np.isfinite(values)):
            wrong = int(np.argmin(np.isfinite(np.broadcast_to(values, len(X)))))
            raise InputError(_expected(len(X), t, f"{np.broadcast_to(values, len(X))[wrong]} at {tuple(X[wrong].tolist())}"))
        stretch = 1 + self.expansion * np.broadcast_to(values, (len(X),))
        if np.any(stretch <= 0):
            raise InputError(f"Thermal, temperature at t = {t} s: expected 1 + expansion T > 0, got {stretch.min()}")
        return stretch

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        stretch = self._stretch(at.X, at.t)
        answer = self._cooled(strain, stretch, before, at, tangent)
        if not (at.dt and callable(self.temperature)):
            return answer
        earlier = self._stretch(at.X, at.t - at.dt)
        if np.array_equal(earlier, stretch):
            return answer
        brought = answer.energy + answer.dissipated
        colder = self._cooled(strain, earlier, before, at, False)
        dissipated = answer.dissipated - (brought - colder.energy - colder.dissipated)
        return Response(answer.stress, answer.tangent, answer.energy, dissipated, answer.variables)

    def _cooled(self, strain: FloatArray, stretch: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        law = self._law
        if law.strain == "small":
            return law.respond(strain - (stretch - 1)[:, None, None] * np.eye(3), before, at, tangent)
        answer = law.respond(strain / stretch[:, None, None], before, at, tangent)
        volume = stretch[:, None, None] ** 3  # energy and stress are of the grown volume, so that a free body has that of the law
        A = None if answer.tangent is None else answer.tangent * stretch[:, None, None, None, None]
        factor = volume[:, 0, 0]
        return Response(
            answer.stress * stretch[:, None, None] ** 2, A, answer.energy * factor, answer.dissipated * factor, answer.variables
        )


def _expected(n: int, t: float, got: str) -> str:
    return f"Thermal, temperature at t = {t} s: expected {n} finite numbers in K at points X ({n}, 3), whose rows are points, got {got}"
