"""Solvers: `solve`, `solve_many` and the table of the methods by their published names."""

from fcsim.solvers.base import Method, Result, Status
from fcsim.solvers.memory import Memory
from fcsim.solvers.solve import solve
from fcsim.solvers.solve_many import solve_many
from fcsim.solvers.table import ALIASES, SOLVERS, method

__all__ = ["ALIASES", "SOLVERS", "Memory", "Method", "Result", "Status", "method", "solve", "solve_many"]
