"""A newcomer's mistakes are named as a run begins, each with its mend, in any units; what is meant is not called a mistake."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Velocity
from fcsim.errors import InputError
from fcsim.linkage import Ball, Hinge, Linkage, without_contact_of
from fcsim.mesh.blocks import brick, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.running.case import load_case
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.remarks.over_time.undersampled import undersampled
from fcsim.timestep.remarks.unlikely import restitution_of_points
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.theta import Theta

CASES = Path(__file__).parents[3] / "cases"
ALL = ("x", "y", "z", "rx", "ry", "rz")


def pile(
    unit: float = 1.0,
    gravity: float = -9.81,
    density: float = 2000.0,
    E: float = 1e9,
    h: float = 1e-3,
    pairs: tuple[tuple[str, str], ...] = (("one", "base"), ("two", "one")),
    scheme: Any = None,
    floor: float | None = None,
) -> tuple[str, ...]:
    """What is said of two blocks, one on the other, on a held base; lengths are in `unit`s."""
    part = brick("brick", (0.2 * unit, 0.1 * unit, 0.1 * unit), (1, 1, 1), Material(E, 0.2, density))
    base = rigid_box("base", (unit, unit, 0.1 * unit), (0.1 * unit, 0.05 * unit, -0.05 * unit), 100.0)
    bodies = [Body("one", part), Body("two", part, translation=[0.03 * unit, 0.02 * unit, 0.1 * unit]), base]  # type: ignore[arg-type]
    model = build_model(bodies, supports=[Support("base", ALL)], gravity=lambda t: (0.0, 0.0, gravity))
    rules = [
        SurfacePair(contact_surface(model, [(a, "z-")]), contact_surface(model, [(b, "z+")]), 0.5, 2e-3 * unit, "nodes", f"{a} on {b}")
        for a, b in pairs
    ]
    simulation = Simulation(model, Detector(rules, model.n_nodes), scheme or Theta(h), 10, SolverSettings(floor=floor))
    return simulation._opening(at_rest(model, h=h))


@pytest.mark.parametrize(
    "right",
    [
        {},
        {"unit": 1e3, "gravity": -9810.0, "density": 2e-9, "E": 1e3},  # mm, t, s
        {"unit": 1e3, "gravity": -9810.0, "density": 2e-6, "E": 1e6},  # mm, kg, s
        {"unit": 100.0},  # a dam of blocks 10 m thick
        {"gravity": 0.0, "h": 1.0},
        {"scheme": QuasiStatic(1.0, eta=1e-6), "h": 1.0},
    ],
)
def test_nothing_is_said_of_what_is_right(right: dict[str, Any]) -> None:
    assert pile(**right) == ()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"unit": 1e3}, "bodies are 100 m thick.*are lengths in millimetres?"),
        ({"unit": 1e3, "density": 2e-9, "E": 1e3}, "densities are 2e-09, as in tonnes per mm.3: .* gravity is 9810 mm/s"),
        ({"gravity": -9810.0}, "gravity is 9810, as in mm/s.2, and densities are 2e.03, as in kg/m.3"),
        ({"density": 2e6}, "more than of any solid"),
        (
            {"gravity": 9.81},
            r"gravity is \[0.0, 0.0, 9.81\], along \+z, .*: free bodies rise. .* negative, -9.81",
        ),
        ({"h": 0.2}, "in one step of h = 0.2 s a body falls by 0.392 m, and the thinnest is 0.1 m thick: choose h below 0.01 s"),
        ({"unit": 1e-3, "h": 0.01}, "in one step of h = 0.01 s a body falls by"),
        ({"pairs": (("one", "base"),)}, "body 'two': no support holds it and no pair of surfaces names it"),
        (
            {"pairs": (("two", "base"), ("one", "base"))},
            "bodies 'one' and 'two' touch, and no pair .* names them both: .* Everything",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_mend(wrong: dict[str, Any], said: str) -> None:
    found = [remark for remark in pile(**wrong) if "finds no contact" not in remark]
    assert found
    assert any(re.search(said, remark) for remark in found), found


def test_the_mass_of_a_held_floor_is_no_density() -> None:
    """A cube of 10 um on a floor that was given the mass 1 kg, which would be one of 3e16 kg/m^3."""
    part = brick("cube", (1e-5,) * 3, (1, 1, 1), Material(1e9, 0.2, 2000.0))
    floor = rigid_box("floor", (4e-5, 4e-5, 2e-8), (0.0, 0.0, -1e-8), 1.0)
    model = build_model([Body("cube", part), floor], supports=[Support("floor", ALL)], gravity=(0.0, 0.0, -9.81))
    simulation = Simulation(model, Everything(model, 0.5), Theta(1e-6), 1)
    assert not any("densities" in remark for remark in simulation._opening(at_rest(model, h=1e-6)))


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_in_the_plane(unit: float) -> None:
    bodies = [
        rigid_rectangle("floor", (2 * unit, 0.2 * unit), (0, -0.1 * unit), 1.0),
        rigid_rectangle("block", (unit, unit), (0, 0.5 * unit), 1.0),
        rigid_rectangle("other", (unit, unit), (0.2 * unit, 1.5 * unit), 1.0),
    ]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: (0.0, 9.81 * unit))
    pair = SurfacePair(contact_surface(model, [("block", "y-")]), contact_surface(model, [("floor", "y+")]), 0.5, 1e-3 * unit)
    found = " ".join(Simulation(model, Detector([pair], model.n_nodes), Theta(1e-3), 3)._opening(at_rest(model, h=1e-3)))
    for said in ("along +y", "body 'other': no support", "bodies 'block' and 'other' touch"):
        assert said in found
    everything = Simulation(model, Everything(model, 0.5), Theta(1e-3), 3)._opening(at_rest(model, h=1e-3))
    assert len(everything) == 1 and "along +y" in everything[0]


@pytest.mark.parametrize("name", ["stack", "arch", "masonry_wall", "impact_bar", "boxes", "slider_crank", "wall_hit", "hertz"])
def test_no_false_alarm_of_a_case(name: str) -> None:
    script = load_case(CASES / name)
    simulation = script.build(script.parameters()).simulation
    assert simulation._opening(simulation.initial or at_rest(simulation.model, h=simulation.scheme.h)) == ()


def test_it_is_shown_once_by_the_run() -> None:
    model = build_model([rigid_box("a", (1, 1, 1), (0, 0, 2), 1.0), rigid_box("floor", (4, 4, 1), (0, 0, 0), 1.0)],
                        supports=[Support("floor", ALL)], gravity=lambda t: (0, 0, 9.81))  # fmt: skip
    steps = list(Simulation(model, Everything(model, 0.3), Theta(1e-2), 3))
    assert ["free bodies rise" in " ".join(step.remarks) for step in steps] == [True, False, False]


def test_a_floor_of_errors_beside_which_bodies_are_small() -> None:
    """1e-3 is m/s in dynamics and m in statics: blocks of micrometres would be at rest up to "round-off" whatever they do."""
    statics = QuasiStatic(1.0, eta=1e-6)
    said = pile(unit=1e-5, gravity=0.0, scheme=statics, floor=1e-3)
    assert len(said) == 1 and re.search(
        r"at least 0.001 m a step .*floor = 0.001 m\), and the smallest body is 2e-06 m: leave floor", said[0]
    )
    assert pile(unit=1e-5, gravity=0.0, scheme=statics) == pile(unit=1e-5, gravity=0.0, h=1e-6, floor=1e-3) == ()


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_steps_so_short_that_round_off_hides_a_fall(unit: float) -> None:
    """g h^2 = 1e-15 m of a base of 1 m, whose gaps are known to 4 eps = 9e-16 m."""
    said = pile(unit=unit, gravity=-10.0 * unit, h=1e-8)
    (hidden,) = (line for line in said if "a body at rest falls by" in line)
    assert "known to 89 %" in hidden and ("1e-15 m" if unit == 1.0 else "1e-12 m") in hidden
    assert not any("a body at rest falls by" in line for line in pile(unit=unit, gravity=-10.0 * unit, h=1e-6))


@pytest.mark.parametrize(("change", "message"), [(lambda v: v * np.nan, "got NaN"), (lambda v: v[:-1], r"\(12,\), got shape \(11,\)")])
def test_an_initial_state_that_is_none_of_the_model_is_refused(change: Any, message: str) -> None:
    model = build_model([rigid_box(name, (1, 1, 1), (0, 0, k), 1.0) for k, name in enumerate("ab")])
    start = at_rest(model)
    with pytest.raises(InputError, match=message):
        Simulation(model, Everything(model, 0.3), Theta(1e-2), 3, initial=replace(start, v=change(start.v)))


@pytest.mark.parametrize("pins", [1, 2])
def test_pins_where_bodies_touch(pins: int) -> None:
    """Two pins at the corners of a block on another one: they and contact may press on each other by 4e8 N where it weighs 1e4."""
    bodies = [rigid_rectangle("lower", (1.0, 1.0), (0, 0.5), 1e3), rigid_rectangle("upper", (1.0, 1.0), (0, 1.5), 1e3)]
    model = build_model(bodies, supports=[Support("lower", ("x", "y", "rz"))], gravity=lambda t: (0, -9.81))
    linkage = Linkage(model, [Ball(f"pin {x}", "lower", "upper", (x, 1.0)) for x in (-0.5, 0.5)[:pins]])
    detector = Everything(model, 0.5)
    found = [
        Simulation(model, one, Theta(1e-3), 1, linkage=linkage)
        for one in (detector, without_contact_of(detector, model, [("lower", "upper")]))
    ]
    said = ["which part of a force there is contact's" in " ".join(next(iter(run)).remarks) for run in found]
    assert said == [pins == 2, False]


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_a_joint_that_contact_locks(unit: float) -> None:
    """Two rods hinged end to end touch across their whole ends, which keeps them straight; hinged at the edge on one side they open."""
    rods = [rigid_rectangle(name, (unit, 0.05 * unit), (x * unit, 0.0), 1.0) for name, x in (("one", 0.5), ("two", 1.5))]
    model = build_model(rods, gravity=lambda t: (0.0, -9.81 * unit))

    def said(at: float, detection: Any = None) -> list[str]:
        joints = [Ball("pin", "one", None, (0.0, 0.0)), Ball("knee", "one", "two", (unit, at * unit))]
        simulation = Simulation(model, detection or Everything(model, mu=0.0), Theta(1e-3), 1, linkage=Linkage(model, joints))
        return [text for text in simulation._opening(at_rest(model)) if "keeps them from turning" in text]

    (text,) = said(0.0)
    assert "link 'knee'" in text and "without_contact_of(detector, model, [('one', 'two')])" in text
    assert not said(0.025)
    assert not said(0.0, without_contact_of(Everything(model, mu=0.0), model, [("one", "two")]))


def test_a_hinge_in_space_that_contact_locks() -> None:
    boxes = [rigid_box(name, (1.0, 0.1, 0.1), (x, 0.0, 0.0), 1.0) for name, x in (("one", 0.5), ("two", 1.5))]
    model = build_model(boxes)

    def said(joint: Any) -> bool:
        simulation = Simulation(model, Everything(model, mu=0.0), Theta(1e-3), 1, linkage=Linkage(model, [joint]))
        return any("keeps them from turning" in text for text in simulation._opening(at_rest(model)))

    assert said(Hinge("knee", "one", "two", ((1.0, -0.1, 0.0), (1.0, 0.1, 0.0))))
    assert not said(Hinge("knee", "one", "two", ((1.0, -0.1, 0.05), (1.0, 0.1, 0.05))))
    assert not said(Hinge("along", "one", "two", ((0.9, 0.0, 0.0), (1.1, 0.0, 0.0))))  # the axis of both
    assert said(Ball("ball", "one", "two", (1.0, 0.0, 0.0)))
    assert said(Ball("ball", "one", "two", (1.0, 0.0, 0.05)))  # opens upwards, but not to the side


@pytest.mark.each_value
@pytest.mark.parametrize(("steps_a_period", "named"), [(0.5, True), (1.0, True), (2.0, True), (5.0, False), (20.0, False)])
@pytest.mark.parametrize("what", ["gravity", "traction", "velocity", "displacement", "rotation"])
def test_what_goes_up_and_down_within_steps(what: str, steps_a_period: float, named: bool) -> None:
    """Sampled at its steps a sine of one or two steps a period is no motion; switches, pulses and what grows are none."""
    h, held = 0.01, [Support("base", ("y", "z", "ry", "rz"))]

    def swings(t: float) -> float:
        return float(np.sin(2 * np.pi * t / (steps_a_period * h)))

    functions = {
        "wave": swings,
        "switch": lambda t: float(t > 0.2 * h),
        "pulse": lambda t: np.exp(-((t / h - 5.3) ** 2)),
        "grows": lambda t: t**2,
    }
    for name, f in functions.items():
        gravity = (lambda t, f=f: (0.0, 0.0, -f(t))) if what == "gravity" else None
        loads = [Traction("block", "x+", (1.0, 0.0, 0.0), factor=f)] if what == "traction" else []
        given: dict[str, Any] = {what: f} if what in ("velocity", "displacement") else {}
        supports = (
            [*held, Support("base", ("x", "rx"), **given)] if what != "rotation" else [DrivenRotation("base", f, (0, 0, 0), (0, 0, 1))]
        )
        if what == "rotation" and name == "pulse":
            continue  # an angle begins at 0
        block = Body("block", brick("block", (0.2, 0.1, 0.1), (1, 1, 1), Material(1e9, 0.2, 2000.0)))
        base = rigid_box("base", (1.0, 1.0, 0.1), (0.1, 0.05, -0.05), 100.0)
        model = build_model([block, base], supports=supports, loads=loads, gravity=gravity)
        found = [text for text in undersampled(model, Theta(h), 0.0, 20) if "goes up and down within steps" in text]
        assert len(found) == (name == "wave" and named)
        assert not list(undersampled(model, QuasiStatic(h), 0.0, 20))


@pytest.mark.parametrize(("E", "h", "e", "held", "named"), [
    (1e7, 1e-3, 0.8, False, True),
    (1e7, 1e-5, 0.8, False, True),
    (1e7, 1e-3, 0.0, False, False),
    (1e10, 1e-3, 0.8, False, False),
    (1e7, 1e-3, 0.8, True, False),
])  # fmt: skip
def test_restitution_of_bodies_that_swing(E: float, h: float, e: float, held: bool, named: bool) -> None:
    """A block of 0.1 m, through which sound takes 1 ms or 0.03 ms."""
    block = Body("block", brick("block", (0.1, 0.1, 0.1), (1, 1, 1), Material(E, 0.2, 1000.0)))
    base = rigid_box("base", (1.0, 1.0, 0.1), (0.05, 0.05, -0.05), 1.0)
    supports = [Support("base", ALL), *([Support("block", ("x",), "x-")] if held else [])]
    found = list(restitution_of_points(build_model([block, base], supports=supports), Theta(h, law=Velocity(e))))
    assert len(found) == named
    assert not named or "of body 'block', through which sound takes 0.001" in found[0]


def test_velocities_that_statics_do_not_use_are_named() -> None:
    """Not those of driven supports, of a run in motion, or of what an earlier run of statics has moved."""
    bodies = [rigid_box("box", (1, 1, 1), (0, 0, 0.5), 1.0), rigid_box("base", (3, 3, 1), (0, 0, -0.5), 1.0)]
    model = build_model(bodies, supports=[Support("base", ALL[1:]), Support("base", ("x",), velocity=0.1)])
    start, moved = at_rest(model), at_rest(model)
    start.v[model.dof_offset[model.number["box"]] + 2] = moved.v[0] = 2.0
    moved.x[0] = 1e-3
    for scheme, state, named in (
        (QuasiStatic(1.0, 1.0), start, True),
        (QuasiStatic(1.0, 1.0), at_rest(model), False),
        (QuasiStatic(1.0, 1.0), moved, False),
        (Theta(1.0), start, False),
    ):
        said = [r for r in Simulation(model, Everything(model, 0.5), scheme, 1)._opening(state) if "initial velocities" in r]
        assert len(said) == named
        assert all("'box' up to 2 m/s" in r for r in said)
