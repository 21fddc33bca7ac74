"""compas_dem's problems solved by fcsim: `pip install 'fcsim[compas]'`.

from fcsim.compas import solve
results = solve(problem)              # compas_dem.problem.Results, as of its other solvers
"""

from fcsim.compas.solve import from_analysis, solve

__all__ = ["from_analysis", "solve"]
