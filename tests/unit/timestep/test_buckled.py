"""What statics say of bodies that would buckle: Euler's loads of columns, and equilibria that bodies of finite strain would leave."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim import Body, Everything, Force, QuasiStatic, Simulation, Step, Support, Theta, Traction, build_model
from fcsim.assembly.kinematics.prestress import Prestress
from fcsim.assembly.model import Model
from fcsim.mesh import brick, rectangle, rigid_rectangle
from fcsim.mesh.material import Material, Thermal, neo_hooke, saint_venant_kirchhoff

E, L, B = 1e9, 1.0, 0.05
I = B**3 / 12
EULER = np.pi**2 * E * I / L**2
"""Of a column of length L between hinges, a unit thick."""


def said(steps: Iterable[Step]) -> list[str]:
    return [text for step in steps for text in step.remarks if "buckles" in text]


def column(law: Any, share: float, steps: int = 1, across: float = 0.0, elements: str = "Q2") -> list[Step]:
    """Clamped at its foot, pressed by `share` of its load pi^2 E I / (4 L^2), with a part of that across."""
    force = share * EULER / 4
    part = rectangle("column", (B, L), (1, 10), law, elements=elements)
    load = Force("column", (across * force, -force), surface="y+", factor=lambda t: t)
    model = build_model([Body("column", part)], supports=[Support("column", ("x", "y"), "y-")], loads=[load])
    return list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(1 / steps), steps, witness=None))


def share_of(model: Model, x: np.ndarray) -> float:
    prestress = Prestress(model.groups[0])
    return prestress.share(prestress.stress(x[: model.n_elastic].reshape(-1, model.dimension)), 1e-3)


@pytest.mark.parametrize("elements", ["Q2", "Q1-enhanced"])
@pytest.mark.parametrize("share", [0.03, 0.5, 2.0])
def test_a_cantilever_column(elements: str, share: float) -> None:
    """L. Euler: pi^2 E I / (4 L^2)."""
    steps = column(Material(E, 0.0, 1000.0), share, elements=elements)
    assert_allclose(share_of(steps[-1].model, steps[-1].state.x), share, rtol=0.01)
    if share < 0.05:
        assert not said(steps)
    else:
        (text,) = said(steps)
        assert ("50 % of what buckles it" if share < 1 else "times as much as what buckles it") in text


def test_what_is_said_first_is_not_all() -> None:
    """The load grows: near to buckling is said, and beyond it again; drawn it says nothing."""
    first, second = said(column(Material(E, 0.0, 1000.0), 2.0, 4, across=1e-3))
    assert "50 % of what buckles" in first
    assert "2 times as much" in second
    assert not said(column(Material(E, 0.0, 1000.0), -2.0))


def test_drawn_it_is_held_straight() -> None:
    """Of w = (Q / T) (L - tanh(k L) / k), k^2 = T / (E I), at the end of a cantilever that T draws: 2 / 5 T L^2 / (E I), to first order."""
    *_, last = column(Material(E, 0.0, 1000.0), -0.4, across=1e-2)
    prestress, x = Prestress(last.model.groups[0]), last.state.x[: last.model.n_elastic].reshape(-1, 2)
    assert_allclose(prestress.straightened(prestress.stress(x), x), 0.4 * 0.4 * np.pi**2 / 4, rtol=0.02)
    (text,) = last.remarks[-1:]
    assert "the tension in body 'column' holds it straight, so that what bends it across is too large by some 39 %" in text


def test_a_rail_that_warms() -> None:
    """Clamped at both ends: alpha dT = (2 pi)^2 I / (A L^2) buckles it, 2 % less as it shears; half of that, turned by 30 degrees."""
    warms = 0.5 * 4 * np.pi**2 * I / (B * L**2)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    law = Thermal(Material(E, 0.0, 1000.0), 1e-5, lambda X, t: np.full(len(X), warms / 1e-5 * t))
    rail = Body("rail", rectangle("rail", (L, B), (20, 1), law, elements="Q2"), np.array([[c, -s], [s, c]]), kinematics="linear")
    model = build_model([rail], supports=[Support("rail", ("x", "y"), side) for side in ("x-", "x+")])
    first, *others = Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.25), 4, witness=None)
    assert "is 13 % of what buckles it" in said([first])[0]
    assert not said(others)
    (only,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1, witness=None)
    assert "is 51 % of what buckles it" in said([only])[0]


def test_in_dynamics_where_it_hardly_moves() -> None:
    """Implicit Euler in steps of hundreds of periods is statics; a column that is struck swings, and nothing is said."""
    part = rectangle("column", (B, L), (1, 10), Material(E, 0.0, 1000.0), elements="Q2")
    load = Force("column", (0.0, -0.5 * EULER), surface="y+", factor=lambda t: min(1.0, t / 4))
    model = build_model([Body("column", part)], supports=[Support("column", ("x", "y"), "y-")], loads=[load])
    slow, fast = (list(Simulation(model, Everything(model, mu=0.0), Theta(h, 1.0), 8, witness=None)) for h in (1.0, 1e-5))
    assert "times as much as what buckles it" in said(slow)[-1]
    assert not said(fast)


@pytest.mark.parametrize(("mu", "times"), [(0.0, 1.0), (1.0, 4.0)])
def test_contacts_do_not_give_way(mu: float, times: float) -> None:
    """A plate on its flat end lets it slide, not turn: pi^2 E I / L^2; with friction that sticks it is clamped: four times that."""
    part = rectangle("column", (B, L), (1, 20), Material(E, 0.0, 1000.0), elements="Q2")
    plate = rigid_rectangle("plate", (0.3, 0.1), (B / 2, L + 0.05), 1.0)
    supports = [
        Support("column", ("x", "y"), "y-"),
        Support("plate", ("x", "rz")),
        Support("plate", ("y",), displacement=lambda t: -0.8 * t * EULER / (E * B)),
    ]
    model = build_model([Body("column", part), plate], supports=supports)
    steps = list(Simulation(model, Everything(model, mu=mu), QuasiStatic(1.0), 1))
    (text,) = said(steps)
    assert f"is {80 / times:.2g} % of what buckles it" in text


def test_oblique_in_space() -> None:
    """About the weak axis pi^2 E I / (4 L^2) with the smaller I; held there along its own axes, with the larger one: a quarter."""
    R = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
    part = brick("column", (B, 2 * B, L), (1, 2, 10), Material(E, 0.0, 1000.0), elements="Q1-enhanced")
    load = Force("column", tuple(R @ [0.0, 0.0, -0.5 * EULER / 4 * 2 * B]), surface="z+")
    foot = Support("column", ("x", "y", "z"), "z-", axes=R)
    for more, share in (((), 0.5), ((Support("column", ("x",), "x-", axes=R),), 0.125)):
        model = build_model([Body("column", part, rotation=R)], supports=[foot, *more], loads=[load])
        steps = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1, witness=None))
        assert len(said(steps)) == 1
        # in bending the thick column gives way to shear, too: 2.5 (2 B / L)^2 / 4 of the load
        assert_allclose(share_of(model, steps[-1].state.x), share, rtol=0.02)


@pytest.mark.parametrize(("nu", "elements"), [(0.2, "Q1"), (0.499999, "Q2")])
def test_a_block_that_is_pressed_hard_is_no_column(nu: float, elements: str) -> None:
    """Strained by 2 %, as high as wide; one that keeps its volume bears the pressure that holds it, a thousand times its stiffness."""
    part = rectangle("block", (1.0, 1.0), (4, 4), Material(E, nu, 1000.0), elements=elements)
    supports = [Support("block", ("x", "y"), "y-"), Support("block", ("y",), "y+", velocity=-0.02)]
    model = build_model([Body("block", part)], supports=supports)
    steps = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1, witness=None))
    assert steps[-1].state.x.min() < -0.019
    assert not said(steps)


def test_a_straight_column_of_finite_strain() -> None:
    """It stays straight beyond its load, where the least push would bend it: said there, and not of one that has bent."""
    law = saint_venant_kirchhoff(E, 0.0, 1000.0)
    steps = column(law, 1.2, 3)
    assert np.abs(steps[-1].state.x.reshape(-1, 2)[:, 0]).max() < 1e-9
    (text,) = said(steps)
    assert text.startswith("step 3")
    assert "an equilibrium that it would leave" in text
    assert not said(column(law, 0.9, 3))
    assert not said(column(law, 1.2, 6, across=1e-2))


def test_rubber_that_contacts_hold_in_shape() -> None:
    """Pressed to 0.8 between smooth plates it has lost its own stiffness, but cannot leave."""
    rubber = rectangle("rubber", (1.0, 1.0), (4, 4), neo_hooke(3.0, 0.4995, 1.0), elements="Q2")
    plates = [rigid_rectangle(name, (6.0, 0.5), (0.5, y), 1.0) for name, y in (("plate", 1.25), ("floor", -0.25))]
    supports = [
        Support("rubber", ("x",), "x-"),
        Support("rubber", ("y",), at=(0.0, 0.0)),
        Support("floor", ("x", "y", "rz")),
        Support("plate", ("x", "rz")),
        Support("plate", ("y",), displacement=lambda t: -0.2 * t),
    ]
    model = build_model([Body("rubber", rubber), *plates], supports=supports)
    steps = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.5), 2))
    assert steps[-1].linearised[-1].stiffened > 0
    assert not said(steps)


def test_a_cube_of_rubber_drawn_on_all_faces() -> None:
    """R. S. Rivlin (1948): under dead loads alike on all faces a cube of neo-Hooke's rubber would leave its shape from 2 mu on."""
    cube = brick("cube", (1.0, 1.0, 1.0), (1, 1, 1), neo_hooke(3.0, 0.4995, 1.0), elements="Q1-bbar")
    supports = [Support("cube", (axis,), f"{axis}-") for axis in "xyz"]
    loads = [Traction("cube", f"{axis}+", tuple(2.3 * np.eye(3)[k]), factor=lambda t: t) for k, axis in enumerate("xyz")]
    model = build_model([Body("cube", cube)], supports=supports, loads=loads)
    first, second = list(Simulation(model, Everything(model, mu=0.0), QuasiStatic(0.5), 2, witness=None))
    assert not said([first])
    (text,) = said([second])
    assert "softens" in text


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_body_that_supports_drive_at_every_node(dimension: int) -> None:
    """A single cell, stretched by 1e-4 while its sides are held: Hooke's law for the force; nothing is left that could buckle."""
    material = Material(E, 0.3, 1000.0)
    cell = rectangle("cell", (1, 1), (1, 1), material) if dimension == 2 else brick("cell", (1, 1, 1), (1, 1, 1), material)
    *sides, up = ("x", "y", "z")[:dimension]
    drawn = Support("cell", (up,), f"{up}+", velocity=1e-4)
    model = build_model([Body("cell", cell)], supports=[Support("cell", tuple(sides)), Support("cell", (up,), f"{up}-"), drawn])
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0), 1)
    assert_allclose(step.support_force(drawn)[-1], 1e-4 * E * 0.7 / 1.3 / 0.4, rtol=1e-9)
