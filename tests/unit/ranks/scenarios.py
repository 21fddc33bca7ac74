"""Small simulations of all kinds, and what is compared of their steps. `main` has each rank write it as JSON
into a folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

import numpy as np

from fcsim.assembly.kinematics import ranges
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.assembly.whole import vectors
from fcsim.contact_detection import Detector, Everything, ExactContacts, SurfacePair, node_to_segment
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Compliant, Springs, Velocity
from fcsim.linear.sparse import by_ranks
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.exact.rigid_shapes import rigid_plane, rigid_sphere
from fcsim.mesh.material import Material
from fcsim.mesh.material.plastic import Plastic
from fcsim.mesh.part import Body
from fcsim.ranks import alone, sharing, tasks, writes
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.timestep import energy
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.reactions import reactions
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.look_ahead import ahead
from fcsim.timestep.theta import Theta

CASES = Path(__file__).parents[3] / "cases"
HOLD = ("x", "y", "z")


def case(name: str, steps: int, **parameters: str) -> Callable[[], Simulation]:
    def build() -> Simulation:
        script = load_case(CASES / name)
        return replace(script.build(parse_parameters(script, parameters)).simulation, steps=steps)

    return build


def mixed() -> Simulation:
    """On a rigid floor that moves: two deformable blocks of one part, turned apart, one of plastic material, a rigid box on top."""
    size = (0.2, 0.2, 0.1)
    part = brick("block", size, (2, 2, 1), Material(1e7, 0.2, 2000.0))
    weak = brick("weak", size, (1, 1, 1), Plastic(1e7, 0.3, 2000.0, 200.0))
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    model = build_model(
        [
            rigid_box("floor", (2.0, 2.0, 0.1), (0.1, 0.1, -0.05), 2000.0),
            Body("first", part),
            Body("second", part, rotation=quarter, translation=np.array([0.21, 0.01, 0.1])),
            Body("weak", weak, translation=np.array([0.32, 0.0, 0.0])),
            rigid_box("top", (0.1, 0.1, 0.1), (0.1, 0.1, 0.25), 2000.0),
        ],
        supports=[Support("floor", ("y", "z", "rx", "ry", "rz")), Support("floor", ("x",), velocity=0.05)],
        gravity=lambda t: (1.0, 0.5, -9.81),
        beta=1e-4,
    )
    return Simulation(model, Everything(model, 0.3), Theta(1e-3), 6)


def cut() -> Simulation:
    """A soft block is dragged over a plane by a solver with too few iterations for whole steps."""
    part = brick("block", (1.0, 0.4, 0.3), (4, 3, 2), Material(1e6, 0.3, 1000.0))
    model = build_model(
        [Body("block", part), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)],
        supports=[
            Support("plane", (*HOLD, "rx", "ry", "rz")),
            Support("block", ("z",), "z+", velocity=-0.01),
            Support("block", ("x",), "z+", velocity=lambda t: 0.02 * (t > 0.5)),
            Support("block", ("y",), "z+"),
        ],
    )
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("plane", "z+")]), 0.5, 1e-1)
    settings = SolverSettings(name="NSN-AC", options={"max_iterations": 3}, fallback=())
    return Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(0.5), 2, settings, cuttings=6)


def balls() -> Simulation:
    """Exact spheres fall on an elastic bed between each other; contacts come during the run."""
    bed = brick("bed", (0.3, 0.3, 0.1), (3, 3, 1), Material(1e7, 0.3, 1000.0))
    places = [(0.04 + 0.11 * (k % 3) + 0.01 * (k // 3), 0.06 + 0.02 * (k // 3), 0.16 + 0.1 * (k // 3) + 0.003 * k) for k in range(9)]
    spheres = [rigid_sphere(f"ball {k}", 0.05, place, 1.0) for k, place in enumerate(places)]
    model = build_model(
        [
            Body("bed", bed),
            *spheres,
            rigid_plane("ground", (0, 0, 0), (0, 0, 1)),
        ],
        supports=[Support("ground", (*HOLD, "rx", "ry", "rz"))],
        gravity=lambda t: (0.0, 0.0, -9.81),
    )
    return Simulation(model, ExactContacts(model, 0.4), Theta(4e-3), 12)


def meeting() -> Simulation:
    """Free deformable blocks: one flies into its neighbour and rebounds, one flies away from all."""
    part = brick("block", (0.1, 0.1, 0.1), (2, 2, 2), Material(1e8, 0.3, 1000.0))
    model = build_model([Body(f"block {k}", part, translation=np.array([0.12 * k, 0.01 * k, 0.0])) for k in range(4)])
    start = at_rest(model)
    v = start.v.copy()
    for name, velocity in (("block 0", (2.0, 0.0, 0.0)), ("block 3", (5.0, 1.0, 0.0))):
        first = model.node_offset[model.number[name]]
        v[model.dof_of_node[first : first + len(part.points)]] = velocity
    return Simulation(model, Everything(model, 0.3), Theta(2e-3, law=Velocity(0.5)), 12, initial=replace(start, v=v))


def springs() -> Simulation:
    """Blocks of second order, whose meshes do not match, drawn over each other by joints with springs that mortar integrates."""
    size, stone = (0.2, 0.1, 0.1), Material(1e7, 0.2, 2000.0)
    cells = ((2, 1, 1), (3, 1, 1), (2, 2, 1))
    parts = [brick(f"part {k}", size, divisions, stone, elements="Q2") for k, divisions in enumerate(cells)]
    model = build_model(
        [Body(f"block {k}", part, translation=np.array([0.01 * k, 0.0, 0.1 * k])) for k, part in enumerate(parts)],
        supports=[Support("block 0", HOLD, "z-"), Support("block 2", ("x",), "z+", velocity=0.02)],
        gravity=lambda t: (0.0, 0.0, -9.81),
        beta=1e-3,
    )
    between = [(contact_surface(model, [(f"block {k + 1}", "z-")]), contact_surface(model, [(f"block {k}", "z+")])) for k in range(2)]
    pairs = [SurfacePair(slave, master, 0.4, 0.01, "mortar") for slave, master in between]
    law = Compliant(Springs(normal=1e8, tangential=5e7))
    return Simulation(model, Detector(pairs, model.n_nodes), Theta(2e-3, law=law), 6)


SCENARIOS: dict[str, Callable[[], Simulation]] = {
    "a wall": case("masonry_wall", 3, divisions="2,1,1"),
    "an arch": case("arch", 3, voussoirs="9"),
    "rigid, deformable and plastic bodies": mixed,
    "a pile": case("granular", 45, n="9", h="2e-3"),
    "a nonlinear body that folds": case("seal", 1, cells="2,16"),
    "joints between bodies": case("slider_crank", 3, elements="4"),
    "steps that are cut": cut,
    "balls on a bed": balls,
    "blocks that meet and part": meeting,
    "springs by mortar between blocks of second order": springs,
}


def ask_alone(simulation: Simulation, v: np.ndarray) -> None:
    """Products with A are kept: what one rank asks for alone must not have it ask the others again, which wait for other things."""
    simulation.factor.apply(v)
    if writes():
        with alone():
            simulation.factor.apply(v + 1.0)
    simulation.factor.apply(v)


def seen(build: Callable[[], Simulation]) -> dict[str, object]:
    """What a simulation computes: of every step its contacts, statuses, sub-steps and energy, and of all numbers a digest; the owners of
    its bodies."""
    digest, steps = hashlib.sha256(), []
    simulation = build()

    def take(step: Step) -> None:
        for array in (step.state.x, step.state.v, step.result.r, step.contacts.identity, step.contacts.gap, step.support_impulse):
            digest.update(np.ascontiguousarray(array).tobytes())
        if step.state.internal is not None:
            digest.update(step.state.internal.tobytes())
        steps.append(
            (len(step.contacts), np.bincount(step.contact_status, minlength=3).tolist(), step.substeps, repr(step.energy.residual))
        )

    with patch.object(ranges, "AT_ONCE", 2):  # one process solves for as many bodies at a time as ranks do
        for step in simulation:
            balance = step.energy
            with alone():  # as what rank 0 writes
                assert np.array_equal(step.reduction.velocity(step.result.r)[0], step.result.v) or step.linked is not None
                assert step.last_energy().residual == balance.residual or step.substeps > 1
            ask_alone(simulation, step.state.v)
            take(step)
    shares = simulation.model.shares
    return {"steps": steps, "digest": digest.hexdigest(), "owners": [] if shares is None else shares.owner.tolist()}


FROM: tuple[tuple[ModuleType, str], ...] = (
    *((module, "SHARED_FROM") for module in (energy, node_to_segment, ranges, reactions)),
    *((by_ranks, name) for name in ("CONTACTS_FROM", "NORMALS_FROM")),
    (ahead, "DOFS_FROM"),
    (tasks, "NUMBERS_FROM"),
    (node_to_segment, "MADE_FROM"),
    (vectors, "NODES_FROM"),
    (reactions, "IN_COMMON_FROM"),
)
"""What ranks share out of large models only."""


def main(folder: Path) -> None:
    with sharing() as ranks, ExitStack() as stack:
        assert ranks is not None
        for module, name in FROM:
            stack.enter_context(patch.object(module, name, 0))
        found = {name: seen(SCENARIOS[name]) for name in SCENARIOS}
        answer = {"sent": [ranks.exchanges, ranks.messages, ranks.bytes], "seen": found}
        (folder / f"{ranks.number}.json").write_text(json.dumps(answer), encoding="utf-8")
