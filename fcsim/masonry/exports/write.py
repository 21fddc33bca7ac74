"""Blocks as a file of the kind that its name says."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fcsim.errors import InputError, MissingDependency
from fcsim.files import replacing_for_good
from fcsim.masonry.exports.drawing import write_drawing
from fcsim.masonry.json_file import write_masonry
from fcsim.masonry.problem import Block, MasonryProblem
from fcsim.records import write_record

SURFACES = (".obj", ".stl", ".ply", ".off", ".glb", ".3mf")
COMPAS = ".compas.json"
FORMATS = (*SURFACES, ".dxf", COMPAS, ".json")


def refuse_format(path: Path) -> None:
    """InputError for a name that is of none of the formats, before anything is computed."""
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a file of blocks ({', '.join(FORMATS)}), got {path.suffix!r}")


def write_blocks(path: str | Path, problem: MasonryProblem) -> Path:
    """Write the blocks of a problem: surfaces (.obj: one object a block), a drawing (.dxf), COMPAS meshes (.compas.json), or the whole
    problem (.json, "masonry-problem/1"). InputError for other names; MissingDependency where a library is absent."""
    path = Path(path)
    refuse_format(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.name.lower().endswith(COMPAS):
        write_record(path, [_mesh(block) for block in problem.blocks])
    elif path.suffix.lower() == ".json":
        write_masonry(path, problem)
    elif path.suffix.lower() == ".dxf":
        write_drawing(path, problem)
    else:
        _write_surfaces(path, problem)
    return path


def _write_surfaces(path: Path, problem: MasonryProblem) -> None:
    try:
        import trimesh
    except ImportError as error:
        raise MissingDependency(f"trimesh is needed for {path.suffix} ({error}): pip install 'fcsim[masonry]'") from None
    scene = trimesh.Scene()
    for block in problem.blocks:
        mesh = trimesh.Trimesh(block.surface.points, block.surface.triangles, process=False)
        scene.add_geometry(mesh, node_name=block.name, geom_name=block.name)
    kind = path.suffix.lower().removeprefix(".")
    content = scene.to_mesh().export(file_type=kind) if kind in ("stl", "ply", "off") else scene.export(file_type=kind)
    with replacing_for_good(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def _mesh(block: Block) -> dict[str, object]:
    """A block as COMPAS 2 writes a mesh."""
    vertices = {str(k): dict(zip("xyz", point, strict=True)) for k, point in enumerate(block.surface.points.tolist())}
    faces = {str(k): list(face) for k, face in enumerate(_outwards(block))}
    return {
        "dtype": "compas.datastructures/Mesh",
        "data": {
            "attributes": {},
            "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
            "default_edge_attributes": {},
            "default_face_attributes": {},
            "vertex": vertices,
            "face": faces,
            "facedata": {},
            "edgedata": {},
            "max_vertex": len(vertices) - 1,
            "max_face": len(faces) - 1,
        },
        "name": block.name,
    }


def _outwards(block: Block) -> list[tuple[int, ...]]:
    """The polygons of a block, counter-clockwise seen from outside, as their triangles are."""
    points, triangles = block.surface.points, block.surface.triangles
    normals = np.cross(points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]])
    corners = [frozenset(triangle) for triangle in triangles.tolist()]
    faces = []
    for face in block.surface.polygons:
        p = points[list(face)]
        area = np.cross(p - p.mean(axis=0), np.roll(p, -1, axis=0) - p.mean(axis=0)).sum(axis=0)
        of = [k for k, triangle in enumerate(corners) if triangle <= set(face)]
        turned = bool(of) and float(area @ normals[of].sum(axis=0)) < 0
        faces.append(face[::-1] if turned else face)
    return faces
