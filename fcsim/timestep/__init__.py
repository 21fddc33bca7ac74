"""From one state to the next: schemes, the step, its energy, the simulation as an iterator of steps."""

from fcsim.timestep.energy import Energy
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Gap, Scheme, Velocity
from fcsim.timestep.simulation import Attempt, Moment, Simulation, SolverSettings, Step
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.theta import Theta

__all__ = [
    "Attempt",
    "Energy",
    "Gap",
    "GeneralisedAlpha",
    "Moment",
    "QuasiStatic",
    "Scheme",
    "Simulation",
    "SolverSettings",
    "State",
    "Step",
    "Theta",
    "Velocity",
    "at_rest",
]
