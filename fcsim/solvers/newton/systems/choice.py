"""The one place that decides what solves Newton's linear systems: by size, storage, density, joints, and whether a memory is kept."""

from __future__ import annotations

from functools import partial

import numpy as np

from fcsim.problem import Delassus
from fcsim.problem.distributed import DistributedDelassus
from fcsim.solvers.memory import Memory
from fcsim.solvers.newton.systems.condensed import TWO_LEVEL_FROM, CondensedSystem, KeptCondensation
from fcsim.solvers.newton.systems.direct import DenseSystem, SparseSystem
from fcsim.solvers.newton.systems.interface import NewtonSystem
from fcsim.solvers.newton.systems.multifrontal import MultifrontalSystem
from fcsim.solvers.newton.systems.over_ranks import KeptPreconditioner, SystemOverRanks
from fcsim.solvers.newton.systems.two_level.alone import KeptTwoLevel, SystemByBodies
from fcsim.solvers.newton.systems.velocity import VelocitySystem

OF_ENTRIES = ("dense", "condensed", "multifrontal", "sparse")
SYSTEMS = (*OF_ENTRIES, "two-level")
"""Names of the linear algebra for the option `linear` of Newton's methods, beside "auto" and "kkt"; OF_ENTRIES: those that ask for no
more than W."""

IN_VELOCITIES_FROM = 300
"""Contact unknowns from which a regularised W of few degrees of freedom is eliminated in the bodies' velocities."""
WHOLE, ONCE_WHOLE = 150, 400
"""Contact unknowns up to which the LU of the whole dense matrix costs less than a condensed elimination, even one that is held from
iteration to iteration, and one that serves one matrix (`once`)."""


def newton_system(
    operator: Delassus, linear: str = "auto", *, condensing: bool, memory: Memory | None = None, once: bool = False
) -> NewtonSystem:
    """What solves A (W + D) + B for the operator W + D.

    linear      one of `SYSTEMS`, or "auto"
    condensing  whether the formulation's A and B let contacts be held (AC, JM)
    memory      of what earlier solves left and where something may be left, None: nothing is to be kept
    once        whether the operator will change by other shifts or is far from a solution, so that factors do not last

    "auto": a W of bodies with few degrees of freedom, regularised or of joints with springs, is eliminated in their velocities. Else W is
    stored as its elimination asks for (`Delassus.stored`): where contacts come in joints and that saves most of the work, multifrontal
    LU, unless a memory keeps what condensed elimination leaves for the next steps (which uses the joints too), or its bodies are known and
    it is large; where it is dense, condensed elimination where it may, dense LU else; otherwise sparse LU. A W over ranks is solved
    with by all of them (`SystemOverRanks`), by "two-level" as by "auto".
    """
    if isinstance(operator.W, DistributedDelassus):
        whole = partial(newton_system, linear="auto" if linear == "two-level" else linear, condensing=condensing)
        if linear not in ("auto", "two-level"):
            return whole(Delassus(operator.W.whole, operator.dimension, operator.shift))
        return SystemOverRanks(operator, whole, None if memory is None else memory.of_same_contacts(KeptPreconditioner))
    if linear == "two-level":
        by_bodies = None if memory is None else memory.of_same_contacts(KeptTwoLevel)
        return SystemByBodies(operator, partial(newton_system, condensing=condensing), by_bodies)
    kept = memory.of_same_contacts(KeptCondensation) if condensing and memory is not None else None
    if linear == "auto":
        if eliminated_in_velocities(operator) and _regular(operator):
            return VelocitySystem(operator)
        if kept is not None and kept.pattern is not None and operator.is_sparse:
            return CondensedSystem(operator, kept)  # which looks for the joints of this W itself
        operator = operator.stored
        linear = _fitting(operator, condensing, keeps=memory is not None, once=once)
    if linear == "condensed":
        return CondensedSystem(operator, kept)
    if linear == "multifrontal":
        return MultifrontalSystem(operator, operator.joints)
    if linear == "sparse":
        return SparseSystem(operator)
    W = operator.W
    return DenseSystem(operator if isinstance(W, np.ndarray) else Delassus(W.toarray(), operator.dimension, operator.shift))


def eliminated_in_velocities(operator: Delassus) -> bool:
    """Whether W + D of a positive shift is eliminated in the bodies' velocities."""
    return operator.motion is not None and operator.size >= IN_VELOCITIES_FROM


def _regular(operator: Delassus) -> bool:
    """Whether the contacts' own equations are regular, whatever their status: by the shift, or by compliances of their own."""
    if operator.shift is not None and bool(np.all(operator.shift > 0)):
        return True
    return operator.motion is not None and operator.motion.regular


def without_a_factor(operator: Delassus) -> bool:
    """Whether bodies in joints are known behind a W so large that its systems are solved by two levels, without a factor of it."""
    return operator.shares is not None and operator.size >= TWO_LEVEL_FROM


def _fitting(operator: Delassus, condensing: bool, *, keeps: bool, once: bool) -> str:
    """The name of what serves an operator so stored."""
    if operator.elimination == "sparse":
        return "sparse"
    if operator.elimination == "fronts":
        return "condensed" if condensing and (keeps or without_a_factor(operator)) else "multifrontal"
    return "condensed" if condensing and operator.size > (ONCE_WHOLE if once else WHOLE) else "dense"
