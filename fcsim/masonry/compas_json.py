"""COMPAS JSON as masonry problems: lists of meshes, boxes and polyhedra, assemblies (compas_assembly), models and analyses (compas_dem).

A file of `compas.json_dump` is a tree of records {"dtype": "package/Class", "data": {...}}. They are read as data: nothing that a file
names is imported, and COMPAS need not be installed. Blocks are named by their numbers in the model's graph, as COMPAS asks for them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.masonry.problem import DENSITY, GRAVITY, Acceleration, Block, MasonryProblem, PointForce
from fcsim.mesh.solids.closed_surface import FLAT, closed_surface
from fcsim.mesh.solids.surface_file import LARGEST

Faces = Mapping[int, Sequence[int]]
"""Lists of point numbers, by the keys that COMPAS knows them by."""
Record = Mapping[str, Any]  # what classes of others write: checked where each part of it is used
_BOX = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_SAME = 1e-7
"""Of a face's size: nearer corners are one when the first of a bent face is looked for, which its neighbour must find too."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A block as COMPAS says it: points (n, 3) [m], faces, whether it is a support, its density [kg/m^3], None = not said."""

    name: str
    points: FloatArray
    faces: Faces
    support: bool = False
    density: float | None = None

    def block(self, density: float) -> Block:
        """The block, of the given density where none is said; faces that are bent are cut as `plane_faces` says."""
        surface = closed_surface(self.name, self.points, plane_faces(self.points, list(self.faces.values())))
        return Block(surface, self.density or density, support=self.support)


def is_compas(content: object) -> bool:
    """Whether the content of a JSON file has records of COMPAS."""
    return next(_records(content), None) is not None


def read_compas(content: object, where: str, mu: float | None, density: float | None, scale: float | None = None) -> MasonryProblem:
    """Return the problem that a COMPAS file poses; mu in place of its own, density [kg/m^3] where it has none (None:
    2000), scale: metres to its unit.

    Of an analysis, its first problem: friction; loads that ramp grow with the multiplier, instantaneous ones stay, as gravity does.
    InputError for cohesion and prescribed displacements, which limit analysis and trials do not know, and for what a record lacks.
    """
    records = list(_records(content))
    if not records:
        raise InputError(f"{where}: expected records of COMPAS (dtype, data), got none")
    analysis = next((record for record in records if _is(record, "Analysis")), None)
    posed: list[object] = []
    if analysis is not None:
        data = data_of(analysis, where)
        posed = list(data.get("problems") or [])
        model = data.get("model")
        if not isinstance(model, Mapping):
            raise InputError(f"{where}: expected an analysis with a model, got none")
        records = [model]
    solids = [solid for number, record in enumerate(records) for solid in _solids(record, number, where)]
    if not solids:
        raise InputError(f"{where}: expected blocks (Mesh, Box, Polyhedron, Assembly or BlockModel), got none")
    if density is not None and all(solid.density for solid in solids if not solid.support):
        raise InputError(f"{where}, density: expected it with blocks whose file has none; this one says it of every block that is free")
    solids = [replace(solid, points=_scaled(solid, scale, where)) for solid in solids]
    title, loads, gravity = "", list[Acceleration | PointForce](), GRAVITY
    if posed:
        problem = data_of(posed[0], f"{where}, problem")
        title = f"{problem.get('name') or 'problem'}" + (f", the first of {len(posed)} problems" if len(posed) > 1 else "")
        mu = friction_of(problem, where) if mu is None else mu
        gravity, loads = _loads(problem, solids, scale, where)
    blocks = tuple(solid.block(density or DENSITY) for solid in solids)
    every = (Acceleration((0.0, 0.0, -gravity)), *loads)
    return MasonryProblem("COMPAS", 3, blocks, 0.6 if mu is None else mu, loads=every, title=title)


def _loads(problem: Record, solids: Sequence[Solid], scale: float | None, where: str) -> tuple[float, list[Acceleration | PointForce]]:
    """Gravity [m/s^2] and the loads of a problem; InputError for prescribed displacements, and for loads in other units than SI."""
    if any(data_of(group, where).get("displacements") for group in problem.get("boundary_conditions") or []):
        raise InputError(f"{where}, boundary conditions: expected loads alone, got prescribed displacements: see `fcsim.compas.solve`")
    gravity, loads = loads_of(problem, {solid.name: solid for solid in solids}, where)
    if loads and scale not in (None, 1.0):
        raise InputError(f"{where}, scale: expected a problem with loads to be in SI units, got scale {scale}")
    return gravity, loads


def _scaled(solid: Solid, scale: float | None, where: str) -> FloatArray:
    """The points in m; InputError for what must be in mm."""
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise InputError(f"{where}, scale: expected a factor > 0, got {scale}")
    size = float(np.ptp(solid.points, axis=0).max(initial=0.0))
    if scale is None and size > LARGEST:
        raise InputError(f"{where}: expected blocks in m, got one of {size:.4g} m; scale=1e-3 if it is in mm, scale=1 if it is so large")
    return solid.points * (scale or 1.0)


