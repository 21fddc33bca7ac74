"""Masonry problems as JSON, schema "masonry-problem/1": SI units, z up.

dimension 2 (plane x, z; blocks are prisms along y) or 3
blocks    [{id, vertices [[x, y, z], ...], faces [[vertex numbers], ...] (left out: a hexahedron in VTK's order), density or mass, support}]
contact   {mu, mu_between [{between [id, id], mu}]}
loads     [{kind "acceleration", value} | {kind "force", block, value, point, moment}, each with scaled_by_multiplier]
support_motion [{block, velocity}]
initial_pose [{block, translation, rotation [rx, ry, rz] (vector, rad), about [x, y, z] (left out: the centroid)}]: where blocks begin
base_acceleration [{direction, times, values} | {kind "half_sine" or "sine", value (amplitude and direction), duration, frequency}]
expected [{quantity, value, kind, bound, tolerance}]; name, title, question, source

Other keys are left aside, but for those that look like one of these misspelt, friction or supports said in other words, and what blocks
would hold by besides friction (cohesion, tension, dilatancy): they are refused. So are `units` other than m, kg, s, N.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fcsim.arrays import Json
from fcsim.assembly.time_functions import AccelerationRecord
from fcsim.errors import InputError
from fcsim.files import note_read
from fcsim.masonry.problem import Acceleration, BaseAcceleration, Block, Expected, MasonryProblem, PointForce, expect_mass, expect_problem
from fcsim.mesh.solids.closed_surface import closed_surface
from fcsim.records import from_json, read_json, write_record

SCHEMA = "masonry-problem/1"
HEXAHEDRON = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
"""The faces of VTK's hexahedron."""
_KEYS = {
    "": "schema name title question source dimension units blocks contact loads support_motion initial_pose base_acceleration expected",
    "blocks": "id vertices faces density mass support",
    "contact": "mu mu_between law",
    "mu_between": "between mu",
    "loads": "kind value block point moment scaled_by_multiplier",
    "support_motion": "block velocity",
    "initial_pose": "block translation rotation about",
    "base_acceleration": "direction times values kind value duration frequency",
}
"""What each record may say."""
_MEANT = {"fixed": "support", "is_support": "support", "friction": "mu", "mu": "mu_between of contact", "scaled": "scaled_by_multiplier"}
"""What is said in other words, and the key that says it."""
_BEYOND = ("cohesi", "tension", "tensile", "dilat", "friction_angle")
"""Parts of the names of what joints of dry blocks do not have, or have as another number."""
_DENIED = re.compile(r"(?i)\b(no|not|nor|none|never|cannot|free|false|without|zero|non(?=.?(coh|ten|dil)))\b|[en]sionless|\b0+\b(?!\.?\d)")
_OF_SIZE = re.compile(r"(?i)(cohesi|tensi|dilat)((?!\bmu\b|fricti|\bphi\b)[^(])*?(?<![\w.,])(?!0+([.,]0*)?(e\d+)?(?![\w.,]))\d")
"""What says of such a name that it is not there, no cohesion, cohesionless, cohesion 0, and what gives it a size all the same."""
_UNITS = {
    "length": ("m", "metre", "metres", "meter", "meters"),
    "mass": ("kg", "kilogram", "kilograms"),
    "time": ("s", "second", "seconds"),
    "force": ("N", "newton", "newtons"),
}
_SAMPLES, _HALF_WAVES = 500, 10_000  # points of a half wave; more than any table shakes


def read_masonry(path: str | Path) -> MasonryProblem:
    """Read a masonry problem; InputError names the file, the block and the key."""
    return masonry_of_json(json_content(Path(path)), Path(path))


def json_content(path: Path) -> Json:
    """The content of a JSON file, noted as read."""
    try:
        content = read_json(path)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    note_read(path)
    return content


