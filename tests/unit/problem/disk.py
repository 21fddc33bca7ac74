"""The projection on a disk in NumPy, beside which the compiled kernels are laid."""

from __future__ import annotations

import numpy as np


def project_disk(z: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Tangential vectors z (nc, d - 1) cut back to length radius (nc,) >= 0."""
    norm = np.sqrt(np.einsum("ai,ai->a", z, z))
    factor = np.where(norm > radius, radius / np.where(norm > 0, norm, 1), 1)
    return factor[:, None] * z