def plane_faces(points: FloatArray, faces: Sequence[Sequence[int]]) -> list[list[int]]:
    """Faces (lists of point numbers), those whose corners do not lie in a plane cut into triangles from their first corner by coordinates:
    of two blocks that share such a face both are cut alike."""
    found: list[list[int]] = []
    for face in faces:
        corners = points[list(face)]
        p = corners - corners.mean(axis=0)
        size = float(np.abs(p).max(initial=0.0))
        normal = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)
        length = float(np.linalg.norm(normal))
        if len(face) <= 3 or not size or not length or np.abs(p @ normal).max() <= 0.5 * FLAT * size * length:
            found.append(list(face))
            continue
        first = int(np.lexsort(np.round(corners / (_SAME * size)).T[::-1])[0])
        ring = [*face[first:], *face[:first]]
        found += [[ring[0], ring[k], ring[k + 1]] for k in range(1, len(ring) - 1)]
    return found


def _records(content: object) -> Iterator[Record]:
    """The records of a file, one or several in lists and mappings."""
    if isinstance(content, Mapping):
        if isinstance(content.get("dtype"), str):
            yield content
        else:
            for value in content.values():
                yield from _records(value)
    elif isinstance(content, list):
        for value in content:
            yield from _records(value)


def _is(record: Record, *names: str) -> bool:
    """Whether a record is of one of the classes, or of one that inherits from it."""
    kinds = [record["dtype"], *(record.get("inheritance") or [])]
    return any(str(kind).rsplit("/", 1)[-1] in names for kind in kinds)


def data_of(record: object, where: str) -> Record:
    """What a record holds; COMPAS 1 wrote "value"."""
    data = (record.get("data", record.get("value")) if "dtype" in record else record) if isinstance(record, Mapping) else None
    if not isinstance(data, Mapping):
        raise InputError(f"{where}: expected a record of COMPAS (dtype, data), got {type(record).__name__}")
    return data


def _solids(record: Record, number: int, where: str) -> list[Solid]:
    data = data_of(record, f"{where}, {record.get('dtype')}")
    if _is(record, "BlockModel", "Model"):
        return _of_model(data, where)
    if _is(record, "Assembly"):
        nodes = data_of(data.get("graph"), f"{where}, graph").get("node") or {}
        default = (data_of(data.get("graph"), where).get("default_node_attributes") or {}).get("is_support", False)
        blocks = {name: entry for name, entry in nodes.items() if entry.get("block") is not None}
        return [
            Solid(name, *_shape(entry["block"], f"{where}, block {name}"), bool(entry.get("is_support", default)))
            for name, entry in blocks.items()
        ]
    if _is(record, "Mesh", "Polyhedron", "Box"):
        return [Solid(str(number), *_shape(record, f"{where}, block {number}"))]
    return []


def _of_model(data: Record, where: str) -> list[Solid]:
    elements, materials = data.get("elements") or {}, data.get("materials") or {}
    nodes = (data.get("graph") or {}).get("node") or {}
    names = {entry.get("element"): name for name, entry in nodes.items()}
    placed: dict[str, FloatArray] = {}

    def place(node: Record, above: FloatArray) -> None:
        for child in node.get("children") or []:
            guid = child["element"]
            placed[guid] = above @ _transformation(data_of(elements.get(guid), f"{where}, element {guid}").get("transformation"), where)
            place(child, placed[guid])

    place((data.get("tree") or {}).get("root") or {}, _transformation(data.get("transformation"), where))
    solids = []
    for guid, record in elements.items():
        element = data_of(record, f"{where}, element {guid}")
        if element.get("geometry") is None:
            continue  # a group
        name = str(names.get(guid, guid))
        if element.get("features") and not _is(record, "Block"):
            raise InputError(f"{where}, block {name}: expected geometry without features, got {len(element['features'])}: apply them")
        points, faces = _shape(element["geometry"], f"{where}, block {name}")
        moved = placed.get(guid, np.eye(4))
        points = points @ moved[:3, :3].T + moved[:3, 3]
        material = materials.get(element.get("material"))
        density = None if material is None else data_of(material, where).get("density")
        solids.append(Solid(name, points, faces, bool(element.get("is_support", False)), density))
    return solids


