"""A run made without solving anything: 12 blocks in running bond between two platens, sheared by a formula, with made-up contacts."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fcsim.contact_detection.contacts import Contacts
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.running.vtk_series import SeriesWriter
from fcsim.witness import Overlap

STONE = Material(E=2.2e9, nu=0.2, density=2000.0)
FULL, THICKNESS, COURSE = 0.2, 0.1, 0.1
SHEAR = 0.45e-3  # [m] at the top, at the end
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])


def brick(name: str, length: float, n: tuple[int, int, int]) -> Part:
    size = np.array([length, THICKNESS, COURSE])
    index = np.arange((n[0] + 1) * (n[1] + 1) * (n[2] + 1)).reshape([k + 1 for k in n])
    points = np.stack(np.meshgrid(*[np.arange(k + 1) / k for k in n], indexing="ij"), -1).reshape(-1, 3) * size
    cells = np.stack([index[a : n[0] + a, b : n[1] + b, c : n[2] + c].ravel() for a, b, c in CORNERS], axis=1)
    return Part(name, points, cells, "hexahedron", {}, STONE)


def plane_brick(name: str, length: float, n: tuple[int, int]) -> Part:
    index = np.arange((n[0] + 1) * (n[1] + 1)).reshape([k + 1 for k in n])
    points = np.stack(np.meshgrid(*[np.arange(k + 1) / k for k in n], indexing="ij"), -1).reshape(-1, 2) * [length, COURSE]
    cells = np.stack([index[a : n[0] + a, b : n[1] + b].ravel() for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1)
    return Part(name, points, cells, "quadrilateral", {}, STONE)


def platen(name: str, z: float, height: float, d: int) -> RigidBody:
    x0, x1 = -0.03, 0.73
    if d == 3:
        points = np.array([x0, -0.02, z]) + CORNERS * [x1 - x0, 0.14, height]
        facets = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
        return RigidBody(name, 3000.0, np.eye(3), points.mean(0), points, {"all": facets, "contact": facets[:1]})
    points = np.array([x0, z]) + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [x1 - x0, height]
    return RigidBody(name, 3000.0, np.eye(1), points.mean(0), points, {"all": [(0, 1), (1, 2), (2, 3), (3, 0)]})


@dataclass(frozen=True, eq=False)
class FakeModel:
    """The attributes that a series reads; the state x is the nodes' displacement itself."""

    dimension: int
    bodies: tuple
    node_offset: np.ndarray
    reference: np.ndarray
    nonlinear: tuple = ()
    gravity: object = None

    @classmethod
    def of(cls, bodies: tuple) -> FakeModel:
        offset = np.concatenate([[0], np.cumsum([len(body.points) for body in bodies])])
        return cls(bodies[0].dimension, bodies, offset, np.concatenate([body.points for body in bodies]))

    def node_displacement(self, x: np.ndarray) -> np.ndarray:
        return x.reshape(self.reference.shape)

    strained_displacement = node_displacement

    def node_velocity(self, v: np.ndarray, x: np.ndarray) -> np.ndarray:
        return v.reshape(self.reference.shape)


