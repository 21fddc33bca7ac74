"""Masonry problems as JSON, schema "masonry-problem/1": SI units, z up.

dimension 2 (plane x, z; blocks are prisms along y) or 3
blocks    [{id, vertices [[x, y, z], ...], faces [[vertex numbers], ...] (left out: a hexahedron in VTK's order), density or mass, support}]
contact   {mu, mu_between [{between [id, id], mu}]}
loads     [{kind "acceleration", value} | {kind "force", block, value, point}, each with scaled_by_multiplier]
support_motion [{block, velocity}]; expected [{quantity, value, kind, bound, tolerance}]; name, title, question, source

Other keys are left aside, but for `initial_pose` and `base_acceleration`, which would change the problem and are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal, cast

from fcsim.errors import InputError
from fcsim.files import note_read
from fcsim.masonry.problem import Acceleration, Block, Expected, MasonryProblem, PointForce
from fcsim.mesh.solids.closed_surface import closed_surface
from fcsim.records import from_json, read_json, write_record

SCHEMA = "masonry-problem/1"
HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
"""The faces of VTK's hexahedron."""
_NOT_READ = ("initial_pose", "base_acceleration")


def read_masonry(path: str | Path) -> MasonryProblem:
    """Read a masonry problem; InputError names the file, the block and the key."""
    path = Path(path)
    try:
        data = read_json(path)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    note_read(path)
    where = str(path)
    if not isinstance(data, Mapping) or data.get("schema") != SCHEMA:
        found = data.get("schema", "no schema") if isinstance(data, Mapping) else type(data).__name__
        raise InputError(f'{where}: expected a masonry problem, schema "{SCHEMA}", got {found!r}')
    refused = [key for key in _NOT_READ if data.get(key) is not None]
    if refused:
        raise InputError(f"{where}: {', '.join(refused)}: not read yet; expected blocks as their vertices say, on ground at rest")
    blocks = _entries(data, "blocks", where)
    if not blocks:
        raise InputError(f"{where}, blocks: expected at least one, got none")
    contact = _mapping(data.get("contact"), f"{where}, contact")
    between = {}
    for given in _entries(contact, "mu_between", f"{where}, contact"):
        entry = _mapping(given, f"{where}, mu_between")
        pair = _get(tuple[str, ...], entry, "between", f"{where}, mu_between")
        if len(pair) != 2:
            raise InputError(f"{where}, mu_between: expected the names of two blocks, got {pair}")
        between[pair[0], pair[1]] = _get(float, entry, "mu", f"{where}, mu_between {pair}")
    return MasonryProblem(
        name=_optional(str, data, "name", where, path.stem),
        dimension=cast(Literal[2, 3], _get(int, data, "dimension", where)),
        blocks=tuple(_block(entry, where) for entry in blocks),
        mu=_get(float, contact, "mu", f"{where}, contact"),
        loads=tuple(_load(entry, where) for entry in _entries(data, "loads", where)),
        between=between,
        motion=dict(_motion(entry, f"{where}, support_motion") for entry in _entries(data, "support_motion", where)),
        title=_optional(str, data, "title", where, ""),
        question=_optional(str, data, "question", where, ""),
        expected=tuple(_expected(entry, f"{where}, expected") for entry in _entries(data, "expected", where)),
        source=_source(data.get("source", []), where),
    )


def write_masonry(path: str | Path, problem: MasonryProblem) -> None:
    """Write a masonry problem; `read_masonry` reads it again."""
    contact: dict[str, object] = {"mu": problem.mu}
    if problem.between:
        contact["mu_between"] = [{"between": pair, "mu": mu} for pair, mu in problem.between.items()]
    data: dict[str, object] = {
        "schema": SCHEMA,
        "name": problem.name,
        "title": problem.title,
        "dimension": problem.dimension,
        "contact": contact,
        "loads": [_load_entry(load) for load in problem.loads],
        "question": problem.question,
        "expected": [entry for entry in problem.expected],
        "source": problem.source,
        "blocks": [_block_entry(block) for block in problem.blocks],
    }
    if problem.motion:
        data["support_motion"] = [{"block": name, "velocity": velocity} for name, velocity in problem.motion.items()]
    write_record(Path(path), data)


