"""Isotropic linear elasticity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.mesh.material.law import refuse_density


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material: Young's modulus E [Pa], Poisson's ratio nu [-], density [kg/m^3]."""

    E: float
    nu: float
    density: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.E) and self.E > 0):
            raise InputError(f"Material: expected Young's modulus E > 0 in Pa, got {self.E}")
        if not -1 < self.nu < 0.5:
            raise InputError(f"Material: expected Poisson's ratio -1 < nu < 0.5, got {self.nu}")
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
