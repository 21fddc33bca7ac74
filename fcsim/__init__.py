"""fcsim: frictional contact between deformable bodies, from mesh to FCLIB file.

The public names are loaded when first used, so that the core (FCLIB files, solvers) needs neither dolfinx nor gmsh nor PETSc.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fcsim import runtime as _runtime

_runtime.limit_threads()
_runtime.keep_freed_memory()

__version__ = "0.1.0"

if TYPE_CHECKING:
    from fcsim.assembly.model import build_model
    from fcsim.assembly.supports import Support
    from fcsim.contact_detection import Detector, SurfacePair, two_pass
    from fcsim.contact_detection.model_surfaces import contact_surface
    from fcsim.export_fclib import read_fclib, write_fclib
    from fcsim.mesh.part import Body, Material, Part, RigidBody
    from fcsim.problem import GlobalProblem, LocalProblem
    from fcsim.solvers import SOLVERS, solve
    from fcsim.timestep.generalised_alpha import GeneralisedAlpha
    from fcsim.timestep.quasi_static import QuasiStatic
    from fcsim.timestep.scheme import Gap, Velocity
    from fcsim.timestep.simulation import Simulation, SolverSettings
    from fcsim.timestep.theta import Theta

_HOME = {
    "Body": "mesh.part",
    "Detector": "contact_detection",
    "Gap": "timestep.scheme",
    "GeneralisedAlpha": "timestep.generalised_alpha",
    "GlobalProblem": "problem",
    "LocalProblem": "problem",
    "Material": "mesh.part",
    "Part": "mesh.part",
    "QuasiStatic": "timestep.quasi_static",
    "RigidBody": "mesh.part",
    "SOLVERS": "solvers",
    "Simulation": "timestep.simulation",
    "SolverSettings": "timestep.simulation",
    "Support": "assembly.supports",
    "SurfacePair": "contact_detection",
    "Theta": "timestep.theta",
    "Velocity": "timestep.scheme",
    "build_model": "assembly.model",
    "contact_surface": "contact_detection.model_surfaces",
    "read_fclib": "export_fclib",
    "solve": "solvers",
    "two_pass": "contact_detection",
    "write_fclib": "export_fclib",
}

__all__ = [
    "SOLVERS",
    "Body",
    "Detector",
    "Gap",
    "GeneralisedAlpha",
    "GlobalProblem",
    "LocalProblem",
    "Material",
    "Part",
    "QuasiStatic",
    "RigidBody",
    "Simulation",
    "SolverSettings",
    "Support",
    "SurfacePair",
    "Theta",
    "Velocity",
    "build_model",
    "contact_surface",
    "read_fclib",
    "solve",
    "two_pass",
    "write_fclib",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'fcsim' has no attribute {name!r}")
    return getattr(import_module(f"fcsim.{_HOME[name]}"), name)
