"""Stress at the cell centres as one sparse matrix times the displacement, and its von Mises value.

The layout is the same in 2D and 3D: components (xx, yy, zz, xy, yz, zx) [Pa] of each cell, cells in the part's order. The
centre is where the stress of a first-order cell is most accurate (its one-point Gauss rule); `stress_at` gives it elsewhere.

Source: O. C. Zienkiewicz, R. L. Taylor, J. Z. Zhu, The Finite Element Method, 6th ed., 2005, chapters 2, 4 and 13.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from fcsim.arrays import FloatArray
from fcsim.assembly.discretisation import once_per_part
from fcsim.assembly.elasticity import elasticity_matrix
from fcsim.assembly.elements import strain_blocks
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.part import Part
from fcsim.mesh.region_parts import region_parts

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "zx")


@once_per_part
def stress_operator(part: Part) -> csr_array:
    """Return S (6 ncells, d nn) [Pa/m]: `(S @ x).reshape(-1, 6)` is the stress at the cell centres for the displacement x (d nn,) [m],
    strained as the part's elements are (`fcsim.assembly.elements`).

    In 2D sigma_yz = sigma_zx = 0; sigma_zz = nu (sigma_xx + sigma_yy) in plane strain and 0 in plane stress. Read-only, made once per part.
    """
    return stress_at(part, CELL_TYPES[part.cell_type].centre)


def stress_at(part: Part, at: ArrayLike) -> csr_array:
    """Return S (6 nq ncells, d nn) [Pa/m]: `(S @ x).reshape(-1, nq, 6)` is the stress of each cell at the points `at` (nq, d) of the
    reference cell (`fcsim.mesh.cell_type`), with the inner modes of the part's elements. Elements that bend have in their corners
    the stress of the outer fibres. Read-only. Raises InputError for points that are not in the reference cell.
    """
    at = _in_reference_cell(part, at)
    if isinstance(part.material, ByRegion):
        return _of_regions(part, at)
    C = elasticity_matrix(part)
    values, columns = [], []
    for dofs, strain in strain_blocks(part, C, at):
        stress = C @ strain
        values.append(stress.reshape(-1, dofs.shape[1]))
        columns.append(np.repeat(dofs, 6 * len(at), axis=0))
    rows = 6 * len(at) * len(part.cells)
    row = np.repeat(np.arange(rows), columns[0].shape[1])
    operator = csr_array((np.concatenate(values).ravel(), (row, np.concatenate(columns).ravel())), shape=(rows, part.points.size))
    operator.eliminate_zeros()
    operator.data.setflags(write=False)
    return operator


def _of_regions(part: Part, at: FloatArray) -> csr_array:
    """The operators of the regions, their rows in the order of the part's cells."""
    d, each = part.dimension, 6 * len(at)
    rows, columns, values = [], [], []
    for region in region_parts(part):
        own = stress_at(region.part, at).tocoo()
        dofs = (d * region.nodes[:, None] + np.arange(d)).ravel()
        rows.append(each * region.cells[own.row // each] + own.row % each)
        columns.append(dofs[own.col])
        values.append(own.data)
    place = np.concatenate(rows), np.concatenate(columns)
    operator = csr_array((np.concatenate(values), place), shape=(each * len(part.cells), part.points.size))
    operator.data.setflags(write=False)
    return operator


def _in_reference_cell(part: Part, at: ArrayLike) -> FloatArray:
    cell = CELL_TYPES[part.cell_type]
    points = np.asarray(at, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != cell.dimension or not np.all(np.isfinite(points)):
        raise InputError(f"stress_at on Part {part.name!r}: expected finite points of shape (nq, {cell.dimension}), got {points.shape}")
    low, reach = (0.0, points.sum(axis=1)) if cell.simplex else (-1.0, points.max(axis=1))
    if np.any(points < low - 1e-12) or np.any(reach > 1 + 1e-12):
        where = "the unit simplex" if cell.simplex else f"[-1, 1]^{cell.dimension}"
        raise InputError(f"stress_at on Part {part.name!r}: expected points of the reference cell, {where}, got {points.tolist()}")
    return points


def von_mises(stress: ArrayLike) -> FloatArray:
    """Return sqrt(3/2 s : s) (...) [Pa], s the deviator of the stress (..., 6) [Pa] with components xx, yy, zz, xy, yz, zx."""
    stress = np.asarray(stress, dtype=np.float64)
    if stress.ndim == 0 or stress.shape[-1] != 6:
        raise InputError(f"von_mises: expected stresses of shape (..., 6) in the order {', '.join(COMPONENTS)}, got {stress.shape}")
    xx, yy, zz, xy, yz, zx = np.moveaxis(stress, -1, 0)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * (xy**2 + yz**2 + zx**2))
