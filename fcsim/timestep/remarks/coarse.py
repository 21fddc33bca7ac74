"""What is said of bodies whose stress is that of their cells: too coarse a mesh, or cells that lock."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, IntArray
from fcsim.assembly.kinematics.deformation import Deformation
from fcsim.assembly.loads import FollowerForce, Force, NodalForces
from fcsim.assembly.locking import locking, locking_in_bending, locking_in_flow, stress_error
from fcsim.assembly.model import Model
from fcsim.assembly.supports.selection import edges_within, facets_within
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.by_region import is_linear
from fcsim.mesh.part import Body, Part
from fcsim.timestep.step import Step

NAMED = 0.04
"""Share eta^2 of the energy from which a body is named: a fifth of its stress is that of the cells."""
LEFT = 0.25
"""Of the body's energy: what must be left where cells around points that forces act on are left out."""
STRAINED = 1e-10
"""Strain of a body that bears something: less is round-off."""
EVERY = 4
"""Steps are looked at whose number is a power of this, and the last."""


def coarse(step: Step, found: Deformation, steps: int, when: str, said: frozenset[str]) -> dict[str, str]:
    """The remark on the worst body whose cells are too stiff for what they bear, by `fcsim.assembly.locking.recovery`; {} where none is.

    Statics alone: in dynamics fronts of waves jump as well. Of the bodies of one part that which is strained most is looked at. Left out
    are cells near points and lines that supports hold or forces pull, and near contacts, where stress has no bound in theory and every mesh
    is too coarse: what is far from them must hold a quarter of the body's energy, or nothing is said. Parts of which
    `fcsim.assembly.locking` spoke as the run began are not named again.
    """
    model = step.model
    if "coarse" in said or step.scheme.timing.moving or model.shares is not None or not (looked_at(step.number) or step.number == steps):
        return {}
    strained: dict[int, int] = {}
    for number, body in enumerate(model.deformable):
        best = strained.get(id(body.part))
        if found.strain[number] > 0 and (best is None or found.strain[number] > found.strain[best]):
            strained[id(body.part)] = number
    worst = (NAMED, -1)
    for number in strained.values():
        part = model.deformable[number].part
        if locking(part) or locking_in_bending(part) or locking_in_flow(part):
            continue
        error = stress_error(model, number, step.state.x, step.state.internal, step.state.t)
        if error.strain > STRAINED and error.share() > worst[0]:
            far = ~_near_points(step, number)
            if error.energy[far].sum() >= LEFT * error.energy.sum() and error.share(far) > worst[0]:
                worst = (error.share(far), number)
    share, number = worst
    if number < 0:
        return {}
    body = model.deformable[number]
    return {
        "coarse": f"{when}: the stress of body {body.name!r} is {100 * np.sqrt(share):.2g} % that of its {body.part.elements} cells, by "
        f"its jumps between them: it is too stiff by some {100 * share:.2g} %, or more. What helps: smaller cells{_instead(body)}"
    }


def looked_at(number: int) -> bool:
    """Whether the number of a step is 1, 4, 16, ...: what is dear is looked at then, and in the last step."""
    while number % EVERY == 0 and number > 1:
        number //= EVERY
    return number == 1


def _instead(body: Body) -> str:
    part = body.part
    if CELL_TYPES[part.cell_type].order == 2:
        return " where it is bent or curved"
    if part.elements == "P1":
        return ', or "P2"'
    return ', or "Q1-enhanced" or "Q2"' if is_linear(part.material) and part.elements != "Q1-enhanced" else ', or "Q2"'


def _near_points(step: Step, number: int) -> BoolArray:
    """Which cells (nc,) of a body are by points that forces act on, or share a node with such cells."""
    model = step.model
    part, begin = model.deformable[number].part, int(model.node_offset[number])
    marked = np.zeros(len(part.points), dtype=bool)
    for nodes in (step.contacts.nodes[step.contacts.weights != 0], *_held_and_pulled(model, model.deformable[number]), _linked(step)):
        own = nodes - begin
        marked[own[(own >= 0) & (own < len(marked))]] = True
    near: BoolArray = np.zeros(len(part.cells), dtype=bool)
    for _ in range(2):
        near = marked[part.cells].any(axis=1)
        marked[part.cells[near]] = True
    return near


def _held_and_pulled(model: Model, body: Body) -> list[IntArray]:
    """Nodes, by the model's numbers, of supports and forces that act on points and lines of a body, not on faces."""
    begin, found = int(model.node_offset[model.number[body.name]]), []
    for acting in (*model.supports, *model.loads):
        if acting.body != body.name or isinstance(acting, FollowerForce):
            continue
        if isinstance(acting, NodalForces):
            found.append(begin + np.arange(len(body.part.points)))
        elif not isinstance(acting, Force) and not hasattr(acting, "selection"):
            continue
        elif not acting.selection.whole:
            nodes = acting.selection.of(model, body.name, "remark")
            found.append(begin + np.setdiff1d(nodes, _on_faces(body.part, nodes)))
    return found


def _on_faces(part: Part, nodes: IntArray) -> IntArray:
    facets = facets_within(part, nodes) if part.dimension == 3 else edges_within(part, nodes)
    return np.unique(facets)


def _linked(step: Step) -> IntArray:
    return np.empty(0, dtype=np.int64) if step.linked is None else step.linked.linkage.nodes