def wall(d: int = 3, divisions: int = 8) -> FakeModel:
    n = (divisions, divisions // 2, divisions // 2)
    make = (lambda *a: brick(*a)) if d == 3 else (lambda name, length, n: plane_brick(name, length, (n[0], n[2])))
    full, half = make("full", FULL, n), make("half", FULL / 2, (n[0] // 2, *n[1:]))
    bodies: list = []
    for course in range(3):
        x = 0.0
        for part in (half, full, full, full) if course != 1 else (full, full, full, half):
            at = (x, 0.0, COURSE * course) if d == 3 else (x, COURSE * course)
            bodies.append(Body(f"block {len(bodies) + 1}", part, translation=at))
            x += FULL if part is full else FULL / 2
    return FakeModel.of((*bodies, platen("bottom", -0.04, 0.04, d), platen("top", 0.3, 0.04, d)))


def displacement(model: FakeModel, amplitude: float) -> np.ndarray:
    """Sheared courses, opening head joints, a crushed toe: (nodes, d), of the order of amplitude * SHEAR."""
    u = np.zeros_like(model.reference)
    for k, body in enumerate(model.bodies):
        nodes = slice(model.node_offset[k], model.node_offset[k + 1])
        X, centre = model.reference[nodes], model.reference[nodes].mean(0)
        if isinstance(body, RigidBody):
            u[nodes, 0] = -SHEAR if centre[-1] > 0.2 else 0.0
            continue
        height, along = centre[-1] / 0.3, centre[0] / 0.7
        tilt = 0.6 * SHEAR / 0.3 * (1 - along)
        toe = np.exp(-(X[:, 0] ** 2 + X[:, -1] ** 2) / 0.12**2)
        u[nodes, 0] = -SHEAR * (height + 0.25 * (X[:, -1] - centre[-1]) / 0.3) * (1 - 0.35 * along)
        u[nodes, -1] = tilt * (X[:, 0] - centre[0]) - 0.1 * SHEAR * X[:, -1] / 0.3 - 0.4 * SHEAR * toe * X[:, -1] / COURSE
    return amplitude * u


def contacts(model: FakeModel, amplitude: float, divisions: int = 8) -> tuple[Contacts, np.ndarray, np.ndarray]:
    """Points on the bed and head joints, a thrust from the top right to the bottom left; contacts, force, status."""
    d, h = model.dimension, FULL / divisions
    x, y = np.arange(h / 2, 0.7, h), np.arange(THICKNESS / 8, THICKNESS, THICKNESS / 4) if d == 3 else np.array([0.0])
    points, normals = [], []
    for z in (0.0, COURSE, 2 * COURSE, 3 * COURSE):
        points += [(a, b, z) for a in x for b in y]
    beds = len(points)
    for course in range(3):
        for a in (0.1, 0.3, 0.5) if course != 1 else (0.2, 0.4, 0.6):
            points += [(a, b, COURSE * course + c) for b in y for c in np.arange(h / 2, COURSE, h)]
    points = np.array(points)[:, :d] if d == 3 else np.array(points)[:, [0, 2]]
    normals = np.arange(len(points)) < beds
    nc, axes = len(points), np.eye(d)
    bed_frame = axes[[2, 0, 1]] if d == 3 else np.array([[0.0, 1.0], [-1.0, 0.0]])
    frame = np.where(normals[:, None, None], bed_frame, axes)
    distance = points[:, 0] - 0.7 * points[:, -1] / 0.3
    thrust = 1 + amplitude * (6 * np.exp(-((distance / 0.15) ** 2)) - 1)
    force = np.zeros((nc, d))
    force[:, 0] = np.where(normals, 40.0, 15.0 * amplitude * (distance > -0.1)) * thrust
    force[:, 1] = np.where(normals, 0.5 * amplitude * force[:, 0] * (1 if d == 3 else -1), 0.1 * force[:, 0])
    status = np.where(force[:, 0] <= 0, 0, np.where(normals & (points[:, -1] > 0.25), 2, 1)).astype(np.int8)
    nearest = np.argmin(np.linalg.norm(points[:, None] - model.reference[None, : model.node_offset[-3]], axis=2), axis=1)
    made = Contacts(
        point=points + displacement(model, amplitude)[nearest],
        frame=frame,
        gap=np.where(status == 0, 1e-4, 0.0),
        mu=np.full(nc, 0.53),
        nodes=np.column_stack([nearest, nearest, np.full(nc, -1)]),
        weights=np.column_stack([np.ones(nc), -np.ones(nc), np.zeros(nc)]),
        bodies=np.tile([0, 1], (nc, 1)),
        identity=np.arange(nc),
    )
    return made, force, status


def step(model: FakeModel, number: int, last: int, divisions: int = 8) -> SimpleNamespace:
    amplitude = number / last
    made, force, status = contacts(model, amplitude, divisions)
    u = np.zeros_like(force)
    u[:, 1] = np.where(status == 2, 2e-3 * amplitude, 0.0)
    x = displacement(model, amplitude)
    state = SimpleNamespace(t=0.5 * amplitude, x=x.ravel(), v=2 * x.ravel())
    return SimpleNamespace(
        linked=None,
        model=model,
        number=number,
        state=state,
        contacts=made,
        contact_force=force,
        contact_status=status,
        result=SimpleNamespace(u=u.ravel()),
        overlap=Overlap(2e-4, 1e-3, ("a", "b"), (0.1,) * model.dimension),
        rolling_moment=None,
        spinning_moment=None,
        law_variables={},
    )


def without_contacts(made: SimpleNamespace) -> SimpleNamespace:
    """The same step with no contact at all."""
    force = made.contact_force[:0]
    return SimpleNamespace(
        linked=None,
        model=made.model,
        number=made.number,
        state=made.state,
        contacts=made.contacts.take(np.zeros(0, np.int64)),
        contact_force=force,
        contact_status=made.contact_status[:0],
        overlap=None,
        rolling_moment=None,
        spinning_moment=None,
        law_variables={},
        result=SimpleNamespace(u=force.ravel()),
    )


def write_run(directory: Path, *, d: int = 3, steps: int = 20, every: int = 5, divisions: int = 8) -> FakeModel:
    """Write a run's folder as the runner does."""
    model = wall(d, divisions)
    series = SeriesWriter(directory / "vtk", model)
    rows = []
    rng = np.random.default_rng(3)
    for number in range(1, steps + 1):
        amplitude = number / steps
        if number % every == 0:
            series.write(step(model, number, steps, divisions))
        top = -SHEAR * amplitude
        reaction = 15972.6 * (1 - np.exp(-4 * amplitude))
        sliding = int(250 * amplitude**2)
        rows.append(
            {"step": number, "t": 0.5 * amplitude, "nc": 688, "active": int(688 - 90 * amplitude), "sliding": sliding}
            | {"sticking": int(688 - 90 * amplitude) - sliding, "status": "SOLVED", "iterations": int(rng.integers(2, 10))}
            | {"error": float(10 ** rng.uniform(-12, -8.2)), "seconds_detection": 0.008, "seconds_assembly": 0.035 + 0.01 * rng.random()}
            | {"seconds_solve": 0.03 * rng.integers(2, 10), "seconds_output": 0.012 if number % every == 0 else 0.001}
            | {"top_x": top, "bottom_Rx": reaction, "top_Rx": -reaction}
        )
    with (directory / "steps.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    description = {
        "case": "masonry_wall",
        "title": "Masonry wall under compression and shear",
        "parameters": {},
        "h": 1e-3,
        "tol": 1e-8,
        "plots": {
            "imposed": {"column": "top_x", "label": "imposed displacement", "unit": "m"},
            "reaction": [
                {"column": "bottom_Rx", "label": "horizontal reaction at the bottom", "unit": "N"},
                {"column": "top_Rx", "label": "horizontal reaction at the top", "unit": "N"},
            ],
            "bound": {"value": 15972.6, "label": "friction bound of the upper bed"},
        },
    }
    (directory / "run.json").write_text(json.dumps(description))
    return model


@pytest.fixture(scope="session")
def fake():
    """The makers of this file, for tests that need a model or a step of their own."""
    return SimpleNamespace(
        linked=None,
        wall=wall,
        step=step,
        without_contacts=without_contacts,
        write_run=write_run,
        brick=brick,
        model=FakeModel.of,
        displacement=displacement,
    )


@pytest.fixture(scope="session")
def run_directory(tmp_path_factory):
    """A small run (4 divisions a full block, 4 instants) that tests only read."""
    directory = tmp_path_factory.mktemp("run")
    write_run(directory, divisions=4)
    return directory


@pytest.fixture
def small_pictures(monkeypatch):
    """Pictures with a fifth of the width, for tests of which there are and what they do not warn of: pixels take most of the time."""
    from fcsim.view.scene import Scene

    monkeypatch.setattr("fcsim.view.pictures.Scene", partial(Scene, width=300))
