"""The frictional contact problem, its cone, how answers are judged, and the reduction to the local form u = W r + q."""

from fcsim.arrays import Matrix
from fcsim.problem.delassus import Delassus, diagonal_blocks
from fcsim.problem.judge import OPEN, SLIP, STICK, Checks, Judge, check, contact_status, error, natural_map_residual, scaled_error
from fcsim.problem.problem import Answer, Followed, GlobalProblem, LocalProblem, Reduced

__all__ = [
    "OPEN",
    "SLIP",
    "STICK",
    "Answer",
    "Checks",
    "Delassus",
    "Followed",
    "GlobalProblem",
    "Judge",
    "LocalProblem",
    "Matrix",
    "Reduced",
    "check",
    "contact_status",
    "diagonal_blocks",
    "error",
    "natural_map_residual",
    "scaled_error",
]
