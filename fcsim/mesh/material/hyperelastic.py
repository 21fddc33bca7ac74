"""Hyperelasticity by an energy in UFL: of the deformation gradient, or of the principal stretches."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.mesh.material.check import refuse_wrong
from fcsim.mesh.material.compiled import CompiledEnergy, checked_numbers, compiled
from fcsim.mesh.material.law import Circumstances, Response, Variable, refuse_density
from fcsim.mesh.material.spectral import energy_of_stretches

if TYPE_CHECKING:
    from ufl.core.expr import Expr


@dataclass(frozen=True, eq=False)
class _OfEnergy:
    """A material of an energy: a UFL expression of a measure of strain and of the numbers in `parameters`."""

    energy: Callable[[Expr, Mapping[str, Expr]], Expr]
    density: float
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name = type(self).__name__
        refuse_density(name, self.density)
        checked_numbers(name, self.parameters)
        if not callable(self.energy):
            raise InputError(f"{name}, energy: expected a function of (F, p) or (l, p), got {self.energy!r}")

    @property
    def strain(self) -> Literal["finite", "small"]:
        return "finite"

    @property
    def variables(self) -> tuple[Variable, ...]:
        return ()


@dataclass(frozen=True, eq=False)
class Hyperelastic(_OfEnergy):
    """A material whose energy per reference volume [J/m^3] is `energy(F, p)`, a UFL expression of the deformation gradient F (3, 3), always
    in three dimensions, and of the numbers p["name"] in `parameters`. Stress and tangent are UFL's derivatives, compiled by ffcx.

    Counted from F = 1, and there without stress, or the body is under stress as it is given: refused where it is. Points with det F <= 0
    are not admissible. Shared functions are compiled once, whatever the parameters.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse_prestress("Hyperelastic", self)
        refuse_wrong(self, "Hyperelastic, energy")

    @property
    def _compiled(self) -> CompiledEnergy:
        return compiled(self.energy, tuple(self.parameters), (3, 3))

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        n = len(strain)
        W, P, A = self._compiled(strain.reshape(n, 9), np.array(list(self.parameters.values()), dtype=float))
        P = np.where(np.linalg.det(strain)[:, None] > 0, P, np.nan).reshape(n, 3, 3)
        return Response(P, A.reshape(n, 3, 3, 3, 3) if tangent else None, W - self._at_rest, np.zeros(n), before)

    @cached_property
    def _at_rest(self) -> float:
        return float(self._compiled(np.eye(3).reshape(1, 9), np.array(list(self.parameters.values()), dtype=float))[0][0])


@dataclass(frozen=True, eq=False)
class OfStretches(_OfEnergy):
    """A material whose energy per reference volume [J/m^3] is `energy(l, p)`, a UFL expression of the principal stretches l[0], l[1],
    l[2] that is the same for all their orders (isotropic), and of the numbers p["name"]: Ogden's and the like. See `Hyperelastic`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        values = self._energies(np.array([[1.1, 0.9, 1.05], [0.9, 1.05, 1.1], [1.05, 1.1, 0.9]]))
        if not np.allclose(values, values[0], rtol=1e-9, atol=0.0):  # whatever the unit of pressure
            raise InputError(f"OfStretches, energy: expected the same for all orders of the stretches, got {values.tolist()}")
        _refuse_prestress("OfStretches", self)

    def _energies(self, stretches: FloatArray) -> FloatArray:
        return self._of(stretches)[0]

    def _of(self, stretches: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        numbers = np.array(list(self.parameters.values()), dtype=float)
        return compiled(self.energy, tuple(self.parameters), (3,))(stretches, numbers)

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        W, P, A = energy_of_stretches(strain, self._of, tangent)
        P = np.where(np.linalg.det(strain)[:, None, None] > 0, P, np.nan)
        return Response(P, A, W - self._at_rest, np.zeros(len(strain)), before)

    @cached_property
    def _at_rest(self) -> float:
        return float(self._energies(np.ones((1, 3)))[0])


_NONE = 1e-12
"""Share of the stiffness that is round-off."""


def _refuse_prestress(what: str, law: Hyperelastic | OfStretches) -> None:
    at = Circumstances(np.zeros((1, 3)), 0.0, 0.0)
    answer = law.respond(np.eye(3)[None], np.empty((1, 0)), at, True)
    assert answer.tangent is not None
    stress, stiffness = float(np.abs(answer.stress).max()), float(np.abs(answer.tangent).max())
    if not (np.isfinite(stress) and np.isfinite(stiffness)):
        raise InputError(f"{what}, energy: expected one with finite derivatives at F = 1, got stress {stress} and stiffness {stiffness}")
    if not stress <= 1e-8 * stiffness:
        raise InputError(
            f"{what}, energy: expected no stress at F = 1, got {stress:.3g} Pa where the stiffness is {stiffness:.3g} Pa: a term such as "
            "-mu ln J is missing, or a parameter has another unit"
        )
    sheared = np.array([np.diag([1, -1, 0]), np.diag([0, 1, -1]), np.eye(3), *_SHEARS]) / np.sqrt(3)
    if np.einsum("nij,ijkl,nkl->n", sheared, answer.tangent[0], sheared).min() <= _NONE * stiffness:
        raise InputError(
            f"{what}, energy: expected one that every small strain raises from F = 1, got one that some strain lowers or leaves"
        )


_SHEARS = np.array([[[0, 1, 0], [1, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [1, 0, 0]]])
