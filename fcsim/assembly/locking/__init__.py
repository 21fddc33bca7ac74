"""Cells that are too stiff: seen by their shape and material as a run begins, and by the stress that they answer with."""

from fcsim.assembly.locking.by_shape import locking, locking_in_bending, locking_in_flow, locking_parts
from fcsim.assembly.locking.recovery import Recovery, recovery
from fcsim.assembly.locking.stress_error import StressError, nodal_stress, stress_error

__all__ = [
    "Recovery",
    "StressError",
    "locking",
    "locking_in_bending",
    "locking_in_flow",
    "locking_parts",
    "nodal_stress",
    "recovery",
    "stress_error",
]
