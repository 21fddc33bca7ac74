"""The surface of all bodies of an instant, as triangles and lines that a browser draws."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.view.scene import read

if TYPE_CHECKING:
    from pyvista import DataSet

SHARP = np.cos(np.radians(25.0))
"""Facets of one body that meet at a larger angle have a line between them."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Facets of a data set as triangles, and which of its points and cells they are.

    node      (nv,) the data set's point of each vertex
    triangle  (nt, 3) vertices; cell (nt,) the data set's cell that each is a part of
    line      (nl, 2) vertices: sharp edges, borders of open surfaces, lines of rigid bodies in the plane
    body      (nv,) number of each vertex's body in the model
    """

    node: IntArray
    triangle: IntArray
    cell: IntArray
    line: IntArray
    body: IntArray


def surface_of(path: Path) -> tuple[DataSet, Surface]:
    """Return the data set of a .vtu or .vtp file and its surface; InputError where the file cannot be read."""
    data = read(path)
    data.point_data["point number"], data.cell_data["cell number"] = np.arange(data.n_points), np.arange(data.n_cells)
    outer = data.extract_surface(nonlinear_subdivision=0, algorithm="dataset_surface") if hasattr(data, "celltypes") else data
    outer = outer.triangulate(pass_lines=True)
    triangle, line = _cells(outer.faces, 3), _cells(outer.lines, 2)
    own = np.asarray(outer.cell_data["body"])  # VTK numbers the lines before the polygons
    body = np.zeros(outer.n_points, dtype=np.int64)
    body[line] = own[: len(line), None]
    body[triangle] = own[len(line) :, None]
    node, cell = np.asarray(outer.point_data["point number"]), np.asarray(outer.cell_data["cell number"])[len(line) :]
    return data, Surface(node, triangle, cell, np.vstack([line, _sharp_edges(np.asarray(outer.points), triangle)]), body)


def _cells(flat: IntArray, size: int) -> IntArray:
    """VTK's list (size, points ...) of cells of one size as rows (n, size)."""
    return np.asarray(flat, dtype=np.int64).reshape(-1, size + 1)[:, 1:]


def _sharp_edges(points: FloatArray, triangle: IntArray) -> IntArray:
    """Edges (n, 2) at which the surface turns by more than 25 degrees, or which one triangle alone, or more than two, have."""
    a, b, c = points[triangle].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    pair = np.sort(triangle[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    edge, which, count = np.unique(pair, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(which.ravel(), kind="stable") // 3  # triangles, those of an edge beside each other
    begin = np.cumsum(count) - count
    first, second = order[begin], order[begin + count - 1]
    smooth = (count == 2) & (np.einsum("ed,ed->e", normal[first], normal[second]) > SHARP)
    return edge[~smooth]
