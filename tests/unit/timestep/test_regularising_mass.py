"""What the mass that regularises statics is not: a force of supports, nor of a rigid body that is squeezed; and what it has to be."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import (
    Ball,
    Body,
    Control,
    Everything,
    ExactContacts,
    Linkage,
    Material,
    QuasiStatic,
    RigidBody,
    Simulation,
    Step,
    Support,
    Traction,
    build_model,
)
from fcsim.assembly.model import Model
from fcsim.errors import NotConverged
from fcsim.mesh import brick, rectangle, rigid_rectangle, rigid_sphere, with_surface
from fcsim.mesh.material import neo_hooke
from fcsim.mesh.material.by_region import AnyMaterial
from fcsim.mesh.material.plastic import FinitePlastic
from fcsim.timestep.regularisation.doubts import doubts

STEEL = FinitePlastic(2e11, 0.3, 7800.0, 2e8)
SOFT = Material(E=1e6, nu=0.0, density=1000.0)


@pytest.mark.parametrize("by", ["plates", "supports", "both sides"])
def test_what_the_mass_carries_of_a_bar_that_two_sides_press_is_a_share_of_what_passes_through_it(by: str) -> None:
    """A bar of length L pressed from above: E u'' = R rho u with R = eta / h^2, so that its foot has 1 / cosh(L sqrt(R rho / E)) of what
    its top has; of one pressed by both sides alike the middle has that, of half the length. What lacks is named from 0.02 on."""
    pace = {"plates": 0.0, "supports": 0.0, "both sides": 1e-4}[by]
    down, up = partial(Support, displacement=lambda t: -1e-4 * t), partial(Support, displacement=lambda t: pace * t)
    bodies: list[Body | RigidBody] = [Body("bar", rectangle("bar", (0.1, 0.1), (1, 8), SOFT, origin=(-0.05, 0.0)))]
    supports = [down("bar", ("y",), "y+"), up("bar", ("y",), "y-"), Support("bar", ("x",), at=(-0.05, 0.0))]
    if by != "supports":
        bodies += [rigid_rectangle("floor", (1.0, 0.1), (0.0, -0.05), 1.0), rigid_rectangle("plate", (1.0, 0.1), (0.0, 0.15), 1.0)]
        still = [Support(name, ("x", "rz")) for name in ("floor", "plate")]
        supports = [down("plate", ("y",)), up("floor", ("y",)), supports[2], *still]
    model = build_model(bodies, supports=supports)
    for share, said in ((0.033, True), (0.025, True), (0.018, False)):
        eta = (4e5 if by == "both sides" else 1e5) * np.arccosh(1 / (1 - share)) ** 2
        (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=eta), 1)
        top, foot = (abs(step.support_force(support)[1]) for support in supports[:2])
        lacks = share if by == "both sides" else 1 - foot / top
        if by == "plates":
            assert_allclose(lacks, share, rtol=2e-3)
        texts = [text for text in step.remarks if "of the forces on body 'bar' are carried by the mass" in text]
        assert len(texts) == (said and lacks > 0.02)
        for text in texts:
            assert_allclose(float(text.split(" s: ")[1].split(" of the forces")[0]), lacks, rtol=0.05)


def test_a_plate_of_any_mass_presses_with_the_force_of_what_it_presses() -> None:
    """A smooth plate of 1000 kg on a bar of 10 kg in plane strain: F = E / (1 - nu^2) e b, whatever the plate weighs; of the work of a load
    step n, n k e^2, the Euler rule dissipates k e^2 / 2."""
    soft = Material(E=1e6, nu=0.3, density=1000.0)
    plates = [rigid_rectangle("floor", (1.0, 0.1), (0.0, -0.05), 1.0), rigid_rectangle("plate", (1.0, 0.1), (0.0, 0.15), 1000.0)]
    down = Support("plate", ("y",), displacement=lambda t: -1e-4 * t)
    supports = [Support("floor", ("x", "y", "rz")), down, Support("plate", ("x", "rz")), Support("bar", ("x",), at=(0.0, 0.0))]
    bar = rectangle("bar", (0.1, 0.1), (4, 4), soft, origin=(-0.05, 0.0))
    model = build_model([Body("bar", bar), *plates], supports=supports)
    for step in Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=1.0), 3):
        force = 1e6 / (1 - 0.3**2) * 1e-3 * step.number * 0.1
        assert_allclose(step.support_force(down), (0.0, -force), rtol=1e-4, atol=1e-4 * force)
        energy = step.energy
        assert abs(energy.residual) < 1e-9 * energy.support_work
        assert_allclose(energy.numerical_dissipation, energy.support_work / (2 * step.number), rtol=1e-4)


def toggle(eta: float) -> Step:
    """Two rigid bars of 1 m and 1 kg, pinned to the ground, to each other at 10 degrees above a line and to a ram on it, whose knee is
    brought down by 0.1 m, so that the ram presses a block."""
    knee, end = np.array([np.cos(np.radians(10)), np.sin(np.radians(10))]), 2 * np.cos(np.radians(10))
    bars = []
    for name, first, last in (("left", np.zeros(2), knee), ("right", knee, np.array([end, 0.0]))):
        along = last - first
        bar, turn = rigid_rectangle(name, (0.9, 0.04), (0.0, 0.0), 1.0), np.stack([along, [-along[1], along[0]]], axis=1)
        bars.append(replace(bar, points=bar.points @ turn.T + 0.5 * (first + last), centre=0.5 * (first + last)))
    block = rectangle("block", (0.5, 0.4), (2, 2), SOFT, origin=(end + 0.2, -0.2))
    bodies = [Body("block", block), *bars, rigid_rectangle("ram", (0.2, 0.5), (end + 0.1, 0.0), 1.0)]
    supports = [Support("block", ("x", "y"), "x+"), Support("ram", ("y", "rz"))]
    model = build_model(bodies, supports=supports)
    pins = [Ball("ground", "left", None, (0.0, 0.0)), Ball("knee", "left", "right", knee), Ball("head", "right", "ram", (end, 0.0))]
    push = Control("push", (("left", knee, 1.0),), (0.0, -1.0), displacement=lambda t: 0.1 * t)
    contact = Everything(model, mu=0.0, exclude=[("left", "right"), ("right", "ram")])
    *_, last_step = Simulation(model, contact, QuasiStatic(0.5, eta=eta), 2, linkage=Linkage(model, [*pins, push]))
    return last_step


def test_struts_between_pins_bear_what_passes_through_them() -> None:
    """Pins press it from both ends, and sum to what its own mass takes: that was said to be 0.61 of the forces on it, "not in equilibrium".

    P = 2 F tan(angle), F = E A e / L of the block; with 3e4 times the mass it is so.
    """
    step = toggle(0.1)
    angle = np.arcsin(np.sin(np.radians(10)) - 0.1)
    force = 1e6 * 0.4 * 2 * (np.cos(angle) - np.cos(np.radians(10))) / 0.5
    assert_allclose(step.contact_force_on("ram")[0], -force, rtol=1e-4)
    assert_allclose(np.linalg.norm(step.link_force("push")), 2 * force * np.tan(angle), rtol=1e-4)
    assert not [text for text in step.remarks if "carried by the mass" in text]
    assert [text for text in toggle(3e3).remarks if "carried by the mass" in text]


def squeezed(eta: float) -> Step:
    """A rigid ball of 1 kg between two blocks of 1 GPa that have come together by 0.2 mm."""
    stiff = Material(E=1e9, nu=0.3, density=1000.0)
    block = partial(brick, size=(0.2, 0.2, 0.05), divisions=(8, 8, 2), material=stiff)
    blocks = [Body(name, block(name, origin=(-0.1, -0.1, z))) for name, z in (("lower", -0.05), ("upper", 0.1))]
    supports = [
        Support("lower", ("x", "y", "z"), "z-"),
        Support("upper", ("x", "y"), "z+"),
        Support("upper", ("z",), "z+", displacement=lambda t: -2e-4 * t),
    ]
    model = build_model([*blocks, rigid_sphere("ball", 0.05, (0.0, 0.0, 0.05), 1.0)], supports=supports)
    (step,) = Simulation(model, ExactContacts(model, mu=0.3), QuasiStatic(1.0, eta=eta), 1, cuttings=0)
    return step


def test_a_ball_that_is_squeezed_is_in_equilibrium() -> None:
    """Both blocks press it with 1.9 kN, and its mass carries 0.01 N of it: that is no lack of equilibrium. A mass too faint to be seen is
    refused with one that is enough."""
    step = squeezed(100.0)
    lower, upper = step.contact_force_on(0)[2], step.contact_force_on(1)[2]
    assert_allclose(upper, -lower, rtol=1e-4)
    assert upper > 1000.0
    assert not [text for text in step.remarks if "carried by the mass" in text]
    with pytest.raises(NotConverged, match="rigid body 'ball', which only contact holds") as told:
        squeezed(1e-2)
    enough = squeezed(float(str(told.value).rsplit(" ", 1)[1]))
    assert_allclose(enough.contact_force_on(1)[2], upper, rtol=1e-4)


def clamped(eta: float) -> tuple[float, list[str]]:
    """Deflection [m] of a steel strip of 1 m between jaws, 20 mm thick, under 10 kPa, and what is said of the mass."""
    steel = Material(E=2e11, nu=0.3, density=7800.0)
    strip = rectangle("strip", (1.4, 0.02), (56, 2), steel, elements="Q1-enhanced", origin=(-0.7, 0.0))
    part = with_surface(strip, "span", lambda x: (x[1] > 0.02 - 1e-9) & (np.abs(x[0]) <= 0.5 + 1e-9))
    jaws = [rigid_rectangle(f"jaw {x} {y}", (0.2, 0.1), (x, y), 1.0) for x in (-0.6, 0.6) for y in (-0.05, 0.07)]
    supports = [Support(jaw.name, ("x", "y", "rz")) for jaw in jaws] + [Support("strip", ("x",), at=(0.0, 0.0))]
    model = build_model([Body("strip", part), *jaws], supports=supports, loads=[Traction("strip", "span", (0.0, -1e4))])
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=eta), 1)
    return -float(step.state.x[: model.n_elastic].min()), [text for text in step.remarks if "regularises statics" in text]


def test_a_strip_between_jaws_that_the_mass_holds_up_is_named_by_what_it_lacks() -> None:
    """Jaws press by many times the load, so that the mass carries little of all forces, and yet a fifth of the deflection is missing."""
    right, nothing = clamped(10.0)
    assert_allclose(right, 1e4 * (1 - 0.3**2) / (32 * 2e11 * 0.02**3), rtol=0.1)  # clamped q L^4 / (384 D); jaws' edges give way
    assert not nothing
    for eta, most in ((1e4, 0.03), (1e5, 0.2)):
        deflection, (said,) = clamped(eta)
        share = re.search(r"([0-9.]+) of the work on body 'strip' is taken by the mass", said)
        assert share is not None
        assert_allclose(float(share[1]), 1 - deflection / right, rtol=0.15)
        assert float(share[1]) < most


def billet(cells: tuple[int, int], law: AnyMaterial = STEEL, pace: float = 4e-4) -> tuple[Model, Support]:
    """Of plastic steel, 0.1 x 0.15 m, in plane strain, that only two plates hold, of which one comes down."""
    block = Body("billet", rectangle("billet", (0.1, 0.15), cells, law, elements="Q1-bbar", origin=(-0.05, 0.0)))
    plates = [rigid_rectangle("floor", (0.4, 0.1), (0.0, -0.05), 1.0), rigid_rectangle("plate", (0.4, 0.1), (0.0, 0.2), 1.0)]
    down = Support("plate", ("y",), displacement=lambda t: -pace * t)
    supports = [Support("floor", ("x", "y", "rz")), down, Support("plate", ("x", "rz"))]
    return build_model([block, *plates], supports=supports), down


def test_the_mass_that_is_advised_for_a_plastic_billet_is_that_of_the_body() -> None:
    """Whatever its cells, and whoever has it already is told a larger one."""

    def advised(cells: tuple[int, int], eta: float) -> float:
        *_, text = doubts(billet(cells)[0], QuasiStatic(1.0, eta=eta), linkage=None)
        return float(text.split("has lost its stiffness")[1].split("try eta = ")[1].split(" and")[0])

    eta = advised((3, 5), 1e4)
    assert advised((6, 10), 1e4) == eta
    assert 2 * eta <= advised((3, 5), eta) <= 4 * eta


@pytest.mark.parametrize("eta", [1e4, 1e6])
def test_a_plastic_billet_is_not_carried_by_the_mass(eta: float) -> None:
    """It bears 2 / sqrt(3) times its yield stress, and some percent of friction."""
    model, down = billet((3, 5))
    *_, step = Simulation(model, Everything(model, mu=0.1), QuasiStatic(1.0, eta=eta), 2, cuttings=0)
    force, limit = -step.support_force(down)[1], 2 / np.sqrt(3) * 2e8 * 0.1
    assert limit < force < 1.06 * limit
    assert_allclose(step.contact_force_on(1)[1], -force, rtol=2e-3)


def test_rubber_pressed_by_a_tenth_needs_no_mass_that_bears_anything() -> None:
    """A mass that bore a percent's pressure was advised anew five times; the forces of both plates are opposite, whatever the mass."""
    model, _ = billet((2, 3), neo_hooke(1e6, 0.3, 1000.0), 7.5e-3)

    def run(eta: float) -> np.ndarray:
        simulation = Simulation(model, Everything(model, mu=0.3), QuasiStatic(1.0, eta=eta), 2, cuttings=0, witness=None)
        *_, step = simulation
        return np.array([step.contact_force_on(body)[1] for body in (1, 2)])

    little, more = run(1.0), run(10.0)
    assert_allclose(little[0], -little[1], rtol=1e-4)
    assert_allclose(little, more, rtol=1e-3)
