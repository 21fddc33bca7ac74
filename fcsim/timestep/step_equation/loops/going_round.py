"""Newton's method in statics that finds points of a concave surface on one of its facets and on the next in turns."""

from __future__ import annotations

from collections.abc import Sequence

from fcsim.arrays import FloatArray
from fcsim.timestep.encounter import Redetection

ROUND = 6
"""So many iterations one after the other without half of the least residual before them get nowhere."""


def goes_round(residuals: Sequence[float], anew: Redetection, v: FloatArray) -> bool:
    """Whether the iterations with these residuals, the last at v (n_dofs,), get nowhere, and points are in valleys, which all of their
    facets could hold: see `fcsim.contact_detection.concave.valleys`."""
    if len(residuals) <= ROUND or min(residuals[-ROUND:]) < 0.5 * min(residuals[:-ROUND]):
        return False
    valleys = anew.in_valleys()
    return valleys is not anew and len(valleys.met(v, None).contacts) > len(anew.met(v, None).contacts)
