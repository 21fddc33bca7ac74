"""Whether a point of Newton's method leads on though its residual is larger: the natural monotonicity test.

A slender body that turns is stretched by the straight way of its nodes: of the turning theta by theta^2 / 2, which stretching's stiffness,
(L / h)^2 times that of bending, makes a residual larger than the one before. The next correction takes it away. With the matrix A of the
last problem, R at the new point and dv the way there, of the length l of Newton's own,

    |A^-1 R| <= (1 - l / 2) |dv / l|                                                                                                   (1)

does not ask how stiff what is off is.

Source: P. Deuflhard, Newton methods for nonlinear problems, Springer, 2004, section 3.3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor

JAMMED = ((2, 1 / 32), (4, 1.0))
"""How many iterations one after the other that went less than how far, after which one goes all the way, whatever the residual: contacts
that press are between two states then. Without them it is a body that loses its stiffness."""


def jams(lengths: Sequence[float]) -> bool:
    """Whether iterations of these lengths jam, see `JAMMED`."""
    return any(len(lengths) >= n and max(lengths[-n:]) < limit for n, limit in JAMMED)


def leads_on(factor: SystemFactor, R: FloatArray, newton: FloatArray, length: float) -> bool:
    """(1), of R (n_dofs,) after the share `length` of Newton's correction, which is `newton` (n_dofs,)."""
    model = factor.model
    unknowns = model.free_dofs if model.driven == "eliminated" else slice(None)
    return bool(np.linalg.norm(factor.solve(model.along(R)[unknowns])) <= (1 - 0.5 * length) * np.linalg.norm(newton))
