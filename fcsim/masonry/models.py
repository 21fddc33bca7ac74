"""Any file of blocks as a masonry problem: JSON of our own, COMPAS JSON, surfaces, meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypedDict

from fcsim.arrays import is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.masonry.compas_json import is_compas, read_compas
from fcsim.masonry.json_file import SCHEMA, json_content, masonry_of_json
from fcsim.masonry.meshes import FORMATS as MESHES
from fcsim.masonry.meshes import masonry_of_mesh
from fcsim.masonry.problem import DENSITY, MasonryProblem
from fcsim.masonry.surfaces import masonry_of_surfaces, supported
from fcsim.mesh.solids.surface_file import FORMATS as SURFACES

MODELS = (".json", *SURFACES, *MESHES)
"""The files that hold blocks."""


class ModelOptions(TypedDict, total=False):
    """What `read_model` is told besides the file and mu."""

    density: float | None
    scale: float | None
    supports: Sequence[str]
    array: str | None


def read_model(
    path: str | Path,
    *,
    mu: float | None = None,
    density: float | None = None,
    scale: float | None = None,
    supports: Sequence[str] = (),
    array: str | None = None,
) -> MasonryProblem:
    """Return the problem of a file: "masonry-problem/1", COMPAS JSON (see `read_compas`), solids (see `masonry_of_surfaces`), or a mesh
    (see `masonry_of_mesh`).

    mu        friction of all joints, in place of the file's (0.6 where it has none)
    density   [kg/m^3] of blocks that have none in the file (None: 2000); refused where all have theirs
    scale     metres to the file's unit of length
    supports  names or patterns of blocks that are held besides; where none is, a floor is laid
    array     of a mesh's cells, see `masonry_of_mesh`

    InputError for another kind of file, and for options that do not go with its kind.
    """
    path = Path(path)
    if path.suffix.lower() not in MODELS:
        got = "a folder" if path.is_dir() else repr(path.suffix) if path.suffix else "a name without an ending"
        raise InputError(f"{path}: expected a model of blocks ({', '.join(MODELS)}), got {got}")
    if density is not None and not (is_number(density) and density > 0):
        raise InputError(f"{path}, density: expected a number > 0 in kg/m^3, got {shown(density)}")
    usual = DENSITY if density is None else density
    if path.suffix.lower() in MESHES:
        given = 0.6 if mu is None else mu
        return masonry_of_mesh(path, mu=given, density=usual, scale=scale, supports=supports, array=array)
    if array is not None:
        raise InputError(f"{path}, array: expected it with a mesh ({', '.join(MESHES)}), got {path.suffix!r}")
    if path.suffix.lower() != ".json":
        return masonry_of_surfaces(path, mu=0.6 if mu is None else mu, density=usual, scale=scale, supports=supports)
    content = json_content(path)
    if (isinstance(content, Mapping) and content.get("schema") == SCHEMA) or not is_compas(content):
        if scale is not None or supports:
            raise InputError(f"{path}: expected --scale and --support with surfaces and COMPAS files; this one says them itself")
        if density is not None:
            raise InputError(f"{path}, density: expected it with blocks whose file has none; this one says density or mass of every block")
        problem = masonry_of_json(content, path)
        return problem if mu is None else replace(problem, mu=mu, between={})
    problem = read_compas(content, str(path), mu, density, scale)
    blocks = supported(problem.blocks, supports, path)
    return replace(problem, name=path.stem, title=problem.title or path.stem, blocks=blocks)
