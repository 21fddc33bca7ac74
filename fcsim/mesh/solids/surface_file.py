"""Closed surfaces from files: STL, OBJ (an object or closed group a solid), PLY, OFF, 3MF, GLB; by trimesh in a process of its own."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from fcsim.apart import limited, read_apart
from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.brief import shown
from fcsim.errors import InputError, MissingDependency
from fcsim.mesh.solids.closed_surface import ClosedSurface, closed_surface
from fcsim.mesh.solids.self_intersection import crossing_triangles

if TYPE_CHECKING:
    from trimesh import Scene
    from trimesh.parent import Geometry

FORMATS = (".stl", ".obj", ".ply", ".off", ".3mf", ".glb")
_SAME_ANGLE = 1e-6
LARGEST = 100.0
"""[m] Solids that are larger are taken for ones in millimetres."""


def read_surfaces(path: str | Path, *, scale: float | None = None) -> tuple[ClosedSurface, ...]:
    """Return the solids of a file as closed surfaces, in metres: the file's lengths times `scale` (default 1).

    Objects are solids of their names, and so is each connected piece of an object (name.1, name.2, ...). Repaired: corners of one place,
    triangles without area or given twice, faces that look inwards. Refused, by name and reason: surfaces that are open, that have edges
    of more than two faces, that cross themselves, pieces within others (cavities); without `scale`, solids of more than 100 m.
    """
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a surface file ({', '.join(FORMATS)}), got {path.suffix!r}")
    if not path.is_file():
        raise InputError(f"{path}: expected a surface file, found none")
    if scale is not None and not (is_number(scale) and scale > 0):
        raise InputError(f"{path}, scale: expected a factor > 0, got {shown(scale)}")
    meshes = read_apart(path, "fcsim.mesh.solids.surface_file", (), _loaded)
    solids = [piece for name, points, triangles in meshes for piece in _pieces(name, points * (scale or 1.0), triangles)]
    if not solids:
        raise InputError(f"{path}: expected triangles, got none")
    size = max(float(np.ptp(points[np.unique(triangles)], axis=0).max()) for _, points, triangles in solids)
    if scale is None and size > LARGEST:
        raise InputError(f"{path}: expected solids in m, got one of {size:.4g} m; scale=1e-3 if it is in mm, scale=1 if it is so large")
    surfaces = tuple(_solid(path, *solid) for solid in solids)
    _refuse_cavities(path, surfaces)
    return surfaces


def _pieces(name: str, points: FloatArray, triangles: IntArray) -> list[tuple[str, FloatArray, IntArray]]:
    """The solids of an object: pieces connected by edges, corners of one place (to 1e-9 of its size) being one.

    Where more than two triangles meet at an edge, as of blocks on each other, those that have stone between them belong together.
    """
    if not len(triangles):
        return []
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    _, first, place = np.unique(np.round((points - points.min(axis=0)) / (1e-9 * size)), axis=0, return_index=True, return_inverse=True)
    triangles = first[place.ravel()][triangles]
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    least = np.argmin(triangles, axis=1)
    turned = np.take_along_axis(triangles, (least[:, None] + np.arange(3)) % 3, axis=1)
    triangles = turned[np.sort(np.unique(turned, axis=0, return_index=True)[1])]
    if not len(triangles):
        return []
    links = _links(points, triangles)
    graph = sp.coo_array((np.ones(len(links)), links.T), shape=(len(triangles),) * 2)
    count, number = connected_components(graph, directed=False)
    if count == 1:
        return [(name, points, triangles)]
    return [(f"{name}.{k + 1}", points, triangles[number == k]) for k in range(count)]


def _links(points: FloatArray, triangles: IntArray) -> IntArray:
    """Pairs (k, 2) of triangles of one solid that meet at an edge."""
    m = len(triangles)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    owner = np.tile(np.arange(m), 3)
    _, edge, uses = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(edge.ravel(), kind="stable")
    starts = np.concatenate([[0], np.cumsum(uses)])
    twos = starts[:-1][uses == 2]
    links = [np.stack([owner[order[twos]], owner[order[twos + 1]]], axis=1)]
    for k in np.flatnonzero(uses > 2):
        halves = order[starts[k] : starts[k + 1]]
        links.append(_matched(points, triangles, edges[halves], owner[halves]))
    return np.concatenate(links)


def _matched(points: FloatArray, triangles: IntArray, halves: IntArray, owner: IntArray) -> IntArray:
    """Of the triangles around one edge, pairs between which stone lies.

    One that runs along the edge forward has its stone clockwise, seen against the edge: up to the next that runs backward.
    """
    a, b = halves.min(axis=1)[0], halves.max(axis=1)[0]
    axis = (points[b] - points[a]) / np.linalg.norm(points[b] - points[a])
    arm = points[triangles[owner].sum(axis=1) - a - b] - points[a]
    arm -= np.outer(arm @ axis, axis)
    side = arm[0] / np.linalg.norm(arm[0])
    angle = np.arctan2(arm @ np.cross(axis, side), arm @ side)
    forward = halves[:, 0] == a
    pairs = []
    for k in np.flatnonzero(forward):
        clockwise = np.where(forward, np.inf, (angle[k] - angle) % (2 * np.pi))
        clockwise[clockwise < _SAME_ANGLE] += 2 * np.pi  # the face of another that lies on this one
        if np.isfinite(clockwise).any():
            pairs.append((owner[k], owner[int(np.argmin(clockwise))]))
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _solid(path: Path, name: str, points: FloatArray, triangles: IntArray) -> ClosedSurface:
    try:
        surface = closed_surface(name, points, triangles)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    crossing = crossing_triangles(surface.points, surface.triangles)
    if len(crossing):
        middle = surface.points[surface.triangles[crossing[0, 0]]].mean(axis=0)
        raise InputError(
            f"{path}: surface of {name!r}: expected faces that do not cross each other, got {len(crossing)} pairs that do, one at "
            f"({middle[0]:.4g}, {middle[1]:.4g}, {middle[2]:.4g})"
        )
    return surface


def _refuse_cavities(path: Path, surfaces: tuple[ClosedSurface, ...]) -> None:
    """Refuse solids that are inside others: what of the two is stone cannot be known."""
    boxes = [(surface.points.min(axis=0), surface.points.max(axis=0)) for surface in surfaces]
    for inner, (low, high) in zip(surfaces, boxes, strict=True):
        for outer, (least, most) in zip(surfaces, boxes, strict=True):
            if inner is not outer and (low > least).all() and (high < most).all() and _winds(outer, inner.points[0]):
                raise InputError(f"{path}: expected solids beside each other, got {inner.name!r} inside {outer.name!r}: a cavity?")


def _winds(surface: ClosedSurface, point: FloatArray) -> bool:
    """Whether the surface goes around the point: the sum of the solid angles of its triangles is 4 pi, not 0 (van Oosterom 1983)."""
    a, b, c = (surface.points[surface.triangles[:, k]] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    dot = np.einsum
    triple = dot("kd,kd->k", a, np.cross(b, c))
    below = la * lb * lc + dot("kd,kd->k", a, b) * lc + dot("kd,kd->k", b, c) * la + dot("kd,kd->k", c, a) * lb
    return float(2 * np.arctan2(triple, below).sum()) > 2 * np.pi


def _loaded(out: Path) -> list[tuple[str, FloatArray, IntArray]]:
    with np.load(out, allow_pickle=False) as arrays:
        names = json.loads(str(arrays["names"]))
        return [(name, arrays[f"points {k}"], arrays[f"triangles {k}"]) for k, name in enumerate(names)]


def main(path: str, out: str) -> int:
    """Read a surface file within the limits and write its arrays."""

    def read() -> None:
        meshes = _read(Path(path))
        arrays: dict[str, FloatArray | IntArray] = {f"points {k}": points for k, (_, points, _) in enumerate(meshes)}
        arrays |= {f"triangles {k}": triangles for k, (_, _, triangles) in enumerate(meshes)}
        np.savez(out, allow_pickle=False, names=np.array(json.dumps([name for name, _, _ in meshes])), **arrays)

    return limited(path, read)


@dataclass(frozen=True)
class _NothingBeside:
    """What trimesh asks for files that a file names, materials and buffers: it gets none."""

    file_name: str

    def __getitem__(self, name: str) -> bytes:
        raise KeyError(f"the file names another, {name!r}, which is not read")

    get = __getitem__


def _read(path: Path) -> list[tuple[str, FloatArray, IntArray]]:
    try:
        import trimesh
    except ImportError as error:
        raise MissingDependency(f"trimesh is needed for surface files ({error}): pip install 'fcsim[masonry]'") from None
    obj = path.suffix.lower() == ".obj"
    options = {"file_type": "obj", "split_objects": True, "group_material": False} if obj else {}
    try:
        source = StringIO(_objects(_counted_from_the_first(path.read_text(encoding="utf-8", errors="replace")))) if obj else str(path)
        scene = trimesh.load_scene(source, process=False, resolver=_NothingBeside(path.name), **options)
        meshes = [(name, mesh) for name, mesh in _named(scene) if isinstance(mesh, trimesh.Trimesh)]
        found = [(name, np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)) for name, mesh in meshes]
    except MemoryError:
        raise
    except Exception as error:  # readers of many formats: what they raise on a broken file is anything
        raise InputError(f"{path}: expected a surface that trimesh can read, got: {type(error).__name__}: {error}") from None
    for name, points, triangles in found:
        shaped = points.ndim == triangles.ndim == 2 and points.shape[1] == triangles.shape[1] == 3
        if not shaped or not np.isfinite(points).all() or (len(triangles) and (triangles.min() < 0 or triangles.max() >= len(points))):
            raise InputError(f"{path}, object {name!r}: expected finite corners (x, y, z) and triangles of their numbers")
    return found


def _counted_from_the_first(text: str) -> str:
    """An OBJ file whose faces name no corner by a negative number, -1 being the last before the face: of several objects trimesh counts
    these from the end of the file."""
    corners, lines = 0, text.splitlines()
    for k, line in enumerate(lines):
        word, *rest = line.split() or [""]
        if word == "v":
            corners += 1
        elif word == "f" and any(corner.startswith("-") for corner in rest):
            numbers = [int(corner.split("/")[0]) for corner in rest]
            lines[k] = " ".join(["f", *(str(number + corners + 1 if number < 0 else number) for number in numbers)])
    return "\n".join(lines) + "\n"


def _objects(text: str) -> str:
    """An OBJ file without objects (o) whose groups (g) are closed, each by itself, with objects in their place; any other one as it is:
    groups may also be sides of one solid."""
    groups: dict[str, list[str]] = {}
    name, rest = "", list[str]()
    for line in text.splitlines():
        word, _, named = line.strip().partition(" ")
        if word == "o":
            return text
        if word == "g":
            name = named.strip()
        elif word == "f":
            groups.setdefault(name, []).append(line)
        else:
            rest.append(line)
    places = [tuple(line.split()[1:4]) for line in rest if line.split()[:1] == ["v"]]
    if not all(name and _closed(faces, places) for name, faces in groups.items()):
        return text
    return "\n".join(rest + [line for name, faces in groups.items() for line in (f"o {name}", *faces)]) + "\n"


def _closed(faces: Sequence[str], places: Sequence[tuple[str, ...]]) -> bool:
    """Whether each edge of the faces, f lines of an OBJ file with corners at these places, is one of another face of them."""
    uses: Counter[frozenset[tuple[str, ...]]] = Counter()
    for face in faces:
        corners = [places[int(corner.split("/")[0]) - 1] for corner in face.split()[1:]]
        uses.update(frozenset(edge) for edge in zip(corners, corners[1:] + corners[:1], strict=True) if edge[0] != edge[1])
    return all(count % 2 == 0 for count in uses.values())


def _named(scene: Scene) -> list[tuple[str, Geometry]]:
    """The meshes of a scene where they stand in it, with the names of their nodes."""
    named = []
    for node in scene.graph.nodes_geometry:
        transform, geometry = scene.graph[node]
        mesh = scene.geometry[geometry].copy()
        mesh.apply_transform(transform)
        named.append((str(node), mesh))
    return sorted(named, key=lambda pair: pair[0])
