"""Small models with a body that ranks have together, and what each rank finds. `main` has each rank write it as JSON into a
folder."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import numpy as np

from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.kinematics.deformation import DeformationMeasure
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.over_ranks import pieces
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.linear.over_ranks.rows import RowsOverRanks
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.material import ByRegion, Material
from fcsim.mesh.part import Body, Part
from fcsim.ranks import alone, sharing
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.theta import Theta

FIXED = ("x", "y", "z", "rx", "ry", "rz")
SIZE, DENSITY = (1.0, 0.8, 0.6), 2000.0


def heap() -> Simulation:
    """A block on a plane, and a small one on it, pushed aside; nothing holds them."""
    part = brick("block", SIZE, (6, 5, 4), Material(1e7, 0.3, DENSITY))
    small = brick("small", (0.3, 0.3, 0.2), (2, 2, 1), Material(1e7, 0.3, DENSITY))
    model = build_model(
        [
            Body("small", small, translation=np.array([0.31, 0.21, 0.6])),
            Body("block", part),
            rigid_box("plane", (4, 4, 1), (0.5, 0.5, -0.5), 1.0),
        ],
        supports=[Support("plane", FIXED)],
        gravity=lambda t: (1.0, 0.3, -9.81),
        beta=1e-4,
    )
    return Simulation(model, Everything(model, 0.5), Theta(1e-3), 4)


def two_materials() -> Part:
    """Soft below, stiff above, with cells that bend."""
    plain = brick("layers", SIZE, (5, 4, 4), Material(1e7, 0.3, DENSITY))
    low = plain.points[plain.cells].mean(axis=1)[:, 2] < 0.5 * SIZE[2]
    layers = {"soft": Material(4e6, 0.2, DENSITY), "stiff": Material(3e7, 0.3, DENSITY)}
    regions = {"soft": np.flatnonzero(low), "stiff": np.flatnonzero(~low)}
    return Part(
        "layers", plain.points, plain.cells, plain.cell_type, plain.surfaces, ByRegion(layers), elements="Q1-enhanced", regions=regions
    )


def pressed() -> Simulation:
    """In statics: two layers, turned a quarter, pressed on a plane by a slanted roller; a consistent mass; driven rows in the matrix."""
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    tilt = np.array([[np.cos(0.1), 0, np.sin(0.1)], [0, 1, 0], [-np.sin(0.1), 0, np.cos(0.1)]])
    model = build_model(
        [Body("block", two_materials(), rotation=quarter), rigid_box("plane", (4, 4, 1), (0, 0, -0.5), 1.0)],
        supports=[
            Support("plane", FIXED),
            Support("block", ("z",), "z+", velocity=-0.002, axes=tilt),
            Support("block", ("x", "y"), "z+", axes=tilt),
        ],
        gravity=lambda t: (0.0, 0.0, -9.81),
        lumped=False,
        driven="identity",
    )
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("plane", "z+")]), 0.4, 1e-1)
    return Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0, eta=1e-6), 2)


SCENARIOS: dict[str, Callable[[], Simulation]] = {"heap": heap, "pressed": pressed}


def weight(model: Model) -> float:
    """[N] of the deformable bodies by their densities and sizes."""
    volumes = {"block": float(np.prod(SIZE)), "small": 0.3 * 0.3 * 0.2}
    return 9.81 * DENSITY * sum(volumes[body.name] for body in model.deformable)


def operators(simulation: Simulation) -> dict[str, list[float]]:
    """Products with K, M and A, a solution, what K bounds, and the energy of bending that small strains leave out."""
    model = simulation.model
    x = np.random.default_rng(2).standard_normal(model.n_dofs)
    factor: SystemFactor = simulation.factor
    place, bent = model.reference[: model.n_elastic // 3], np.zeros(model.n_dofs)
    bent[: model.n_elastic].reshape(-1, 3)[:, 2] = 0.2 * np.sin(4 * place[:, 0]) * np.sin(4 * place[:, 1])
    unknowns = x[model.free_dofs] if model.driven == "eliminated" else x
    return {
        "K x": model.apply_stiffness(x).tolist(),
        "M x": model.apply_mass(x).tolist(),
        "A x": factor.product(unknowns).tolist(),
        "A^-1 x": factor.solve(unknowns).tolist(),
        "largest force": model.elastic.largest_force.tolist(),
        "left out": DeformationMeasure(model.groups, len(model.deformable))(bent).left_out.tolist(),
        "load": model.load(0.0).tolist(),
    }


def singular() -> str:
    """What a body without supports in statics is told."""
    part = brick("block", SIZE, (4, 4, 4), Material(1e7, 0.3, DENSITY))
    model = build_model([Body("block", part)], supports=[Support("block", ("x",), "z-")])
    try:
        SystemFactor(model, 0.0, 1.0, np.arange(4))
    except InputError as error:
        return str(error)
    return ""


def found(name: str) -> dict[str, object]:
    simulation = SCENARIOS[name]()
    model, digest, steps = simulation.model, hashlib.sha256(), []
    for step in simulation:
        for array in (step.state.x, step.state.v, step.result.r):
            digest.update(np.ascontiguousarray(array).tobytes())
        with alone():  # as rank 0 may ask for what it writes, of matrices and factors that it then makes for itself
            again = step.reduction.velocity(step.result.r)[0]
        steps.append(
            {
                "contacts": step.contacts.identity.tolist(),
                "status": step.contact_status.tolist(),
                "r": step.result.r.tolist(),
                "x": step.state.x.tolist(),
                "energy": [step.energy.kinetic, step.energy.elastic, step.energy.load_work],
                "residual": step.energy.residual,
                "momentum": step.result.checks.momentum,
                "again": float(np.abs(again - step.result.v).max() / np.abs(again).max()),
                "push": step.contact_force_on(model.body_number("plane")).tolist(),
                "gain": float(model.apply_mass(step.state.v - step.previous.v)[: model.n_elastic].reshape(-1, 3)[:, 2].sum()),
            }
        )
    spread = [isinstance(group.K, RowsOverRanks) for group in model.groups]
    return {"steps": steps, "digest": digest.hexdigest(), "spread": spread, "weight": weight(model), **operators(simulation)}


def main(folder: Path) -> None:
    with sharing() as ranks, mock.patch.object(pieces, "SPREAD_FROM", 10):
        assert ranks is not None
        answer = {name: found(name) for name in SCENARIOS}
        (folder / f"{ranks.number}.json").write_text(json.dumps({**answer, "singular": singular()}), encoding="utf-8")
