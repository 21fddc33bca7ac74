"""Stress at the cell centres as one sparse matrix times the displacement, and its von Mises value.

The layout is the same in 2D and 3D: components (xx, yy, zz, xy, yz, zx) [Pa] of each cell, cells in the part's order. The
centre is where the stress of a first-order cell is most accurate (its one-point Gauss rule).

Source: O. C. Zienkiewicz, R. L. Taylor, J. Z. Zhu, The Finite Element Method, 6th ed., 2005, chapters 2, 4 and 13.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from fcsim.arrays import FloatArray
from fcsim.assembly.elasticity import lame, once_per_part
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Part

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")


@once_per_part
def stress_operator(part: Part) -> csr_array:
    """Return S (6 ncells, d nn) [Pa/m]: `(S @ x).reshape(-1, 6)` is the stress at the cell centres for the displacement x (d nn,) [m].

    In 2D sigma_yz = sigma_zx = 0; sigma_zz = nu (sigma_xx + sigma_yy) in plane strain and 0 in plane stress. Read-only, made once per part.
    """
    d, (n_cells, k) = part.dimension, part.cells.shape
    cell = CELL_TYPES[part.cell_type]
    reference = cell.gradient(cell.centre)[0]
    jacobian = np.einsum("cai,aj->cij", part.points[part.cells], reference)  # d x_i / d r_j
    gradient = reference @ np.linalg.inv(jacobian)  # (n_cells, k, d): d N_a / d x_i

    strain = np.zeros((n_cells, 6, k, d))  # shear components are gamma = 2 epsilon
    for component, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)]):
        if max(i, j) < d:
            strain[:, component, :, i] = gradient[:, :, j]
            strain[:, component, :, j] = gradient[:, :, i]
    stress = np.einsum("pq,cqai->cpai", _elasticity(part), strain)

    shape = stress.shape
    row = np.broadcast_to(np.arange(6 * n_cells).reshape(n_cells, 6, 1, 1), shape)
    column = np.broadcast_to((d * part.cells[:, :, None] + np.arange(d))[:, None], shape)
    operator = csr_array((stress.ravel(), (row.ravel(), column.ravel())), shape=(6 * n_cells, d * len(part.points)))
    operator.eliminate_zeros()
    operator.data.setflags(write=False)
    return operator


def von_mises(stress: ArrayLike) -> FloatArray:
    """Return sqrt(3/2 s : s) (...) [Pa], s the deviator of the stress (..., 6) [Pa] with components xx, yy, zz, xy, yz, zx."""
    stress = np.asarray(stress, dtype=np.float64)
    if stress.ndim == 0 or stress.shape[-1] != 6:
        raise InputError(f"von_mises: expected stresses of shape (..., 6) in the order {', '.join(COMPONENTS)}, got {stress.shape}")
    xx, yy, zz, xy, yz, zx = np.moveaxis(stress, -1, 0)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * (xy**2 + yz**2 + zx**2))


def _elasticity(part: Part) -> FloatArray:
    """Return C (6, 6) [Pa], stress = C (eps_xx, eps_yy, eps_zz, gamma_xy, gamma_yz, gamma_zx), with the plane hypothesis applied."""
    first, second = lame(part)
    C = np.diag([2 * second] * 3 + [second] * 3)
    C[:3, :3] += first
    if part.dimension == 2 and part.plane == "stress":
        C[2] = 0  # the other rows hold the plane stress lambda already
    return C
