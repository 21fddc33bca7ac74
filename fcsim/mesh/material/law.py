"""What a material owes a body: the response of points to strain, for any number of points at once.

A law is asked at the quadrature points of cells, always in three dimensions and in the axes of the part:

    finite strain:  F (n, 3, 3) deformation gradient -> P = dW/dF (n, 3, 3) first Piola-Kirchhoff stress, dP/dF (n, 3, 3, 3, 3)
    small strain:   eps (n, 3, 3) -> sigma (n, 3, 3), dsigma/deps (n, 3, 3, 3, 3) with both minor symmetries

with the internal variables (n, k) at the beginning of the step, which give those at its end. What is not admissible (a volume that is not
positive, an iteration that fails) is returned as NaN in the stress: the step is then searched back, or cut.
A law of one's own is any object with the members of `PointLaw`; `PointFunction` makes one of a function.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from fcsim.arrays import FloatArray, is_number
from fcsim.brief import shown
from fcsim.errors import InputError


@dataclass(frozen=True)
class Variable:
    """An internal variable: name, number of components, and value at the beginning (a number, or one a component)."""

    name: str
    components: int = 1
    initial: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise InputError(f"Variable: expected a name of letters, digits and _, got {self.name!r}")
        if self.components < 1 or np.size(self.initial) not in (1, self.components) or not np.all(np.isfinite(self.initial)):
            raise InputError(
                f"Variable {self.name!r}: expected components >= 1 and one finite initial value for all or for each of them, got "
                f"{self.components} and {self.initial}"
            )


@dataclass(frozen=True, eq=False)
class Circumstances:
    """X (n, 3) [m] where the points stand in the part's axes (z = 0 in 2D); t [s] the time of the strain; dt [s] since the variables."""

    X: FloatArray
    t: float
    dt: float


@dataclass(frozen=True, eq=False)
class Response:
    """What n points answer.

    stress (n, 3, 3) [Pa]; tangent (n, 3, 3, 3, 3) [Pa], None where it was not asked for; energy (n,) [J/m^3] that is stored at the end;
    dissipated (n,) [J/m^3] since the beginning, >= 0; variables (n, k) at the end
    """

    stress: FloatArray
    tangent: FloatArray | None
    energy: FloatArray
    dissipated: FloatArray
    variables: FloatArray


@runtime_checkable
class PointLaw(Protocol):
    """The law of a material's points, see the top of this file; density [kg/m^3]."""

    @property
    def density(self) -> float: ...

    @property
    def strain(self) -> Literal["finite", "small"]:
        """Which strain it takes."""
        ...

    @property
    def variables(self) -> tuple[Variable, ...]: ...

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        """The response of n points; before (n, k): internal variables at the beginning of the step."""
        ...


@runtime_checkable
class LinearMaterial(Protocol):
    """A linear elastic material: elasticity (6, 6) [Pa] of (xx, yy, zz, xy, yz, zx) with gamma = 2 eps in the last three."""

    @property
    def density(self) -> float: ...

    @property
    def elasticity(self) -> FloatArray: ...


AnyMaterial = LinearMaterial | PointLaw
"""A material of cells; a `Part` takes one, or a `ByRegion` of several."""


def initial_variables(law: PointLaw) -> FloatArray:
    """The internal variables (k,) at the beginning."""
    values = [np.broadcast_to(np.asarray(variable.initial, dtype=float), (variable.components,)) for variable in law.variables]
    return np.concatenate([np.empty(0), *values])


def refuse_density(what: str, density: float) -> None:
    """InputError where a density [kg/m^3] is no number >= 0."""
    if not (is_number(density) and density >= 0):
        raise InputError(f"{what}: expected a density >= 0 in kg/m^3, got {shown(density)}")


PAIR = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Which of the six components a pair of axes is."""


def as_tensor(C: FloatArray) -> FloatArray:
    """C_ijkl (3, 3, 3, 3) [Pa] of an elasticity matrix (6, 6)."""
    tensor: FloatArray = C[PAIR[:, :, None, None], PAIR[None, None]]
    return tensor


@dataclass(frozen=True, eq=False)
class LinearLaw:
    """A linear elastic material as a law of points: sigma = C eps."""

    material: LinearMaterial

    @property
    def density(self) -> float:
        return self.material.density

    @property
    def strain(self) -> Literal["finite", "small"]:
        return "small"

    @property
    def variables(self) -> tuple[Variable, ...]:
        return ()

    def respond(self, strain: FloatArray, before: FloatArray, at: Circumstances, tangent: bool) -> Response:
        C = as_tensor(self.material.elasticity)
        stress = np.einsum("ijkl,nkl->nij", C, strain, optimize=True)
        energy = 0.5 * np.einsum("nij,nij->n", stress, strain)
        return Response(stress, np.broadcast_to(C, (len(strain), 3, 3, 3, 3)) if tangent else None, energy, np.zeros(len(strain)), before)
