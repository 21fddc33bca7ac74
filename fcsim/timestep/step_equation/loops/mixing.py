"""Anderson's mixing: the fixed point of g from the last values of g, faster than e <- g(e) and also where that does not converge.

Source: H. F. Walker, P. Ni, "Anderson acceleration for fixed-point iterations", SIAM J. Numer. Anal. 49, 2011 (the least squares problem in
differences of residuals).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fcsim.arrays import FloatArray

DEPTH = 6
"""How many earlier values are mixed."""


@dataclass(frozen=True, eq=False)
class Mixing:
    """The last points e and values g(e) (n,), newest last."""

    points: tuple[FloatArray, ...] = field(default=())
    values: tuple[FloatArray, ...] = field(default=())

    def then(self, e: FloatArray, g: FloatArray) -> Mixing:
        """Return the mixing with one more value."""
        return Mixing((*self.points[-DEPTH:], e), (*self.values[-DEPTH:], g))

    def next_point(self, scale: FloatArray) -> FloatArray:
        """The next e: g - dG c with the c of least |f - dF c| / scale, f = g - e the last residual and dF, dG the changes of f and g."""
        G = np.array(self.values)
        if len(G) == 1:
            return G[0]
        F = (G - np.array(self.points)) / scale
        c = np.linalg.lstsq(np.diff(F, axis=0).T, F[-1], rcond=1e-10)[0]
        mixed: FloatArray = G[-1] - c @ np.diff(G, axis=0)
        return mixed
