"""Linear elasticity: isotropic, and orthotropic in the axes of the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray, is_number, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.material.law import refuse_density


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material: Young's modulus E [Pa], Poisson's ratio nu [-], density [kg/m^3]."""

    E: float
    nu: float
    density: float

    def __post_init__(self) -> None:
        if not (is_number(self.E) and self.E > 0):
            raise InputError(f"Material: expected Young's modulus E > 0 in Pa, got {shown(self.E)}")
        if not (is_number(self.nu) and -1 < self.nu < 0.5):
            raise InputError(f"Material: expected Poisson's ratio -1 < nu < 0.5, got {shown(self.nu)}")
        refuse_density("Material", self.density)

    @property
    def elasticity(self) -> FloatArray:
        """(6, 6) [Pa], see `LinearMaterial`."""
        first, second = lame(self.E, self.nu)
        C = np.diag([2 * second] * 3 + [second] * 3)
        C[:3, :3] += first
        return C


def lame(E: float, nu: float) -> tuple[float, float]:
    """Lame's constants (lambda, mu) [Pa]."""
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


@dataclass(frozen=True)
class Orthotropic:
    """Linear elastic material with three planes of symmetry, x, y, z of the part's axes.

    E (3,) [Pa] along x, y, z; nu (3,) = (nu_xy, nu_yz, nu_zx), nu_ij = -eps_j / eps_i when pulled along i; G (3,) = (G_xy, G_yz, G_zx) [Pa]
    Source: S. G. Lekhnitskii, Theory of elasticity of an anisotropic body, 1963, section 3.
    """

    E: tuple[float, float, float]
    nu: tuple[float, float, float]
    G: tuple[float, float, float]
    density: float

    def __post_init__(self) -> None:
        for name in ("E", "nu", "G"):
            values = numbers_of(getattr(self, name))
            if values.shape != (3,) or not np.all(np.isfinite(values)) or (name != "nu" and np.any(values <= 0)):
                bound = "" if name == "nu" else " > 0 in Pa"
                raise InputError(f"Orthotropic, {name}: expected three finite numbers{bound}, got {shown(getattr(self, name))}")
        refuse_density("Orthotropic", self.density)
        least = float(np.linalg.eigvalsh(self._compliance * np.sqrt(np.outer(self._scale, self._scale))).min())
        if not least > 0:
            raise InputError(
                f"Orthotropic: expected E, nu and G of a positive energy (nu_ij^2 < E_i / E_j, and so for all three), got E = {self.E}, "
                f"nu = {self.nu}"
            )

    @property
    def _scale(self) -> FloatArray:
        return np.array([*self.E, *self.G])

    @property
    def _compliance(self) -> FloatArray:
        S = np.diag(1 / self._scale)
        for (i, j), nu in zip(((0, 1), (1, 2), (2, 0)), self.nu, strict=True):
            S[i, j] = S[j, i] = -nu / self.E[i]
        return S

    @property
    def elasticity(self) -> FloatArray:
        """(6, 6) [Pa], see `LinearMaterial`."""
        C: FloatArray = np.linalg.inv(self._compliance)
        return 0.5 * (C + C.T)
