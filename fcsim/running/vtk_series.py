"""The VTK time series of a run: deformable blocks, contact points and rigid bodies, for ParaView and for `fcsim render`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.errors import MissingDependency
from fcsim.files import replacing
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.by_region import is_linear
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.running.folder import read_collection, write_collection

if TYPE_CHECKING:
    from vtkmodules.vtkCommonCore import vtkDataArray, vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPointSet, vtkPolyData, vtkUnstructuredGrid

    from fcsim.assembly.model import Model
    from fcsim.timestep.links.linked import Linked
    from fcsim.timestep.state import State
    from fcsim.timestep.step import Step

# Level 1: three quarters of the size at a third of the time of level 6 more; zlib because meshio and other readers know no LZ4.
COMPRESSION_LEVEL = 1

_FINE, _COARSE, _MANY = 24, 12, 200  # facets around exact shapes, where there are many of them fewer


class _VTK:
    """The few VTK classes a writer needs, loaded on first use (a quarter of the time that all of pyvista takes)."""

    def __init__(self) -> None:
        try:
            core, data, io, support = (
                import_module(f"vtkmodules.{name}") for name in ("vtkCommonCore", "vtkCommonDataModel", "vtkIOXML", "util.numpy_support")
            )
        except ImportError as error:
            raise MissingDependency(f"VTK cannot be imported ({error}), which the VTK files need: pip install 'fcsim[view]'") from None
        self.core, self.data, self.io, self.support = core, data, io, support

    @contextmanager
    def _quiet(self) -> Iterator[None]:
        """VTK prints pages on a full disk; the error says it in a line."""
        shown = self.core.vtkObject.GetGlobalWarningDisplay()
        self.core.vtkObject.SetGlobalWarningDisplay(0)
        try:
            yield
        finally:
            self.core.vtkObject.SetGlobalWarningDisplay(shown)

    def array(self, name: str, values: NDArray) -> vtkDataArray:
        array = self.support.numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        return array

    def points(self, coordinates: NDArray) -> vtkPoints:
        points = self.core.vtkPoints()
        points.SetData(self.support.numpy_to_vtk(_in_space(coordinates), deep=True))
        return points

    def cells(self, offsets: NDArray, connectivity: NDArray) -> vtkCellArray:
        cells = self.data.vtkCellArray()
        cells.SetData(
            self.support.numpy_to_vtkIdTypeArray(offsets.astype(np.int64), deep=True),
            self.support.numpy_to_vtkIdTypeArray(connectivity.astype(np.int64), deep=True),
        )
        return cells

    def write(self, dataset: vtkPointSet, path: Path, t: float) -> None:
        dataset.GetFieldData().AddArray(self.array("TimeValue", np.array([t])))
        writer = getattr(self.io, "vtkXMLPolyDataWriter" if path.suffix == ".vtp" else "vtkXMLUnstructuredGridWriter")()
        writer.SetInputData(dataset)
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        writer.SetCompressorTypeToZLib()
        writer.SetCompressionLevel(COMPRESSION_LEVEL)
        with replacing(path) as temporary, self._quiet():
            writer.SetFileName(str(temporary))
            if writer.Write() != 1 or writer.GetErrorCode():
                raise OSError(f"{path}: VTK could not write the file (error code {writer.GetErrorCode()}; disk full, or not writable?)")


def _in_space(vectors: NDArray) -> NDArray:
    """(n, 2) or (n, 3) -> contiguous (n, 3), z = 0 in 2D: VTK knows three dimensions only."""
    return np.ascontiguousarray(np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1]))))


class SeriesWriter:
    """Writes the VTK series of a model into `directory`: `.write(step)` adds one instant.

    directory  made if absent; holds blocks.pvd, contacts.pvd, rigid.pvd and blocks_00010.vtu, contacts_00010.vtp, rigid_00010.vtp.
               Where the collections exist (a continued run), their entries are kept up to the time of the first step written.
    model      dimension; bodies (Body | RigidBody); node_offset (nbodies + 1,); reference (nodes, d) [m];
               node_displacement(x), node_velocity(v, x) -> (nodes, d) [m], [m/s]

    blocks     points in the reference configuration; point data displacement [m], velocity [m/s]; cell data von_mises [Pa]
               (at the cell's centre), body
    contacts   points at the foot points; reaction (global axes), reaction_normal, reaction_tangential [N], gap [m], status (0 open,
               1 stick, 2 slip), sliding_velocity [m/s], mu, slave and master (numbers of the bodies), identity
               (of the same contact at all instants), normal, displacement [m] of the master surface there, rolling_moment
               [N m] and rolling (0, 1) with rolling resistance, spinning_moment [N m] and spinning (0, 1) with spinning resistance;
               and what the law remembers, by its names (fracture, slip, ...); field data overlap [m] and overlap_place, where the
               witness saw any
    links      where there are any: points where their rows act, as the bodies stand; force [N] on the first body (global axes), link
               (its number in the linkage), gap [m]
    rigid      the surfaces of the rigid bodies; point data displacement [m], velocity [m/s]; cell data body

    Every file is written under a temporary name and renamed, the collection last, so that an interrupted run leaves whole files.
    Raises MissingDependency without VTK, OSError where a file cannot be written.
    """

    def __init__(self, directory: str | Path, model: Model) -> None:
        self.directory = Path(directory)
        self.directory.mkdir(parents=True, exist_ok=True)
        self._model = model
        self._vtk = _VTK()
        deformable = [k for k, body in enumerate(model.bodies) if isinstance(body, Body)]
        rigid = [k for k, body in enumerate(model.bodies) if isinstance(body, RigidBody)]
        self._blocks = _Blocks(self._vtk, model, deformable) if deformable else None
        self._rigid = _RigidSurfaces(self._vtk, model, rigid) if rigid else None
        self._entries = {
            name: read_collection(path) if (path := self.directory / f"{name}.pvd").is_file() else []
            for name, present in (("blocks", deformable), ("contacts", True), ("rigid", rigid))
            if present
        }
        if (path := self.directory / "links.pvd").is_file():
            self._entries["links"] = read_collection(path)

    def write(self, step: Step) -> None:
        """Write the three data sets of a step and take them up in the collections.

        Reads step.number; step.state.t, .x, .v; step.contacts; step.contact_force (nc, d) [N] in the frame (N, T1[, T2]);
        step.contact_status (nc,); step.result.u [m/s]; step.rolling_moment; step.spinning_moment;
        step.law_variables. Entries of the same or a later time are replaced.
        """
        t = float(step.state.t)
        displacement = self._model.node_displacement(step.state.x)
        velocity = self._model.node_velocity(step.state.v, step.state.x)
        datasets = {"contacts": (_contact_points(self._vtk, step, displacement), "vtp")}
        if self._blocks:
            strained = self._model.strained_displacement(step.state.x)
            datasets["blocks"] = (self._blocks.dataset(displacement, velocity, strained, step.state), "vtu")
        if self._rigid:
            datasets["rigid"] = (self._rigid.dataset(displacement, velocity), "vtp")
        if step.linked is not None:
            self._entries.setdefault("links", [])
            datasets["links"] = (_link_points(self._vtk, step, step.linked), "vtp")
        files = {name: f"{name}_{step.number:05d}.{suffix}" for name, (_, suffix) in datasets.items()}
        for name, (dataset, _) in datasets.items():
            self._vtk.write(dataset, self.directory / files[name], t)
        for name, file in files.items():
            self._entries[name] = [entry for entry in self._entries[name] if entry[0] < t and entry[1] != file] + [(t, file)]
            write_collection(self.directory / f"{name}.pvd", self._entries[name])


def _body_nodes(model: Model, numbers: list[int]) -> tuple[NDArray, NDArray]:
    """Return the global nodes of the bodies, one after the other, and where each body begins among them (nbodies + 1,)."""
    first, last = np.asarray(model.node_offset)[numbers], np.asarray(model.node_offset)[np.array(numbers) + 1]
    return np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)]), np.concatenate([[0], np.cumsum(last - first)])


class _Blocks:
    """The unstructured grid of the deformable bodies; bodies of the same part share one stress operator and one product with it."""

    def __init__(self, vtk: _VTK, model: Model, numbers: list[int]) -> None:
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

        width = np.repeat([body.part.cells.shape[1] for body in bodies], count)
        connectivity = np.concatenate([(body.part.cells + begin).ravel() for body, begin in zip(bodies, node_begin, strict=False)])
        kinds = np.repeat(np.array([CELL_TYPES[body.part.cell_type].vtk for body in bodies], dtype=np.uint8), count)
        self._grid = vtk.data.vtkUnstructuredGrid()
        self._grid.SetPoints(vtk.points(np.asarray(model.reference)[self._nodes]))
        self._grid.SetCells(vtk.support.numpy_to_vtk(kinds, deep=True), vtk.cells(np.concatenate([[0], np.cumsum(width)]), connectivity))
        self._grid.GetCellData().AddArray(vtk.array("body", np.repeat(np.array(numbers, dtype=np.int32), count)))

    def dataset(self, displacement: NDArray, velocity: NDArray, strained: NDArray, state: State) -> vtkUnstructuredGrid:
        point_data, cell_data = self._grid.GetPointData(), self._grid.GetCellData()
        point_data.AddArray(self._vtk.array("displacement", _in_space(displacement[self._nodes])))
        point_data.AddArray(self._vtk.array("velocity", _in_space(velocity[self._nodes])))
        stress = self._stress(strained)
        for name, values in self._nonlinear(stress, state).items():
            cell_data.AddArray(self._vtk.array(name, values))
        cell_data.AddArray(self._vtk.array("von_mises", stress))
        return self._grid

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


class _RigidSurfaces:
    """The polygons of the rigid bodies' surfaces; a facet that stands in two named surfaces is taken once. A 2D body whose segments are
    one closed line is the polygon within, another one its segments. Exact shapes are drawn by the mesh that they have for it: its points
    move with the body's nodes by their affine weights."""

    def __init__(self, vtk: _VTK, model: Model, numbers: list[int]) -> None:
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
            outline = _closed_line(different.values()) if model.dimension == 2 else None
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
        # VTK numbers the lines before the polygons
        self._surface.GetCellData().AddArray(vtk.array("body", np.array([number for number, _ in lines + polygons], dtype=np.int32)))

    def dataset(self, displacement: NDArray, velocity: NDArray) -> vtkPolyData:
        self._surface.GetPointData().AddArray(self._vtk.array("displacement", _in_space(self._drawn @ displacement[self._nodes])))
        self._surface.GetPointData().AddArray(self._vtk.array("velocity", _in_space(self._drawn @ velocity[self._nodes])))
        return self._surface


def _closed_line(segments: Iterable[Sequence[int]]) -> list[int] | None:
    """The nodes around the segments (start, end) where these are one closed line, else None."""
    pairs = list(segments)
    following: dict[int, int] = {start: end for start, end in pairs}
    line = [next(iter(following), -1)]
    while (node := following.pop(line[-1], -1)) not in (-1, line[0]):
        line.append(node)
    return line if node == line[0] and len(line) == len(pairs) > 0 else None


def _link_points(vtk: _VTK, step: Step, linked: Linked) -> vtkPolyData:
    """A point for each row, where the weights of its first body are: the mean of the nodes of positive weight."""
    model, rows, multiplier = step.model, linked.rows, step.result.multiplier
    assert multiplier is not None  # a step with links has one
    positive = rows.weights.multiply(rows.weights > 0).tocsr()
    total = np.asarray(positive.sum(axis=1)).ravel()
    points = vtk.data.vtkPolyData()
    points.SetPoints(vtk.points((positive @ model.positions(step.state.x)) / np.where(total > 0, total, 1.0)[:, None]))
    points.SetVerts(vtk.cells(np.arange(len(total) + 1), np.arange(len(total))))
    forces = step.force_per_reaction * multiplier[:, None] * rows.direction
    for name, values in {"force": _in_space(forces), "link": linked.linkage.of_row.astype(np.int32), "gap": rows.gap}.items():
        points.GetPointData().AddArray(vtk.array(name, values))
    return points


def _contact_points(vtk: _VTK, step: Step, displacement: NDArray) -> vtkPolyData:
    contacts, nc = step.contacts, len(step.contacts)
    force = np.asarray(step.contact_force).reshape(nc, contacts.dimension)
    sliding = np.asarray(step.result.u).reshape(nc, -1 if nc else contacts.dimension)[:, 1 : contacts.dimension]
    points = vtk.data.vtkPolyData()
    points.SetPoints(vtk.points(contacts.point))
    points.SetVerts(vtk.cells(np.arange(nc + 1), np.arange(nc)))
    for name, values in {
        "reaction": _in_space(np.einsum("ai,aij->aj", force, contacts.frame)),
        "reaction_normal": force[:, 0],
        "reaction_tangential": np.linalg.norm(force[:, 1:], axis=1),
        "gap": contacts.gap,
        "status": np.asarray(step.contact_status, dtype=np.int8),
        "sliding_velocity": np.linalg.norm(sliding, axis=1),
        "mu": contacts.mu,
        "slave": contacts.bodies[:, 0].astype(np.int32),
        "master": contacts.bodies[:, 1].astype(np.int32),
        "identity": contacts.identity.astype(np.int64),
        "normal": _in_space(contacts.frame[:, 0]),
        "displacement": _in_space(np.einsum("ak,akj->aj", contacts.on_master, displacement[contacts.nodes])),
    }.items():
        points.GetPointData().AddArray(vtk.array(name, values))
    if (moment := step.rolling_moment) is not None:
        points.GetPointData().AddArray(vtk.array("rolling_moment", np.hypot(*moment.T)))
        points.GetPointData().AddArray(vtk.array("rolling", step.rolling.astype(np.int8)))
    if (about_normal := step.spinning_moment) is not None:
        points.GetPointData().AddArray(vtk.array("spinning_moment", about_normal))
        points.GetPointData().AddArray(vtk.array("spinning", step.spinning.astype(np.int8)))
    for name, values in step.law_variables.items():
        points.GetPointData().AddArray(vtk.array(name, values if values.ndim == 1 else _in_space(values)))
    seen = step.overlap
    if seen is not None and seen.bodies is not None:
        points.GetFieldData().AddArray(vtk.array("overlap", np.array([seen.depth])))
        points.GetFieldData().AddArray(vtk.array("overlap_place", _in_space(np.array([seen.point]))))
    return points
