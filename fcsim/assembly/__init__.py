"""From parts with materials to one model: mass, damping, stiffness, supports and loads."""

from fcsim.assembly.layout import DIRECTIONS, BodyLayout
from fcsim.assembly.loads import BodyForce, FollowerForce, FollowerPressure, Force, FormLoad, Load, NodalForces, Traction, nodal_area
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.assembly.time_functions import AccelerationRecord, GravityRamp, Ramp, Table, read_acceleration_record, read_table

__all__ = [
    "DIRECTIONS",
    "AccelerationRecord",
    "BodyForce",
    "BodyLayout",
    "DrivenRotation",
    "FollowerForce",
    "FollowerPressure",
    "Force",
    "FormLoad",
    "GravityRamp",
    "Load",
    "Model",
    "NodalForces",
    "Ramp",
    "Support",
    "Table",
    "Traction",
    "build_model",
    "nodal_area",
    "read_acceleration_record",
    "read_table",
]
