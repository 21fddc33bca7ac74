"""How the steps of a run change with its parameters."""

from fcsim.timestep.sensitivity.along_steps import Sensitivity, sensitivities

__all__ = ["Sensitivity", "sensitivities"]
