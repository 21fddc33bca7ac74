"""What is odd about the matrices of a file: remarks, since fcsim takes them as they stand."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.export_fclib.content import Problem
from fcsim.problem import LocalProblem

SYMMETRIC = 1e-9
"""Of a matrix' largest entry: what it may differ by from its transpose and be called symmetric."""


def odd_matrices(problem: Problem) -> tuple[str, ...]:
    """Remarks on M of a global, on W of a local problem: one triangle where both are meant, entries < 0 on the diagonal, no symmetry.

    Masses, stiffnesses and Delassus operators are symmetric and >= 0; tangents of steps with friction need not be, so nothing is refused.
    """
    letter = "W" if isinstance(problem, LocalProblem) else "M"
    A = sp.coo_array(problem.W if isinstance(problem, LocalProblem) else problem.entries)
    stored = A.data != 0
    row, column, value = A.row[stored], A.col[stored], A.data[stored]
    found = []
    lower, upper = bool(np.any(row > column)), bool(np.any(row < column))
    if lower != upper:
        which = "lower" if lower else "upper"
        found.append(
            f"{letter} has its {which} triangle alone and is taken as it stands: FCLIB files have both of a symmetric matrix; if it is the "
            "half of one, this is another problem"
        )
    elif len(value):
        B = sp.csr_array((value, (row, column)), shape=A.shape)
        off = float(np.abs((B - B.T).data).max(initial=0.0)) / float(np.abs(value).max())
        if off > SYMMETRIC:
            found.append(f"{letter} is not symmetric: entries differ from those across the diagonal by up to {off:.2g} of the largest")
    negative = row[(row == column) & (value < 0)]
    if negative.size:
        found.append(
            f"{letter} has {negative.size} entries < 0 on its diagonal, the first in row {negative.min()}: is its sign turned over?"
        )
    return tuple(found)