def masonry_of_json(data: Json, path: Path) -> MasonryProblem:
    """The problem that the content of a file is."""
    where = str(path)
    if not isinstance(data, Mapping) or data.get("schema") != SCHEMA:
        schema = data.get("schema", "no schema") if isinstance(data, Mapping) else type(data).__name__
        raise InputError(f'{where}: expected a masonry problem, schema "{SCHEMA}", got {schema!r}')
    _refuse_slips(data, "", where)
    _refuse_units(data.get("units"), f"{where}, units")
    blocks = _entries(data, "blocks", where)
    if not blocks:
        raise InputError(f"{where}, blocks: expected at least one, got none")
    contact = _mapping(data.get("contact"), f"{where}, contact")
    _refuse_slips(contact, "contact", f"{where}, contact")
    between: dict[tuple[str, str], float] = {}
    for entry in _entries(contact, "mu_between", f"{where}, contact"):
        entry = _mapping(entry, f"{where}, mu_between")
        _refuse_slips(entry, "mu_between", f"{where}, mu_between")
        pair = [_name({"between": name}, "between", f"{where}, mu_between") for name in _entries(entry, "between", f"{where}, mu_between")]
        if len(pair) != 2 or pair[0] == pair[1]:
            raise InputError(f"{where}, mu_between: expected the names of two blocks, got {pair}")
        mu = _get(float, entry, "mu", f"{where}, mu_between {pair}")
        known = between.setdefault((pair[0], pair[1]), mu)
        if known != mu:
            raise InputError(f"{where}, mu_between: expected one number for {pair[0]!r} and {pair[1]!r}, got {known:g} and {mu:g}")
    poses = [_pose(entry, f"{where}, initial_pose") for entry in _one_or_more(data, "initial_pose", where)]
    motions = [_motion(entry, f"{where}, support_motion") for entry in _entries(data, "support_motion", where)]
    moving = [name for name, _ in motions]
    twice = next((name for name in moving if moving.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{where}, support_motion: expected one velocity a support, got {moving.count(twice)} of {twice!r}: add them up")
    read = [_block(entry, where) for entry in blocks]
    for name, moved in poses:
        found = [k for k, block in enumerate(read) if block.name == name]
        if not found:
            raise InputError(f"{where}, initial_pose: expected the name of a block, got {name!r}")
        read[found[0]] = moved(read[found[0]])
    return MasonryProblem(
        name=_get(str, data, "name", where, path.stem),
        dimension=_get(int, data, "dimension", where),
        blocks=tuple(read),
        mu=_get(float, contact, "mu", f"{where}, contact"),
        loads=tuple(_load(entry, where) for entry in _entries(data, "loads", where)),
        between=between,
        motion=dict(motions),
        shaking=tuple(_shaking(entry, f"{where}, base_acceleration") for entry in _one_or_more(data, "base_acceleration", where)),
        title=_get(str, data, "title", where, ""),
        question=_get(str, data, "question", where, ""),
        expected=tuple(_expected(entry, f"{where}, expected") for entry in _entries(data, "expected", where)),
        source=(value,) if isinstance(value := data.get("source", []), str) else from_json(tuple[str, ...], value, f"{where}, source"),
    )


def write_masonry(path: str | Path, problem: MasonryProblem) -> None:
    """Write a masonry problem; `read_masonry` reads it again."""
    expect_problem(problem, "write_masonry")
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
    if problem.shaking:
        data["base_acceleration"] = [
            {"direction": shake.direction, "times": shake.record.times, "values": shake.record.values} for shake in problem.shaking
        ]
    write_record(Path(path), data)


def _block(entry: object, where: str) -> Block:
    entry = _mapping(entry, f"{where}, blocks")
    name = _name(entry, "id", f"{where}, blocks")
    what = f"{where}, block {name!r}"
    _refuse_slips(entry, "blocks", what)
    vertices = _get(tuple[tuple[float, ...], ...], entry, "vertices", what)
    if any(len(vertex) != 3 for vertex in vertices):
        raise InputError(f"{what}, vertices: expected three coordinates each")
    faces = _get(tuple[tuple[int, ...], ...] | None, entry, "faces", what, None)
    if faces is None:
        if len(vertices) != 8:
            raise InputError(f"{what}: expected faces, or the 8 vertices of a hexahedron, got {len(vertices)} vertices")
        faces = HEXAHEDRON
    try:
        surface = closed_surface(name, vertices, faces)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    support = _get(bool, entry, "support", what, False)
    mass, density = _get(float | None, entry, "mass", what, None), _get(float | None, entry, "density", what, None)
    if mass and density:  # 0 is none
        expect_mass(surface, density, mass, what)
    given = density if mass is None else mass
    if not support and not (given is not None and given > 0):
        raise InputError(f"{what}: expected a density > 0 in kg/m^3 or a mass > 0 in kg, got {density} and {mass}")
    return Block(surface, density if mass is None else None, mass, support) if given else Block(surface, support=support)


def _pose(entry: object, where: str) -> tuple[str, Callable[[Block], Block]]:
    """The name of a block, and how it is moved to where it begins."""
    entry = _mapping(entry, where)
    name = _name(entry, "block", where)
    _refuse_slips(entry, "initial_pose", where)
    if not {"translation", "rotation"} & set(entry):
        raise InputError(f"{where}, {name!r}: expected a translation or a rotation, got neither")
    translation, rotation = (_vector(entry, key, where) if key in entry else (0.0, 0.0, 0.0) for key in ("translation", "rotation"))
    about = _vector(entry, "about", where) if entry.get("about") is not None else None

    def moved(block: Block) -> Block:
        centre = block.surface.moments()[1] if about is None else np.asarray(about)
        points = Rotation.from_rotvec(rotation).apply(block.surface.points - centre) + centre + np.asarray(translation)
        return replace(block, surface=replace(block.surface, points=points))

    return name, moved


def _shaking(entry: object, where: str) -> BaseAcceleration:
    entry = _mapping(entry, where)
    _refuse_slips(entry, "base_acceleration", where)
    if "times" in entry:
        _refuse_of_others(entry, "base_acceleration", "kind direction times values", where)
        times, values = (_get(tuple[float, ...], entry, key, where) for key in ("times", "values"))
        return BaseAcceleration(_vector(entry, "direction", where), _record(times, values, where))
    kind, value = _get(str, entry, "kind", where), _vector(entry, "value", where)
    if kind not in ("half_sine", "sine"):
        raise InputError(f'{where}: expected times and values, or the kind "half_sine" or "sine", got {kind!r}')
    _refuse_of_others(entry, "base_acceleration", "kind value duration" + " frequency" * (kind == "sine"), f"{where} {kind!r}")
    duration = _get(float, entry, "duration", where)
    frequency = 0.5 / duration if kind == "half_sine" and duration > 0 else _get(float, entry, "frequency", where)
    if not (duration > 0 and 0 < frequency < np.inf):
        raise InputError(f"{where}: expected a duration [s] and a frequency [Hz] > 0, got {duration} and {frequency}")
    if not 2 * frequency * duration <= _HALF_WAVES:
        raise InputError(f"{where}: expected at most {_HALF_WAVES} half waves, got {duration} s of {frequency} Hz")
    times = np.linspace(0.0, duration, int(np.ceil(2 * frequency * duration)) * _SAMPLES + 1)
    return BaseAcceleration(value, _record(times, np.linalg.norm(value) * np.sin(2 * np.pi * frequency * times), where))


def _record(times: object, values: object, where: str) -> AccelerationRecord:
    try:
        return AccelerationRecord(np.asarray(times), np.asarray(values))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _block_entry(block: Block) -> dict[str, object]:
    entry: dict[str, object] = {"id": block.name, "vertices": block.surface.points, "faces": block.surface.polygons}
    for key in ("density", "mass"):
        if getattr(block, key) is not None:
            entry[key] = getattr(block, key)
    return {**entry, "support": True} if block.support else entry


def _load(entry: object, where: str) -> Acceleration | PointForce:
    entry = _mapping(entry, f"{where}, loads")
    kind = _get(str, entry, "kind", f"{where}, loads")
    what = f"{where}, load {kind!r}"
    _refuse_slips(entry, "loads", what)
    value, scaled = _vector(entry, "value", what), _get(bool, entry, "scaled_by_multiplier", what, False)
    if kind == "acceleration":
        _refuse_of_others(entry, "loads", "kind value scaled_by_multiplier", f"{what}, which acts on all free blocks")
        return Acceleration(value, scaled)
    if kind == "force":
        point = None if entry.get("point") is None else _vector(entry, "point", what)
        moment = _vector(entry, "moment", what) if "moment" in entry else (0.0, 0.0, 0.0)
        return PointForce(_name(entry, "block", what), value, point, scaled, moment)
    raise InputError(f'{where}, loads: expected the kind "acceleration" or "force", got {kind!r}')


def _load_entry(load: Acceleration | PointForce) -> dict[str, object]:
    entry: dict[str, object] = {"kind": "acceleration", "value": load.value, "scaled_by_multiplier": load.scaled}
    if isinstance(load, PointForce):
        entry |= {"kind": "force", "block": load.block} | ({} if load.point is None else {"point": load.point})
        entry |= {"moment": load.moment} if any(load.moment) else {}
    return entry


def _motion(entry: object, where: str) -> tuple[str, tuple[float, float, float]]:
    entry = _mapping(entry, where)
    _refuse_slips(entry, "support_motion", where)
    return _name(entry, "block", where), _vector(entry, "velocity", where)


def _expected(entry: object, where: str) -> Expected:
    entry = _mapping(entry, where)
    value = _get(str if isinstance(entry.get("value"), str) else float, entry, "value", where)
    texts = {key: _get(str, entry, key, where, "") for key in ("kind", "bound")}
    return Expected(_get(str, entry, "quantity", where), value, **texts, tolerance=_get(float | None, entry, "tolerance", where, None))


def _name(entry: Mapping[str, object], key: str, where: str) -> str:
    """A block's name; a number counts as its digits."""
    value = entry.get(key)
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else _get(str, entry, key, where)


def _vector(entry: Mapping[str, object], key: str, where: str) -> tuple[float, float, float]:
    values = _get(tuple[float, ...], entry, key, where)
    if len(values) != 3:
        raise InputError(f"{where}, {key}: expected three numbers, got {len(values)}")
    return values[0], values[1], values[2]


def _refuse_slips(entry: Mapping[str, object], kind: str, where: str) -> None:
    """InputError for keys that are none but look or mean like one: what they say would be left aside without a word."""
    known = _KEYS[kind].split()
    for key, value in entry.items():
        if (key in known and key != "law") or not value:
            continue
        parts = re.split(r";|,(?!\d)", str(value).replace("_", " ").replace("None", "0")) if key == "law" else [key]
        said = [part for part in parts if key != "law" or not _DENIED.search(part) or _OF_SIZE.search(part)]
        if any(part in words.lower() for part in _BEYOND for words in said):
            raise InputError(f"{where}: expected dry joints with Coulomb's friction mu, got {key!r}: {value!r}, which is not covered")
        left = [name for name in known if name not in entry]
        meant = _MEANT.get(key.lower(), "").split(" of ")
        near = [" of ".join(meant)] if meant[0] in left or meant[1:] else get_close_matches(key.lower(), left, 1, 0.8)
        if near and key != "law":
            raise InputError(f"{where}: expected the key {near[0]!r}, got {key!r}, which would be left aside")


def _refuse_of_others(entry: Mapping[str, object], kind: str, taken: str, where: str) -> None:
    """InputError for keys that records of another kind have: this one would leave them aside."""
    for key in _KEYS[kind].split():
        if key not in taken.split() and entry.get(key) is not None:
            raise InputError(f"{where}: expected {', '.join(taken.split())}, got {key!r}: {entry[key]!r}, which it does not have")


def _refuse_units(units: object, where: str) -> None:
    """InputError for units that are not those of the schema: numbers are not converted."""
    for name, accepted in _UNITS.items():
        given = units.get(name) if isinstance(units, Mapping) else None
        if isinstance(given, str) and given.strip() not in accepted:
            raise InputError(f"{where}, {name}: expected {accepted[0]}, since numbers are not converted, got {given!r}")


_MISSING = object()


def _get(kind: Any, entry: Mapping[str, object], key: str, where: str, default: Any = _MISSING) -> Any:  # X | None is no type[X]
    if key not in entry:
        if default is _MISSING:
            raise InputError(f"{where}: expected the key {key!r}, got {', '.join(map(repr, entry)) or 'none'}")
        return default
    return from_json(kind, entry[key], f"{where}, {key}")


def _mapping(value: object, where: str) -> Mapping[str, object]:
    if not isinstance(value, Mapping):
        raise InputError(f"{where}: expected a record {{...}}, got {type(value).__name__}")
    return value


def _one_or_more(data: Mapping[str, object], key: str, where: str) -> list[object]:
    """A list of entries, or one of them alone."""
    value = data.get(key) or []
    return [value] if isinstance(value, Mapping) else _entries({key: value}, key, where)


def _entries(data: Mapping[str, object], key: str, where: str) -> list[object]:
    value = data.get(key, [])
    if not isinstance(value, list):
        raise InputError(f"{where}, {key}: expected a list, got {type(value).__name__}")
    return value
