"""fcsim: frictional contact between deformable and rigid bodies, from mesh to FCLIB file.

The public names are loaded when first used, so that the core (FCLIB files, solvers) needs neither dolfinx nor gmsh nor PETSc.
"""

from fcsim import starting as _starting  # isort: split

from importlib import import_module
from pathlib import Path as _Path
from typing import TYPE_CHECKING

from fcsim import memory as _memory
from fcsim import moved as _moved
from fcsim import runtime as _runtime
from fcsim.version import __version__ as __version__

_runtime.keep_freed_memory()
_runtime.writable_caches()
_runtime.forget_outdated_kernels(_Path(__file__).parent)
_runtime.load_numba_alone()
_moved.watch_imports()

if TYPE_CHECKING:
    from fcsim.arrays import FloatArray
    from fcsim.assembly.forms import forms_of, part_from_dolfinx
    from fcsim.assembly.loads import BodyForce, FollowerForce, FollowerPressure, Force, FormLoad, NodalForces, Traction, nodal_area
    from fcsim.assembly.model import Model, build_model
    from fcsim.assembly.supports import DrivenRotation, Support
    from fcsim.assembly.time_functions import AccelerationRecord, GravityRamp, read_acceleration_record
    from fcsim.command_line.main import main
    from fcsim.command_line.progress import progress
    from fcsim.contact_detection import Contacts, ContactSurface, Detector, Everything, ExactContacts, SurfacePair, two_pass
    from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
    from fcsim.contact_law import (
        Cohesive,
        Compliant,
        Elliptic,
        Gap,
        RateDependent,
        Rolling,
        SlipWeakening,
        Spinning,
        Springs,
        StaticKinetic,
        Velocity,
        laws_of_bodies,
        laws_of_pairs,
    )
    from fcsim.errors import FcsimError, InputError
    from fcsim.export_fclib import read_fclib, write_fclib
    from fcsim.linkage import Ball, Bonded, Cable, Control, Hinge, Linkage, Rod, Slider, SpringDamper, Tied, WithCables, without_contact_of
    from fcsim.mesh.material import Material
    from fcsim.mesh.part import Body, Part, RigidBody
    from fcsim.problem import GlobalProblem, LocalProblem
    from fcsim.running.case import Case, History, Sensor, load_case
    from fcsim.running.sensors import contact_force, displacement, joint_opening, stress, support_force, support_moment
    from fcsim.solvers import SOLVERS
    from fcsim.solvers.solve import solve
    from fcsim.solvers.solve_many import solve_many
    from fcsim.timestep.chain import SolverSettings
    from fcsim.timestep.generalised_alpha import GeneralisedAlpha
    from fcsim.timestep.limits import Limits
    from fcsim.timestep.quasi_static import QuasiStatic
    from fcsim.timestep.scheme import Scheme
    from fcsim.timestep.sensitivity import sensitivities
    from fcsim.timestep.simulation import Simulation
    from fcsim.timestep.state import State, at_rest
    from fcsim.timestep.step import Step
    from fcsim.timestep.theta import Theta
    from fcsim.witness import Witness

