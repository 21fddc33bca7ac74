"""Arguments of sensors, pictures, masonry's and collections' functions that they cannot be: one line, no traceback, nothing done."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fcsim.masonry as masonry
from fcsim import Body, Everything, InputError, Material, Sensor, Simulation, Step, Support, Theta, build_model
from fcsim.collection import build_collection, choose, select_problems
from fcsim.mesh import brick, read_parts, rigid_body, rigid_box
from fcsim.mesh.solids.closed_surface import closed_surface
from fcsim.running import sensors
from fcsim.view import interactive, picture

NAN, HUGE = float("nan"), 10**400
NO_NUMBER: tuple[object, ...] = ("0.3", True, NAN, [], np.array([1.0, 2.0]), 1j, object(), HUGE)
NO_POINT: tuple[object, ...] = ("a", 1.0, (0, 0), (NAN, 0, 0), ("a", 0, 0), np.zeros((2, 2)), (1e300, 0, 0))
NO_VECTOR: tuple[object, ...] = (None, "x", 1.0, (), (0, 0), (NAN, 0, 0), ("a", 0, 0), [[0, 0, 1]], (float("inf"), 0, 0))
NO_PROBLEM: tuple[object, ...] = (None, 1, "wall.json", Path("wall.json"))


@cache
def _step() -> Step:
    floor = rigid_box("floor", size=(1, 1, 0.1), centre=(0, 0, -0.05), mass=1.0)
    block = Body("block", brick("b", (0.1,) * 3, (1,) * 3, Material(E=1e7, nu=0.2, density=1000.0)))
    held = Support("floor", ("x", "y", "z", "rx", "ry", "rz"))
    model = build_model([floor, block], supports=[held], gravity=lambda t: (0.0, 0.0, -10.0))
    (step,) = Simulation(model, Everything(model, 0.3), Theta(1e-3), 1)
    return step


def _box(name: str, low: tuple[float, ...], high: tuple[float, ...]) -> Any:
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    return closed_surface(name, [[(high if c else low)[k] for k, c in enumerate(corner)] for corner in corners], faces)


@cache
def _stone(mu: Any = 0.3) -> masonry.MasonryProblem:
    floor = masonry.Block(_box("floor", (-1, -1, -1), (2, 2, 0)), support=True)
    stone = masonry.Block(_box("stone", (0, 0, 0), (0.4, 0.4, 0.4)), density=2000.0)
    return masonry.pushed(masonry.MasonryProblem("stone", 3, (floor, stone), mu), (1.0, 0.0, 0.0))


def _problem(**more: Any) -> None:
    masonry.MasonryProblem(**{"name": "a", "dimension": 3, "blocks": _stone().blocks, "mu": 0.3, **more})


REFUSED: dict[str, tuple[Callable[[Any], object], tuple[object, ...]]] = {
    "rigid_body": (rigid_body, (None, "block", brick("b", (1, 1, 1), (1, 1, 1), Material(1e9, 0.2, 1.0)))),
    "read_parts.materials": (lambda v: read_parts("a.msh", v), (None, Material(1e9, 0.2, 1.0), [1.0], "steel")),
    "build_model.supports": (lambda v: build_model(_step().model.bodies, supports=v), (None, Support("floor", ("x",)), 1.0)),
    "build_model.loads": (lambda v: build_model(_step().model.bodies, loads=v), (None, 1.0)),
    "Simulation.detector": (lambda v: Simulation(_step().model, v, Theta(1e-3), 1), (None, Everything, 0.3, "all")),
    "contact_force_on": (lambda v: _step().contact_force_on(v), (None, "nobody", 99, -1, 0.5)),
    "Sensor.column": (lambda v: Sensor(v, "l", "m", lambda s: 0.0), (None, 1, "", "a,b", "a\nb", [])),
    "Sensor.measure": (lambda v: Sensor("c", "l", "m", v), (None, 1, "f")),
    "displacement.point": (lambda v: sensors.displacement("c", _step().model, "block", "z", v), NO_POINT),
    "stress.point": (lambda v: sensors.stress("c", _step().model, "block", "xx", v), NO_POINT),
    "support_moment.point": (lambda v: sensors.support_moment("c", _step().model, "floor", "rz", v), NO_POINT[:-1]),
    "joint_opening.first": (
        lambda v: sensors.joint_opening("c", _step().model, v, ("floor", "z+")),
        (None, 1, "block", ("block",), ("block", "z-", "x"), ("block", "none")),
    ),
    "picture.exaggeration": (lambda v: picture(_step(), exaggeration=v), (*NO_NUMBER, 0.0)),
    "interactive.exaggeration": (lambda v: interactive(_step(), exaggeration=v), (*NO_NUMBER, -1.0)),
    "pushed.direction": (lambda v: masonry.pushed(_stone(), v), (*NO_VECTOR, (0, 0, 0))),
    "tilted.direction": (lambda v: masonry.tilted(_stone(), v), (*NO_VECTOR, (0, 0, 1))),
    "shaken.direction": (lambda v: masonry.shaken(_stone(), v, lambda t: 0.0), (*NO_VECTOR, (0, 0, 0))),  # type: ignore[arg-type]
    "shaken.record": (lambda v: masonry.shaken(_stone(), (1.0, 0.0, 0.0), v), (None, 1, "x")),
    "friction_factor": (lambda v: masonry.friction_factor(masonry.limit_problem(_stone()), v), (*NO_NUMBER, None, -1.0)),
    "support_forces": (lambda v: masonry.support_forces(masonry.limit_problem(_stone()), v), (*NO_NUMBER, None)),
    "bracket.low": (lambda v: masonry.bracket(_stone(), v, 1.0), (*NO_NUMBER, None)),
    "bracket.high": (lambda v: masonry.bracket(_stone(), 0.1, v), (*NO_NUMBER, None)),
    "bracket.resolution": (lambda v: masonry.bracket(_stone(), 0.1, 0.5, resolution=v), (*NO_NUMBER, None, 0.0)),
    "trial.duration": (lambda v: masonry.trial(_stone(), 0.1, duration=v, steps=2), (*NO_NUMBER, None, 0.0)),
    "trial.steps": (lambda v: masonry.trial(_stone(), 0.1, duration=0.01, steps=v), (*NO_NUMBER[:-1], None, 0, 2.5)),
    "settle.movements": (lambda v: masonry.settle(_stone(), v, steps=1), (None, 1, "a", [1], [])),
    "Movement.displacement": (lambda v: masonry.Movement("floor", v), NO_VECTOR),
    "Movement.about": (lambda v: masonry.Movement("floor", about=v), NO_VECTOR[1:]),
    "shake.duration": (lambda v: masonry.shake(_stone(), duration=v), (*NO_NUMBER[:1], *NO_NUMBER[2:], 0.0)),
    "push_by_displacement.step": (lambda v: masonry.push_by_displacement(_stone(), step=v), (*NO_NUMBER, 0.0)),
    "Stone.E": (lambda v: masonry.Stone(E=v), (*NO_NUMBER, None, 0.0)),
    "Stone.nu": (lambda v: masonry.Stone(nu=v), (*NO_NUMBER, None, 0.5)),
    "Stone.cells": (lambda v: masonry.Stone(cells=v), (*NO_NUMBER, None, 0.0)),
    "Stone.beta": (lambda v: masonry.Stone(beta=v), (*NO_NUMBER, None, -1.0)),
    "Block.surface": (lambda v: masonry.Block(v, density=1.0), (None, 1, "x")),
    "Block.density": (lambda v: masonry.Block(_stone().blocks[1].surface, density=v), (*NO_NUMBER, 0.0)),
    "MasonryProblem.mu": (lambda v: _problem(mu=v), (*NO_NUMBER, None, -1.0)),
    "MasonryProblem.blocks": (lambda v: _problem(blocks=v), (None, 1, "x", (1,))),
    "MasonryProblem.loads": (lambda v: _problem(loads=v), (None, 1, "x", (1,))),
    "Acceleration": (lambda v: _problem(loads=(masonry.Acceleration(v),)), NO_VECTOR[1:]),
    "PointForce.point": (lambda v: _problem(loads=(masonry.PointForce("stone", (1, 0, 0), v),)), NO_VECTOR[1:]),
    "choose.count": (lambda v: choose(np.array([1, 2, 3]), np.ones(3, dtype=bool), v), (None, "1", -1, 2.5, NAN, True)),
    "analyse.problem": (masonry.analyse, NO_PROBLEM),
    "structure.problem": (masonry.structure, NO_PROBLEM),
    "bracket.problem": (lambda v: masonry.bracket(v, 0.1, 0.5), NO_PROBLEM),
    "settle.problem": (lambda v: masonry.settle(v, [masonry.Movement("floor", (0.0, 0.0, -0.1))]), NO_PROBLEM),
    "shake.problem": (masonry.shake, NO_PROBLEM),
    "push_by_displacement.problem": (masonry.push_by_displacement, NO_PROBLEM),
    "pushed.problem": (lambda v: masonry.pushed(v, (1.0, 0.0, 0.0)), NO_PROBLEM),
    "shaken.problem": (lambda v: masonry.shaken(v, (1.0, 0.0, 0.0), lambda t: 0.0), NO_PROBLEM),
    "write_masonry.problem": (lambda v: masonry.write_masonry("a.json", v), NO_PROBLEM),
    "choose.seed": (lambda v: choose(np.array([1, 2, 3]), np.ones(3, dtype=bool), 2, v), (None, "1", -1, 2.5, NAN)),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_function_does_not_take_is_refused_in_one_line(name: str) -> None:
    made, values = REFUSED[name]
    for value in values:
        with pytest.raises(InputError) as refused:
            made(value)
        assert "\n" not in str(refused.value)
        assert "expected" in str(refused.value)


WRITTEN: dict[str, tuple[object, ...]] = {
    "every": ("1", None, NAN, 2.5, 0, True),
    "spectrum_up_to": ("1", None, NAN, 2.5, -1),
    "iterations": ("yes", None, 1),
    "overwrite": ("no", None, 0),
    "authors": (None, 1),
    "assignments": (1, "steps=1", {1: "1"}, {"steps": 1}),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_what_a_collection_is_not_built_of_leaves_no_folder(tmp_path: Path, name: str) -> None:
    """overwrite="no" was true, and replaced the collection."""
    for value in WRITTEN[name]:
        with pytest.raises(InputError, match=name):
            build_collection("stack", tmp_path / "out", **{name: value})  # type: ignore[arg-type]
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("count", ("1", None, NAN, 2.5, 0)),
        ("tol", ("1", None, NAN, 0.0)),
        ("time_limit", ("1", None, NAN, 0.0)),
        ("seed", ("1", None, NAN, -1, 2.5)),
        ("overwrite", ("no", None)),
    ],
)
def test_what_a_selection_is_not_made_by_leaves_no_folder(tmp_path: Path, name: str, values: tuple[object, ...]) -> None:
    (tmp_path / "from").mkdir()
    for value in values:
        with pytest.raises(InputError, match=name.replace("_", " ")):
            select_problems(tmp_path / "from", tmp_path / "out", **{name: value})  # type: ignore[arg-type]
    assert not (tmp_path / "out").exists()
