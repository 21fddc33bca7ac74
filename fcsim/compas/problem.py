"""A problem of compas_dem as one of ours: blocks, friction, loads, and the motions that it prescribes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fcsim.assembly.supports.support import Support
from fcsim.errors import InputError, MissingDependency
from fcsim.masonry.bodies import HELD
from fcsim.masonry.compas_json import Record, Solid, data_of, friction_of, loads_of
from fcsim.masonry.problem import Acceleration, Block, MasonryProblem

if TYPE_CHECKING:
    from compas_dem.models import BlockModel
    from compas_dem.problem import Problem

WHERE = "compas_dem problem"
Pairs = Mapping[tuple[int, int], float]


@dataclass(frozen=True, eq=False)
class Posed:
    """masonry: blocks named by their graph nodes, loads that ramp `scaled`; motions: of a block, its displacement and rotation vector
    [m, rad] (6,) at the end, None = free; stone: the moduli E [Pa] and nu that all blocks share, None = not said or several."""

    masonry: MasonryProblem
    motions: Mapping[str, tuple[float | None, ...]]
    stone: tuple[float, float] | None
    remarks: tuple[str, ...]

    def supports(self, pace: Any) -> list[Support]:  # pace: a function of time, or anything that scales a number
        """Supports that take every motion to its end, `pace(displacement)` being its velocity."""
        found = []
        for name, ends in self.motions.items():
            for axis, end in zip(HELD[3], ends, strict=True):
                if end is not None:
                    found.append(Support(name, (axis,), velocity=pace(end) if end else 0.0))
        return found


def posed(problem: Problem, model: BlockModel, mu: float | None, between: Pairs | None, density: float | None) -> Posed:
    """Translate a problem over a model.

    mu, between ({(node, node): mu}): in place of the contact model's; density [kg/m^3]: of blocks without a material. InputError names the
    block or the argument: no density, cohesion, loads and motions on blocks that are not there, blocks that are no closed surfaces.
    """
    blocks, names, stones = [], [], set()
    for element in model.elements():
        if not hasattr(element, "is_support"):
            continue  # a group of elements
        name = str(element.graphnode)
        material = element.material
        given = getattr(material, "density", None) or density
        if given is None and not element.is_support:
            raise InputError(f"block {name}: expected a material with a density in kg/m^3, or the argument density, got none")
        if not element.is_support:
            modulus, ratio = getattr(material, "Ecm", None), getattr(material, "poisson", None)
            stones.add((1e6 * modulus, 0.2 if ratio is None else ratio) if modulus else None)  # Ecm is in MPa
        blocks.append(_solid(name, element.modelgeometry, bool(element.is_support), given))
        names.append(name)
    if not any(solid.support for solid in blocks):
        raise InputError(f"{WHERE}: expected a model with supports, got {len(blocks)} blocks without: model.add_support(node)")
    record = _record(problem)
    solids = {solid.name: solid for solid in blocks}
    friction = friction_of(record, WHERE) if mu is None else mu
    if friction is None:
        raise InputError(f"{WHERE}: expected a contact model or the argument mu, got neither")
    gravity, loads = loads_of(record, solids, WHERE)
    masonry = MasonryProblem(
        name=str(problem.name),
        dimension=3,
        blocks=tuple(_block(solid) for solid in blocks),
        mu=friction,
        loads=(Acceleration((0.0, 0.0, -gravity)), *loads),
        between={(str(one), str(other)): value for (one, other), value in (between or {}).items()},
    )
    stone = stones.pop() if len(stones) == 1 else None
    return Posed(masonry, _motions(record, masonry), stone, _remarks(record))


def _solid(name: str, mesh: Any, support: bool, density: float | None) -> Solid:  # a compas Mesh, which has no types
    number = {key: k for k, key in enumerate(mesh.vertices())}
    points = np.array([mesh.vertex_coordinates(key) for key in number], dtype=np.float64).reshape(-1, 3)
    faces = {int(key): [number[vertex] for vertex in mesh.face_vertices(key)] for key in mesh.faces()}
    return Solid(name, points, faces, support, density)


def _block(solid: Solid) -> Block:
    try:
        return solid.block(1000.0)  # a support's, which nothing asks for
    except InputError as error:
        raise InputError(f"{WHERE}: {error}") from None


def _record(problem: Problem) -> Record:
    """What compas writes of a problem into JSON, without its model."""
    try:
        import compas
    except ImportError as error:
        raise MissingDependency(f"compas is not installed ({error}): pip install 'fcsim[compas]'") from None
    return data_of(json.loads(compas.json_dumps(problem)), WHERE)


def _motions(record: Record, masonry: MasonryProblem) -> dict[str, tuple[float | None, ...]]:
    """Every support held in six motions, and what is prescribed in place of that."""
    motions: dict[str, list[float | None]] = {block.name: [0.0] * 6 for block in masonry.blocks if block.support}
    for group in record.get("boundary_conditions") or []:
        for entry in data_of(group, WHERE).get("displacements") or []:
            data = data_of(entry, WHERE)
            name = str(data["block_index"])
            if name not in masonry.number:
                raise InputError(f"{WHERE}: expected displacements of blocks of the model, got one of block {name}")
            own = motions.setdefault(name, [None] * 6)
            for first, key in ((0, "translation"), (3, "rotation")):
                for k, value in enumerate(data.get(key) or ()):
                    if value is not None:
                        own[first + k] = _finite(value, name)
    return {name: tuple(values) for name, values in motions.items()}


def _finite(value: float, name: str) -> float:
    if not np.isfinite(value):
        raise InputError(f"{WHERE}: expected a displacement of block {name} that is a finite number, got {value}")
    return float(value)


def _remarks(record: Record) -> tuple[str, ...]:
    properties = record.get("contact_properties")
    joint: object = None if properties is None else data_of(properties, WHERE).get("joint_model")
    values: Sequence[object] = () if joint is None else [data_of(joint, WHERE).get(key) for key in ("kn", "kt")]
    return ("joint stiffnesses are not used: contact is rigid",) if any(values) else ()
