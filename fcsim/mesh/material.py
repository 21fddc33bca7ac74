"""The material of a part: isotropic linear elasticity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcsim.errors import InputError


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
        if not (np.isfinite(self.density) and self.density >= 0):
            raise InputError(f"Material: expected a density >= 0 in kg/m^3, got {self.density}")
