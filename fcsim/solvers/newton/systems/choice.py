"""The one place that decides what solves Newton's linear systems: by size, storage, density, joints, and whether a memory is kept."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linear.joints import joint_rows
from fcsim.problem.delassus import DENSE_UP_TO, FILLED, SMALL
from fcsim.solvers.memory import Memory
from fcsim.solvers.newton.systems.condensed import CondensedSystem, KeptCondensation
from fcsim.solvers.newton.systems.direct import DenseSystem, SparseSystem
from fcsim.solvers.newton.systems.interface import NewtonSystem, Shifted
from fcsim.solvers.newton.systems.multifrontal import MultifrontalSystem
from fcsim.solvers.newton.systems.velocity import VelocitySystem

SYSTEMS = ("dense", "condensed", "multifrontal", "sparse")
"""Names of the linear algebra for the option `linear` of Newton's methods, beside "auto" and "kkt"."""

CONDENSED_UP_TO = 12_000
"""Contact unknowns up to which the dense factor of a sparse W is affordable (1.1 GB)."""
IN_VELOCITIES_FROM = 300
"""Contact unknowns from which a regularised W of few degrees of freedom is eliminated in the bodies' velocities."""
ONCE_SPARSE, ONCE_DENSE = 500_000, 400
"""Where nothing is held for long (`once`): entries of a sparse W up to which SuperLU is cheapest, unknowns of a dense one up to which the
LU of the whole costs less than a condensed elimination that serves one matrix."""


def newton_system(
    operator: Shifted, linear: str = "auto", *, condensing: bool, memory: Memory | None = None, once: bool = False
) -> NewtonSystem:
    """What solves A (W + D) + B for the operator W + D.

    linear      one of `SYSTEMS`, or "auto"
    condensing  whether the formulation's A and B let contacts be held (AC, JM)
    memory      of what earlier solves left and where something may be left, None: nothing is to be kept
    once        whether the operator will change by other shifts or is far from a solution, so that factors do not last

    "auto": a regularised W of bodies with few degrees of freedom is eliminated in their velocities. A small sparse W is made dense.
    Where contacts come in joints and that saves most of the work, multifrontal LU, unless a memory keeps what condensed elimination
    leaves for the next steps (which uses the joints too). Else condensed elimination where it may, dense LU else, on a dense W and on a
    sparse one whose factor would be dense and is affordable; else sparse LU.
    """
    if linear == "auto" and operator.motion is not None and len(operator.by_unknown) >= IN_VELOCITIES_FROM and _regular(operator.shift):
        return VelocitySystem(operator)
    kept = memory.of_same_contacts(KeptCondensation) if condensing and memory is not None else None
    if linear == "auto" and sp.issparse(operator.W) and len(operator.by_unknown) <= SMALL:
        operator = Shifted(operator.W.toarray(), operator.dimension, operator.shift)
    if linear == "auto":
        linear, rows = _automatic(operator, condensing, memory, kept, once)
        if rows is not None:
            return rows
    if linear == "condensed":
        return CondensedSystem(operator, kept)
    if linear == "multifrontal":
        return MultifrontalSystem(operator)
    if linear == "sparse":
        return SparseSystem(operator)
    if sp.issparse(operator.W):
        operator = Shifted(operator.W.toarray(), operator.dimension, operator.shift)
    return DenseSystem(operator)


def _regular(shift: FloatArray | None) -> bool:
    """Whether the contacts' own equations are regular with this shift, whatever their status."""
    return shift is not None and bool(np.all(shift > 0))


def _automatic(
    operator: Shifted, condensing: bool, memory: Memory | None, kept: KeptCondensation | None, once: bool
) -> tuple[str, NewtonSystem | None]:
    """The name of what fits, and the system itself where it was found on the way."""
    W, d = operator.W, operator.dimension
    m = W.shape[0]
    if not sp.issparse(W):
        return "condensed" if condensing and not (once and m <= ONCE_DENSE) else "dense", None
    if kept is not None and kept.pattern is not None:
        return "condensed", None  # which looks for the joints of this W itself
    rows = joint_rows(operator.matrix, d)
    if rows is not None:
        return ("condensed", None) if condensing and memory is not None else ("multifrontal", MultifrontalSystem(operator, rows))
    if once and W.nnz <= ONCE_SPARSE:
        return "sparse", None
    if m <= (CONDENSED_UP_TO if condensing else DENSE_UP_TO) and W.nnz >= FILLED * m**2:
        return "condensed" if condensing else "dense", None
    return "sparse", None