def _transformation(record: object, where: str) -> FloatArray:
    if record is None:
        return np.eye(4)
    matrix = np.asarray(data_of(record, f"{where}, transformation").get("matrix"), dtype=np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise InputError(f"{where}, transformation: expected a matrix (4, 4) of finite numbers, got shape {matrix.shape}")
    return matrix


def _shape(record: object, where: str) -> tuple[FloatArray, Faces]:
    """Points (n, 3) and faces of a Mesh, a Polyhedron or a Box."""
    data = data_of(record, where)
    try:
        if "vertex" in data:
            default = data.get("default_vertex_attributes") or data.get("dva") or {}
            number = {str(key): k for k, key in enumerate(data["vertex"])}
            points = [[float(vertex.get(c, default.get(c, 0.0))) for c in "xyz"] for vertex in data["vertex"].values()]
            faces = {int(name): [number[str(key)] for key in face] for name, face in data["face"].items()}
        elif "vertices" in data:
            points, faces = data["vertices"], dict(enumerate(data["faces"]))
        else:
            half = 0.5 * np.array([data["xsize"], data["ysize"], data["zsize"]])
            given = data.get("frame") or {"point": [0, 0, 0], "xaxis": [1, 0, 0], "yaxis": [0, 1, 0]}
            frame = data_of({"dtype": "Frame", "data": given.get("data") or given}, where)
            x, y = (np.asarray(frame[axis], dtype=float) for axis in ("xaxis", "yaxis"))
            corners = half * np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
            points = (np.asarray(frame["point"], dtype=float) + corners @ np.stack([x, y, np.cross(x, y)])).tolist()
            faces = {key: list(face) for key, face in enumerate(_BOX)}
        return np.array(points, dtype=np.float64).reshape(-1, 3), faces
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        said = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{where}: expected a Mesh (vertex, face), a Polyhedron (vertices, faces) or a Box, got {said}") from None


def friction_of(problem: Record, where: str) -> float | None:
    """mu of the problem's contact model, by mu or by the angle phi [degrees]; None where it has none, InputError where it has cohesion."""
    properties = problem.get("contact_properties")
    law = None if properties is None else data_of(properties, where).get("contact_model")
    if law is None:
        return None
    data = data_of(law, where)
    refuse_cohesion(data.get("c"), data.get("t_c"), where)
    mu = data.get("mu")
    return float(mu) if mu is not None else math.tan(math.radians(float(data["phi"])))


def refuse_cohesion(cohesion: float | None, tension: float | None, where: str) -> None:
    """InputError where a Mohr-Coulomb law has more than friction."""
    if cohesion or tension:
        raise InputError(
            f"{where}, contact model: expected friction alone, without cohesion and tension, got c = {cohesion}, t_c = {tension}"
        )


def loads_of(problem: Record, solids: Mapping[str, Solid], where: str) -> tuple[float, list[Acceleration | PointForce]]:
    """Gravity [m/s^2] and the loads of a problem's groups."""
    what = f"{where}, boundary conditions"
    groups = [data_of(group, what) for group in problem.get("boundary_conditions") or []]
    loads: list[Acceleration | PointForce] = []
    for group in groups:
        for record in group.get("body_forces") or []:
            data = data_of(record, what)
            loads.append(Acceleration(_three(data["acceleration"]), _grows(data)))
        for record in group.get("point_loads") or []:
            data = data_of(record, what)
            point = None if data.get("point") is None else _three(data["point"])
            moment = (0.0, 0.0, 0.0) if data.get("moment") is None else _three(data["moment"])
            force = _three(data.get("force") or (0.0, 0.0, 0.0))
            loads.append(PointForce(str(data["block_index"]), force, point, _grows(data), moment))
        for record in group.get("surface_loads") or []:
            data = data_of(record, what)
            name = str(data["block_index"])
            if name not in solids or int(data["face_index"]) not in solids[name].faces:
                raise InputError(f"{what}: expected a face of a block, got face {data['face_index']} of block {name!r}")
            solid = solids[name]
            area, centre = face_area(solid.points[list(solid.faces[int(data["face_index"])])])
            loads.append(PointForce(name, _three(area * np.asarray(data["load"], dtype=float)), _three(centre), _grows(data)))
    return one_gravity([float(group.get("g", GRAVITY)) for group in groups], what), loads


def one_gravity(given: Sequence[float], where: str) -> float:
    """The gravity [m/s^2] that groups of boundary conditions agree on."""
    if len(set(given)) > 1:
        raise InputError(f"{where}: expected one gravity, got {', '.join(f'{g:g}' for g in sorted(set(given)))} m/s^2")
    return given[0] if given else GRAVITY


def face_area(corners: FloatArray) -> tuple[float, FloatArray]:
    """Area [m^2] and centroid (3,) [m] of a polygon (n, 3)."""
    a, b, c = corners[:1], corners[1:-1], corners[2:]
    cross = 0.5 * np.cross(b - a, c - a)
    total = cross.sum(axis=0)
    area = float(np.linalg.norm(total))
    share = cross @ total / area**2 if area else np.full(len(b), 1 / len(b))
    return area, share @ (a + b + c) / 3


def _grows(data: Record) -> bool:
    return data.get("loading_type", "ramp") == "ramp"


def _three(values: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
