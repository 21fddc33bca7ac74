"""Matrices that are singular but for round-off, found by what their factor makes of a known solution."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.linear._equilibration_kernels import equilibrating_scale
from fcsim.linear.factors import Factor, SingularMatrix, probes
from fcsim.linear.over_ranks.rows import RowsOverRanks


def refuse_singular(block: sp.sparray | RowsOverRanks, factor: Factor) -> None:
    """Raise SingularMatrix where the factor does not find a known solution of the matrix (csr or csc, or over ranks) again.

    Round-off hides the zero pivot of most singular matrices, such as the stiffness of a body without supports. The known solution
    is random in the scaling that makes the rows' largest entries equal (Ruiz 2001), so that units and multipliers do not matter; over
    ranks, where the matrix is positive definite, in the scaling that makes its diagonal one.
    """
    size = block.shape[0]
    if isinstance(block, RowsOverRanks):
        scale = 1 / np.sqrt(block.diagonal())[:, None]
    else:
        scale = equilibrating_scale(block.indptr, block.indices, block.data, 5)[:, None]
    known = scale * probes(size).T
    found = factor.solve(block @ known)
    if not np.abs((found - known) / scale).max() <= 1e-2:
        raise SingularMatrix(f"M is singular to working precision: a block of {size} degrees of freedom (a body without supports?)")
