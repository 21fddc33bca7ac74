"""From one state to the next: schemes, the step, its energy, the simulation as an iterator of steps."""

from fcsim.timestep.chain import Attempt, SolverSettings
from fcsim.timestep.energy import Energy
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.limits import KinematicsLeft, Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Moment, Step
from fcsim.timestep.theta import Theta

__all__ = [
    "Attempt",
    "Energy",
    "GeneralisedAlpha",
    "KinematicsLeft",
    "Limits",
    "Moment",
    "QuasiStatic",
    "Scheme",
    "Simulation",
    "SolverSettings",
    "State",
    "Step",
    "Theta",
    "at_rest",
]
