"""By how much the stress of a body's cells is not that of a body: `fcsim.assembly.locking.recovery` for all kinds of materials."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.discretisation import once_per_part
from fcsim.assembly.elasticity import elasticity_matrix
from fcsim.assembly.elements import quadrature
from fcsim.assembly.functions.of_bodies import SYMMETRIC
from fcsim.assembly.locking.recovery import of_cells, recovery, voigt
from fcsim.assembly.model import Model
from fcsim.assembly.stress import stress_at
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.part import Part
from fcsim.mesh.region_parts import region_parts


@dataclass(frozen=True, eq=False)
class StressError:
    """error, energy (nc,) [J]: ||s* - s||^2 and ||s*||^2 of a body's cells; strain: the root of their mean elastic strain squared."""

    error: FloatArray
    energy: FloatArray
    strain: float

    def share(self, cells: BoolArray | None = None) -> float:
        """eta^2 of the cells (nc,) that are meant, by default of all; 0 where nothing is stressed."""
        error, energy = (float(values[cells].sum() if cells is not None else values.sum()) for values in (self.error, self.energy))
        return error / energy if energy > 0 else 0.0


def stress_error(model: Model, number: int, x: FloatArray, internal: FloatArray | None, t: float) -> StressError:
    """Of deformable body `number` of the model in the configuration x (n_dofs,), with the internal variables at t [s]."""
    part = model.deformable[number].part
    error, energy, square, volume = *np.zeros((2, len(part.cells))), 0.0, recovery(part).volume
    for cells, stress, compliance in _stresses(model, number, x, internal, t):
        error[cells], energy[cells] = of_cells(recovery(part), cells).energies(stress, compliance)
        square += float(np.einsum("cq,cqs->", volume[cells], (stress @ compliance) ** 2))
    return StressError(error, energy, float(np.sqrt(square / volume.sum())))


def nodal_stress(model: Model, number: int, x: FloatArray, internal: FloatArray | None, t: float) -> FloatArray:
    """Stress (nn, 6) [Pa] at the nodes of deformable body `number`, components (xx, yy, zz, xy, yz, zx) along the world's axes: s* of
    `fcsim.assembly.locking.recovery`, of laws of points Cauchy's, of a turning body of linear material turned with its frame. Where
    materials meet, the mean of theirs."""
    body = model.deformable[number]
    total, count = np.zeros((len(body.part.points), 6)), np.zeros(len(body.part.points))
    for cells, stress, _ in _stresses(model, number, x, internal, t, cauchy=True):
        nodes, own = of_cells(recovery(body.part), cells).at_nodes(stress)
        total[nodes] += own
        count[nodes] += 1
    R = np.eye(3)
    R[: model.dimension, : model.dimension] = model.elastic.rotation(model.elastic.at(x))[number] @ body.rotation
    return voigt(R @ (total / count[:, None])[:, SYMMETRIC] @ R.T)


def _stresses(
    model: Model, number: int, x: FloatArray, internal: FloatArray | None, t: float, *, cauchy: bool = False
) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
    """By materials the cells, their stress (nc, nq, 6) [Pa] at the points of quadrature, the compliance (6, 6) [1/Pa]."""
    for group, laws, own in model.nonlinear.shares(internal):
        for b in np.flatnonzero(group.members == number):
            u = x[group.dofs[b]].reshape(-1, model.dimension) @ group.rotation
            for region, S in laws.point_stresses(u, own[b], t, cauchy):
                yield region.numbers, voigt(S), np.linalg.pinv(voigt(voigt(region.reference).swapaxes(-1, -3).swapaxes(-1, -2)))
            return
    part, (nodes,) = model.deformable[number].part, model.node_offset[number : number + 1]
    y = model.strained_displacement(x)[nodes : nodes + len(part.points)] @ model.deformable[number].rotation
    stress = (_at_points(part) @ y.ravel()).reshape(len(part.cells), -1, 6)
    for cells, compliance in _linear(part):
        yield cells, stress[cells], compliance


@once_per_part
def _at_points(part: Part) -> sp.csr_array:
    return stress_at(part, quadrature(CELL_TYPES[part.cell_type])[0])


@once_per_part
def _linear(part: Part) -> tuple[tuple[IntArray, FloatArray], ...]:
    """Of a part of linear materials the cells of each and its compliance."""
    if not isinstance(part.material, ByRegion):
        return ((np.arange(len(part.cells)), np.linalg.pinv(elasticity_matrix(part))),)
    return tuple((region.cells, np.linalg.pinv(elasticity_matrix(region.part))) for region in region_parts(part))
