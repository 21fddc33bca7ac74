"""What is odd about the matrices of a file: remarks, since fcsim takes them as they stand."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.export_fclib.content import Problem
from fcsim.problem import LocalProblem

SYMMETRIC = 1e-9
"""Of a matrix' largest entry: what it may differ by from its transpose and be called symmetric."""


def odd_matrices(problem: Problem) -> tuple[str, ...]:
    """Remarks on M of a global, on W of a local problem: one triangle where both are meant, no symmetry, entries that no matrix >= 0 has.

    Of a symmetric A >= 0 all a_ii >= 0 and a_ij^2 <= a_ii a_jj; that is looked at entry by entry, so it finds signs and scales that
    are wrong, not every negative eigenvalue.

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
        half = 0.5 * (B / float(np.abs(value).max()))  # of the largest entry: those of 1e308 differ by more than a float holds
        off = 2 * float(np.abs((half - half.T).data).max(initial=0.0))
        if off > SYMMETRIC:
            found.append(f"{letter} is not symmetric: entries differ from those across the diagonal by up to {off:.2g} of the largest")
    negative = row[(row == column) & (value < 0)]
    if negative.size:
        found.append(
            f"{letter} has {negative.size} entries < 0 on its diagonal, the first in row {negative.min()}: is its sign turned over?"
        )
    elif row.size:
        i, j, off = _beyond(row, column, value, A.shape[0])
        if off > 1 + SYMMETRIC:
            found.append(
                f"{letter} is not >= 0: its entries at ({i}, {j}) and ({j}, {i}) are {off:.3g} of the most that the diagonal allows there"
            )
    return tuple(found)


def _beyond(row: IntArray, column: IntArray, value: FloatArray, size: int) -> tuple[int, int, float]:
    """Row i < column j and |a_ij + a_ji| / (2 sqrt(a_ii a_jj)) of the pair where it is largest: <= 1 wherever x . A x >= 0 for all x.

    Entries below SYMMETRIC of the largest are rounding errors and passed over.
    """
    A = sp.csr_array((value, (row, column)), shape=(size, size))
    pairs = sp.coo_array(sp.triu((A + A.T) / 2, 1))
    diagonal = np.sqrt(A.diagonal())
    scale = diagonal[pairs.row] * diagonal[pairs.col]
    filled = np.abs(pairs.data) > SYMMETRIC * np.abs(value).max()
    share = np.divide(np.abs(pairs.data), scale, out=np.where(filled, np.inf, 0.0), where=filled & (scale > 0))
    if not share.size:
        return 0, 0, 0.0
    worst = int(share.argmax())
    return int(pairs.row[worst]), int(pairs.col[worst]), float(share[worst])
