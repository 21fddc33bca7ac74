"""Rotations nearest to matrices, and their angles."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.forms._rotation_kernels import newton_rotations


def polar_rotation(A: FloatArray) -> FloatArray:
    """The rotations R (n, d, d) nearest to matrices A (n, d, d), R^T A symmetric: by Newton's method, and where A mirrors or is nearly
    singular U diag(1, .., det) V^T of A = U s V^T."""
    rotations, found = np.empty(A.shape), np.zeros(len(A), dtype=bool)
    newton_rotations(A, rotations, found)
    if not found.all():
        rotations[~found] = _by_singular_values(A[~found])
    return rotations


def _by_singular_values(A: FloatArray) -> FloatArray:
    """`polar_rotation` of any matrices."""
    U, _, Vt = np.linalg.svd(A)
    rotations: FloatArray = U @ Vt
    mirrored = np.linalg.det(rotations) < 0
    if mirrored.any():
        U[mirrored, :, -1] *= -1
        rotations[mirrored] = U[mirrored] @ Vt[mirrored]
    return rotations


def angle_of(R: FloatArray) -> FloatArray:
    """Angles (n,) [rad], 0 to pi, by which rotation matrices (n, d, d) turn; exact for small ones too."""
    d = R.shape[-1]
    skew = R - R.transpose(0, 2, 1)
    sine = np.sqrt(np.einsum("bij,bij->b", skew, skew) / 8)
    cosine = 0.5 * (np.trace(R, axis1=1, axis2=2) - (d - 2))
    return np.arctan2(sine, cosine)
