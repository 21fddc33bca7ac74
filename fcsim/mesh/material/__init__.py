"""Materials: linear elasticity, and laws of points for all else (energies in UFL, plasticity, viscosity, heat, functions of one's own)."""

from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.check import Deviations, check_law
from fcsim.mesh.material.elsewhere import PointFunction
from fcsim.mesh.material.energies import mooney_rivlin, neo_hooke, neo_hooke_isochoric, ogden, saint_venant_kirchhoff
from fcsim.mesh.material.hardening import Hardening, HardeningFunction, HardeningTable, LinearHardening
from fcsim.mesh.material.hyperelastic import Hyperelastic, OfStretches
from fcsim.mesh.material.law import AnyMaterial, Circumstances, PointLaw, Response, Variable
from fcsim.mesh.material.linear import Material, Orthotropic
from fcsim.mesh.material.plastic import FinitePlastic, Plastic
from fcsim.mesh.material.thermal import Thermal
from fcsim.mesh.material.viscoelastic import Viscoelastic

__all__ = [
    "AnyMaterial",
    "ByRegion",
    "Circumstances",
    "Deviations",
    "FinitePlastic",
    "Hardening",
    "HardeningFunction",
    "HardeningTable",
    "Hyperelastic",
    "LinearHardening",
    "Material",
    "OfStretches",
    "Orthotropic",
    "Plastic",
    "PointFunction",
    "PointLaw",
    "Response",
    "Thermal",
    "Variable",
    "Viscoelastic",
    "check_law",
    "mooney_rivlin",
    "neo_hooke",
    "neo_hooke_isochoric",
    "ogden",
    "saint_venant_kirchhoff",
]
