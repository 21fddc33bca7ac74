"""Deformable bodies as an unstructured grid, rigid ones as surfaces, at each instant with what moves and strains them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.by_region import is_linear
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.running.series.vtk import VTK, in_space

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

    from fcsim.assembly.model import Model
    from fcsim.timestep.state import State

_FINE, _COARSE, _MANY = 24, 12, 200  # facets around exact shapes, where there are many of them fewer


def _body_nodes(model: Model, numbers: list[int]) -> tuple[NDArray, NDArray]:
    """Return the global nodes of the bodies, one after the other, and where each body begins among them (nbodies + 1,)."""
    first, last = np.asarray(model.node_offset)[numbers], np.asarray(model.node_offset)[np.array(numbers) + 1]
    return np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)]), np.concatenate([[0], np.cumsum(last - first)])


class Blocks:
    """The unstructured grid of the deformable bodies; bodies of the same part share one stress operator and one product with it."""

    def __init__(self, vtk: VTK, model: Model, numbers: list[int]) -> None:
        from fcsim.assembly.stress import stress_operator, von_mises

        self._vtk, self._von_mises, self._model = vtk, von_mises, model
        bodies = [body for k in numbers if isinstance(body := model.bodies[k], Body)]
        self._nodes, node_begin = _body_nodes(model, numbers)
        count = np.array([len(body.part.cells) for body in bodies])
        cell_begin = np.concatenate([[0], np.cumsum(count)])
        self._ncells, self._cell_begin = int(cell_begin[-1]), cell_begin

        members: dict[Part, list[int]] = {}
        for place, body in enumerate(bodies):
            members.setdefault(body.part, []).append(place)
        # a part: its operator, its bodies' nodes (nb, nn), their rotations (nb, d, d), their cells (nb, ncells)
        self._parts = [
            (
                stress_operator(part) if is_linear(part.material) else None,
                self._nodes[node_begin[places][:, None] + np.arange(len(part.points))],
                np.stack([bodies[place].rotation for place in places]),
                cell_begin[places][:, None] + np.arange(len(part.cells)),
            )
            for part, places in members.items()
        ]

        self._largest = [0.0 if S is None else float(abs(S).sum(axis=1).max()) for S, *_ in self._parts]  # sum_j |S_ij| [Pa/m]
        self._size = [float(np.ptp(part.points, axis=0).max()) for part in members]

        width = np.repeat([body.part.cells.shape[1] for body in bodies], count)
        connectivity = np.concatenate([(body.part.cells + begin).ravel() for body, begin in zip(bodies, node_begin, strict=False)])
        kinds = np.repeat(np.array([CELL_TYPES[body.part.cell_type].vtk for body in bodies], dtype=np.uint8), count)
        self._grid = vtk.data.vtkUnstructuredGrid()
        self._grid.SetPoints(vtk.points(np.asarray(model.reference)[self._nodes]))
        self._grid.SetCells(vtk.support.numpy_to_vtk(kinds, deep=True), vtk.cells(np.concatenate([[0], np.cumsum(width)]), connectivity))
        self._grid.GetCellData().AddArray(vtk.array("body", np.repeat(np.array(numbers, dtype=np.int32), count)))

    def dataset(self, displacement: NDArray, velocity: NDArray, strained: NDArray, state: State) -> vtkUnstructuredGrid:
        point_data, cell_data = self._grid.GetPointData(), self._grid.GetCellData()
        point_data.AddArray(self._vtk.array("displacement", in_space(displacement[self._nodes])))
        point_data.AddArray(self._vtk.array("velocity", in_space(velocity[self._nodes])))
        stress = self._stress(strained)
        for name, values in self._nonlinear(stress, state).items():
            cell_data.AddArray(self._vtk.array(name, values))
        cell_data.AddArray(self._vtk.array("von_mises", stress))
        self._grid.GetFieldData().AddArray(self._vtk.array("round_off_of_stress", np.array([self._round_off(displacement)])))
        return self._grid

    def _round_off(self, displacement: NDArray) -> float:
        """[Pa] what the stresses of linear parts have of round-off, about eps sum_j |S_ij| |x_j|: more, the farther they have come; and of
        displacements that are below the round-off of positions, eps times the part's size, as where nothing loads a body."""
        moved = (float(np.abs(displacement[nodes]).max()) for _, nodes, _, _ in self._parts)
        return float(np.finfo(np.float64).eps * max(S * max(y, size) for S, y, size in zip(self._largest, moved, self._size, strict=True)))

    def _nonlinear(self, von_mises: NDArray, state: State) -> dict[str, NDArray]:
        """Put the von Mises stress of bodies of nonlinear materials in its place; their internal variables by name, (ncells,) or
        (ncells, c), means of the cells' points, nan where a material has none of that name."""
        found: dict[str, NDArray] = {}
        if not self._model.nonlinear:
            return found
        for group, inner, variables in self._model.nonlinear.at_cells(state.x, state.internal, state.t):
            for b, body in enumerate(group.members.tolist()):
                begin = self._cell_begin[body]
                cells = slice(begin, begin + inner.stress.shape[1])
                von_mises[cells] = self._von_mises(inner.stress[b])
                for name, values in variables.items():
                    all_cells = found.setdefault(name, np.full((self._ncells, *values.shape[2:]), np.nan))
                    all_cells[cells] = values[b]
        return found

    def _stress(self, strained: NDArray) -> NDArray:
        """von Mises stress (ncells,) [Pa]: stress = S R^T y for all bodies of a part at once, y the displacement that strains."""
        values = np.empty(self._ncells)
        for operator, nodes, rotation, cells in self._parts:
            if operator is None:
                continue
            in_part_axes = strained[nodes] @ rotation  # rows: (R^T y)^T = y^T R
            stress = (operator @ in_part_axes.reshape(len(nodes), -1).T).reshape(cells.shape[1], 6, len(nodes))
            values[cells] = self._von_mises(stress.transpose(2, 0, 1).reshape(-1, 6)).reshape(cells.shape)
        return values


