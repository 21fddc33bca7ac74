"""Materials: linear elasticity, and laws of points for all else (energies in UFL, plasticity, viscosity, heat, functions of one's own)."""

from fcsim.mesh.material.check import Deviations, check_law
from fcsim.mesh.material.elsewhere import PointFunction
from fcsim.mesh.material.energies import mooney_rivlin, neo_hooke, neo_hooke_isochoric, ogden, saint_venant_kirchhoff
from fcsim.mesh.material.hyperelastic import Hyperelastic, OfStretches
from fcsim.mesh.material.isotropic import Material
from fcsim.mesh.material.law import AnyMaterial, Circumstances, PointLaw, Response, Variable
from fcsim.mesh.material.orthotropic import Orthotropic

__all__ = [
    "AnyMaterial",
    "Circumstances",
    "Deviations",
    "Hyperelastic",
    "Material",
    "OfStretches",
    "Orthotropic",
    "PointFunction",
    "PointLaw",
    "Response",
    "Variable",
    "check_law",
    "mooney_rivlin",
    "neo_hooke",
    "neo_hooke_isochoric",
    "ogden",
    "saint_venant_kirchhoff",
]
