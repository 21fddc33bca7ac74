"""The frictional contact problem, its cone and its one error; the reduction to the local form u = W r + q."""

from fcsim.problem.delassus import Delassus, diagonal_blocks
from fcsim.problem.problem import (
    OPEN,
    SLIP,
    STICK,
    Checks,
    GlobalProblem,
    LocalProblem,
    Matrix,
    check,
    contact_status,
    error,
    natural_map_residual,
)

__all__ = [
    "OPEN",
    "SLIP",
    "STICK",
    "Checks",
    "Delassus",
    "GlobalProblem",
    "LocalProblem",
    "Matrix",
    "check",
    "contact_status",
    "diagonal_blocks",
    "error",
    "natural_map_residual",
]
