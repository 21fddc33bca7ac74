"""Where W comes from: W = H^T M^-1 H + diag(C) of bodies whose degrees of freedom are far fewer than the contact unknowns.

Rigid blocks meet in four and more points a face, so that the rank of H^T M^-1 H, at most n, is a fraction of its size m. A method that
knows H and M can then solve in the bodies' velocities. C is the contacts' own compliance, of joints with springs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, Matrix
from fcsim.brief import brief


@dataclass(frozen=True, eq=False)
class Motion:
    """HT (m, n) by rows and M (n, n) by rows, sparse, and own (m,), C >= 0 [velocity per impulse; quasi-statics: displacement per force],
    None for none, with W = HT M^-1 HT^T + diag(own); W: the very matrix that they are known for.

    A problem with another W in its place (`dataclasses.replace`) still has this value, which says nothing about that one: ask by `of`.
    """

    HT: sp.csr_array
    M: sp.csr_array
    W: Matrix
    own: FloatArray | None = None

    __repr__ = brief

    @property
    def regular(self) -> bool:
        """Whether W is regular since every contact unknown has a compliance of its own."""
        return self.own is not None and bool(np.all(self.own > 0))

    def of(self, W: Matrix) -> Motion | None:
        """This value if it belongs to W, None if to another matrix."""
        return self if self.W is W else None

    def stored_as(self, W: Matrix, other: Matrix) -> Motion | None:
        """The value for `other`, which is W in another storage; None where it does not belong to W."""
        return replace(self, W=other) if self.W is W else None