def _block(given: object, where: str) -> Block:
    entry = _mapping(given, f"{where}, blocks")
    name = _name(entry, "id", f"{where}, blocks")
    what = f"{where}, block {name!r}"
    vertices = _get(tuple[tuple[float, ...], ...], entry, "vertices", what)
    if any(len(vertex) != 3 for vertex in vertices):
        raise InputError(f"{what}, vertices: expected three coordinates each")
    faces = _optional(tuple[tuple[int, ...], ...], entry, "faces", what, None)
    if faces is None:
        if len(vertices) != 8:
            raise InputError(f"{what}: expected faces, or the 8 vertices of a hexahedron, got {len(vertices)} vertices")
        faces = HEXAHEDRON
    try:
        surface = closed_surface(name, vertices, faces)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    support = _optional(bool, entry, "support", what, False)
    mass, density = _optional(float, entry, "mass", what, None), _optional(float, entry, "density", what, None)
    if mass is not None:  # a mass counts, whatever density stands beside it
        density = None
    weight = mass if density is None else density
    if not support and not (weight is not None and weight > 0):
        raise InputError(f"{what}: expected a density > 0 in kg/m^3 or a mass > 0 in kg, got {density} and {mass}")
    return Block(surface, density, mass, support) if weight else Block(surface, support=support)


def _block_entry(block: Block) -> dict[str, object]:
    entry: dict[str, object] = {"id": block.name, "vertices": block.surface.points, "faces": block.surface.polygons}
    for key in ("density", "mass"):
        if getattr(block, key) is not None:
            entry[key] = getattr(block, key)
    return {**entry, "support": True} if block.support else entry


def _load(given: object, where: str) -> Acceleration | PointForce:
    entry = _mapping(given, f"{where}, loads")
    kind = _get(str, entry, "kind", f"{where}, loads")
    what = f"{where}, load {kind!r}"
    value, scaled = _vector(entry, "value", what), _optional(bool, entry, "scaled_by_multiplier", what, False)
    if kind == "acceleration":
        return Acceleration(value, scaled)
    if kind == "force":
        point = None if entry.get("point") is None else _vector(entry, "point", what)
        return PointForce(_name(entry, "block", what), value, point, scaled)
    raise InputError(f'{where}, loads: expected the kind "acceleration" or "force", got {kind!r}')


def _load_entry(load: Acceleration | PointForce) -> dict[str, object]:
    entry: dict[str, object] = {"kind": "acceleration", "value": load.value, "scaled_by_multiplier": load.scaled}
    if isinstance(load, PointForce):
        entry |= {"kind": "force", "block": load.block} | ({} if load.point is None else {"point": load.point})
    return entry


def _motion(given: object, where: str) -> tuple[str, tuple[float, float, float]]:
    entry = _mapping(given, where)
    return _name(entry, "block", where), _vector(entry, "velocity", where)


def _expected(given: object, where: str) -> Expected:
    entry = _mapping(given, where)
    value = entry.get("value")
    if not isinstance(value, str):
        value = _get(float, entry, "value", where)
    texts = {key: _optional(str, entry, key, where, "") for key in ("kind", "bound")}
    return Expected(_get(str, entry, "quantity", where), value, **texts, tolerance=_optional(float, entry, "tolerance", where, None))


def _source(value: object, where: str) -> tuple[str, ...]:
    return (value,) if isinstance(value, str) else from_json(tuple[str, ...], value, f"{where}, source")


def _name(entry: Mapping[str, object], key: str, where: str) -> str:
    """A block's name; a number counts as its digits."""
    value = entry.get(key)
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else _get(str, entry, key, where)


def _vector(entry: Mapping[str, object], key: str, where: str) -> tuple[float, float, float]:
    values = _get(tuple[float, ...], entry, key, where)
    if len(values) != 3:
        raise InputError(f"{where}, {key}: expected three numbers, got {len(values)}")
    return values[0], values[1], values[2]


def _get[T](kind: type[T], entry: Mapping[str, object], key: str, where: str) -> T:
    if key not in entry:
        raise InputError(f"{where}: expected the key {key!r}, got {', '.join(map(repr, entry)) or 'none'}")
    return from_json(kind, entry[key], f"{where}, {key}")


def _optional[T, D](kind: type[T], entry: Mapping[str, object], key: str, where: str, default: D) -> T | D:
    """The value, or the default where there is none; null stands for a default of None."""
    if key not in entry or (default is None and entry[key] is None):
        return default
    return from_json(kind, entry[key], f"{where}, {key}")


def _mapping(value: object, where: str) -> Mapping[str, object]:
    if not isinstance(value, Mapping):
        raise InputError(f"{where}: expected a record {{...}}, got {type(value).__name__}")
    return value


def _entries(data: Mapping[str, object], key: str, where: str) -> list[object]:
    value = data.get(key, [])
    if not isinstance(value, list):
        raise InputError(f"{where}, {key}: expected a list, got {type(value).__name__}")
    return value
