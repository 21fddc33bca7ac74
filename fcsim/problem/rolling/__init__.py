"""Contact with rolling and spinning friction: five or six unknowns a contact, their cone, and the way to the local form u = W r + q."""

from fcsim.problem.rolling.cone import modified_velocity, natural_residual, project_rolling_cone
from fcsim.problem.rolling.local import LocalRollingProblem, RollingReduction, reduce_rolling
from fcsim.problem.rolling.problem import GlobalRollingProblem

__all__ = [
    "GlobalRollingProblem",
    "LocalRollingProblem",
    "RollingReduction",
    "modified_velocity",
    "natural_residual",
    "project_rolling_cone",
    "reduce_rolling",
]