class RigidSurfaces:
    """The polygons of the rigid bodies' surfaces; a facet that stands in two named surfaces is taken once. A 2D body whose segments are
    one closed line is the polygon within, another one its segments. Exact shapes are drawn by the mesh that they have for it: its points
    move with the body's nodes by their affine weights."""

    def __init__(self, vtk: VTK, model: Model, numbers: list[int]) -> None:
        self._vtk = vtk
        self._nodes, _ = _body_nodes(model, numbers)
        lines: list[tuple[int, list[int]]] = []
        polygons: list[tuple[int, list[int]]] = []
        weights: list[sp.csr_array] = []
        bodies = [(number, body) for number in numbers if isinstance(body := model.bodies[number], RigidBody)]
        many = sum(body.shape is not None for _, body in bodies) > _MANY
        first = 0
        for number, body in bodies:
            if body.shape is None:
                surfaces = list(body.surfaces.values())
                weights.append(sp.eye_array(len(body.points), format="csr"))
            else:
                local, facets = body.shape.display(_COARSE if many else _FINE)
                surfaces = [facets]
                weights.append(sp.csr_array(np.column_stack([1 - local.sum(axis=1) / body.shape.radius, local / body.shape.radius])))
            different = {tuple(sorted(facet)): [n for n in facet if n >= 0] for surface in surfaces for facet in surface.tolist()}
            outline = closed_line(different.values()) if model.dimension == 2 else None
            cells, into = ([outline], polygons) if outline else (different.values(), polygons if model.dimension == 3 else lines)
            into += [(number, [node + first for node in cell]) for cell in cells]
            first += weights[-1].shape[0]
        self._drawn = sp.block_diag(weights, format="csr")
        self._surface = vtk.data.vtkPolyData()
        self._surface.SetPoints(vtk.points(self._drawn @ np.asarray(model.reference)[self._nodes]))
        for given, take in ((lines, self._surface.SetLines), (polygons, self._surface.SetPolys)):
            if given:
                sizes = [len(cell) for _, cell in given]
                take(vtk.cells(np.concatenate([[0], np.cumsum(sizes)]), np.concatenate([cell for _, cell in given])))
        self._surface.GetFieldData().AddArray(vtk.texts("body_names", (body.name for body in model.bodies)))
        # VTK numbers the lines before the polygons
        self._surface.GetCellData().AddArray(vtk.array("body", np.array([number for number, _ in lines + polygons], dtype=np.int32)))

    def dataset(self, displacement: NDArray, velocity: NDArray) -> vtkPolyData:
        self._surface.GetPointData().AddArray(self._vtk.array("displacement", in_space(self._drawn @ displacement[self._nodes])))
        self._surface.GetPointData().AddArray(self._vtk.array("velocity", in_space(self._drawn @ velocity[self._nodes])))
        return self._surface


def closed_line(segments: Iterable[Sequence[int]]) -> list[int] | None:
    """The nodes around the segments (start, end) where these are one closed line, else None."""
    pairs = list(segments)
    following: dict[int, int] = {start: end for start, end in pairs}
    line = [next(iter(following), -1)]
    while (node := following.pop(line[-1], -1)) not in (-1, line[0]):
        line.append(node)
    return line if node == line[0] and len(line) == len(pairs) > 0 else None