_HOME = {
    "BodyForce": "assembly.loads",
    "FollowerForce": "assembly.loads",
    "FollowerPressure": "assembly.loads",
    "Force": "assembly.loads",
    "SOLVERS": "solvers",
    "AccelerationRecord": "assembly.time_functions",
    "Ball": "linkage",
    "Body": "mesh.part",
    "Bonded": "linkage",
    "Cable": "linkage",
    "Control": "linkage",
    "Case": "running.case",
    "Cohesive": "contact_law",
    "Compliant": "contact_law",
    "ContactSurface": "contact_detection",
    "Contacts": "contact_detection",
    "Detector": "contact_detection",
    "DrivenRotation": "assembly.supports",
    "Elliptic": "contact_law",
    "Everything": "contact_detection",
    "ExactContacts": "contact_detection",
    "FcsimError": "errors",
    "FloatArray": "arrays",
    "FormLoad": "assembly.loads",
    "Gap": "contact_law",
    "GeneralisedAlpha": "timestep.generalised_alpha",
    "GlobalProblem": "problem",
    "GravityRamp": "assembly.time_functions",
    "Hinge": "linkage",
    "History": "running.case",
    "InputError": "errors",
    "Limits": "timestep.limits",
    "Linkage": "linkage",
    "LocalProblem": "problem",
    "Material": "mesh.material",
    "Model": "assembly.model",
    "NodalForces": "assembly.loads",
    "Part": "mesh.part",
    "QuasiStatic": "timestep.quasi_static",
    "RateDependent": "contact_law",
    "RigidBody": "mesh.part",
    "Rod": "linkage",
    "Rolling": "contact_law",
    "Scheme": "timestep.scheme",
    "Sensor": "running.case",
    "Simulation": "timestep.simulation",
    "Slider": "linkage",
    "SlipWeakening": "contact_law",
    "SolverSettings": "timestep.chain",
    "Spinning": "contact_law",
    "SpringDamper": "linkage",
    "Springs": "contact_law",
    "State": "timestep.state",
    "StaticKinetic": "contact_law",
    "Step": "timestep.step",
    "Support": "assembly.supports",
    "SurfacePair": "contact_detection",
    "Theta": "timestep.theta",
    "Tied": "linkage",
    "Traction": "assembly.loads",
    "Velocity": "contact_law",
    "WithCables": "linkage",
    "Witness": "witness",
    "at_rest": "timestep.state",
    "build_model": "assembly.model",
    "contact_force": "running.sensors",
    "contact_surface": "contact_detection.surfaces.model_surfaces",
    "displacement": "running.sensors",
    "forms_of": "assembly.forms",
    "joint_opening": "running.sensors",
    "laws_of_bodies": "contact_law",
    "laws_of_pairs": "contact_law",
    "load_case": "running.case",
    "main": "command_line.main",
    "progress": "command_line.progress",
    "nodal_area": "assembly.loads",
    "part_from_dolfinx": "assembly.forms",
    "read_acceleration_record": "assembly.time_functions",
    "read_fclib": "export_fclib",
    "sensitivities": "timestep.sensitivity",
    "solve": "solvers.solve",
    "solve_many": "solvers.solve_many",
    "stress": "running.sensors",
    "support_force": "running.sensors",
    "support_moment": "running.sensors",
    "two_pass": "contact_detection",
    "without_contact_of": "linkage",
    "write_fclib": "export_fclib",
}

__all__ = [
    "SOLVERS",
    "AccelerationRecord",
    "Ball",
    "Body",
    "BodyForce",
    "Bonded",
    "Cable",
    "Case",
    "Cohesive",
    "Compliant",
    "ContactSurface",
    "Contacts",
    "Control",
    "Detector",
    "DrivenRotation",
    "Elliptic",
    "Everything",
    "ExactContacts",
    "FcsimError",
    "FloatArray",
    "FollowerForce",
    "FollowerPressure",
    "Force",
    "FormLoad",
    "Gap",
    "GeneralisedAlpha",
    "GlobalProblem",
    "GravityRamp",
    "Hinge",
    "History",
    "InputError",
    "Limits",
    "Linkage",
    "LocalProblem",
    "Material",
    "Model",
    "NodalForces",
    "Part",
    "QuasiStatic",
    "RateDependent",
    "RigidBody",
    "Rod",
    "Rolling",
    "Scheme",
    "Sensor",
    "Simulation",
    "Slider",
    "SlipWeakening",
    "SolverSettings",
    "Spinning",
    "SpringDamper",
    "Springs",
    "State",
    "StaticKinetic",
    "Step",
    "Support",
    "SurfacePair",
    "Theta",
    "Tied",
    "Traction",
    "Velocity",
    "WithCables",
    "Witness",
    "at_rest",
    "build_model",
    "contact_force",
    "contact_surface",
    "displacement",
    "forms_of",
    "joint_opening",
    "laws_of_bodies",
    "laws_of_pairs",
    "load_case",
    "main",
    "nodal_area",
    "part_from_dolfinx",
    "progress",
    "read_acceleration_record",
    "read_fclib",
    "sensitivities",
    "solve",
    "solve_many",
    "stress",
    "support_force",
    "support_moment",
    "two_pass",
    "without_contact_of",
    "write_fclib",
]


def __getattr__(name: str) -> object:
    name = _moved.renamed(name)
    if name not in _HOME:
        raise AttributeError(f"module 'fcsim' has no attribute {name!r}")
    if _HOME[name] != "errors":
        _memory.refuse_to_load_the_core()
    return getattr(import_module(f"fcsim.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


_starting.listens()
