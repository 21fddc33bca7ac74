"""How a solution changes with the problem's data: the implicit function theorem on the contacts' statuses (`Result.derivative`)."""

from fcsim.solvers.derivative.bodies import GlobalDerivative
from fcsim.solvers.derivative.contacts import Change, Gradient, LocalDerivative
from fcsim.solvers.derivative.outer import OuterProduct
from fcsim.solvers.derivative.solution import derivative

__all__ = ["Change", "GlobalDerivative", "Gradient", "LocalDerivative", "OuterProduct", "derivative"]
