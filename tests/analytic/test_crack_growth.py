"""Crack growth in a joint between beams, mode I and mode II: loads, openings and the energy that fracture takes, from beam theory."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.arrays import FloatArray
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Cohesive, Gap, laws_of_pairs
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part
from fcsim.running.sensors import support_force
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step

E = 1e10


def beam(name: str, size: tuple[float, float], cells: tuple[int, int], y: float = 0.0) -> Part:
    return rectangle(name, size, cells, Material(E, 0.0, 1000.0), plane="stress", elements="Q1-enhanced", origin=(0.0, y))


def cut(part: Part, side: str, at: float, **others: FloatArray) -> Part:
    """The part with its side in two: "crack" up to x = at, "bond" beyond."""
    facets = part.surfaces[side]
    middle = part.points[facets][:, :, 0].mean(axis=1)
    return replace(part, surfaces={**part.surfaces, "crack": facets[middle < at], "bond": facets[middle > at], **others})


def at(part: Part, x: float, y: float) -> np.ndarray:
    """The node at a place, as a surface of its own."""
    node = int(np.argmin(np.hypot(*(part.points - [x, y]).T)))
    assert np.allclose(part.points[node], [x, y])
    return np.array([[node, node]])


def energies(found: list[Step], joint: float, G: tuple[float, float], exact: float, broken: float = 1e-9) -> None:
    """What fracture took is its energies times the broken area, in each step what the reactions took less what joints hold; what the
    supports supply, less what beams and joints hold and load steps lose."""
    last, area = found[-1].law_variables, found[-1].law_variables["area"]
    assert_allclose(np.nansum(area), joint, atol=0.6 * np.nanmax(area))  # the last node stands for half a facet more
    took = sum(step.energy.fracture_dissipation for step in found)
    work_1, work_2 = np.nansum(last["work_1"]), np.nansum(last["work_2"])
    assert_allclose(took, work_1 + work_2, rtol=1e-12)
    assert_allclose(work_1 / G[0] + work_2 / G[1], np.nansum(last["fracture"] * area), rtol=broken)
    assert_allclose(-sum(step.energy.contact_gain for step in found), took - found[-1].energy.contact, rtol=exact)
    supplied = sum(step.energy.support_work - step.energy.numerical_dissipation for step in found)
    assert_allclose(supplied - found[-1].energy.elastic, took, rtol=exact)


@pytest.mark.parametrize(
    ("cells", "steps", "within"),
    [
        ((80, 4), 30, 0.04),
        pytest.param((80, 4), 60, 0.04, marks=pytest.mark.slow),
        pytest.param((160, 8), 40, 0.015, marks=pytest.mark.slow),
    ],
)
def test_a_double_cantilever_beam_opens_by_its_fracture_energy(cells: tuple[int, int], steps: int, within: float) -> None:
    """Half of the specimen on its plane of symmetry, which takes half of the fracture energy: with G = F^2 a^2 / (2 b E I) and the opening
    d = F a^3 / (3 E I) a growing crack has F^2 d = (2 b E I G)^(3/2) / (3 E I), wherever its tip is (and whatever the root gives way).
    The load falls after its peak, F_c = sqrt(2 b E I G) / a less what the root and the zone of fracture give way. What is left of
    the error is that of elements on a zone some 10 mm long: it does not depend on the load steps."""
    length, depth, crack, strength, G = 0.08, 0.01, 0.03, 1e7, 50.0
    part = cut(beam("beam", (length, depth), cells), "y-", crack)
    floor = rigid_rectangle("floor", (2 * length, length), (length / 2, -length / 2), 1.0)
    stiffness = E * depth**3 / 12
    opening = 3 * np.sqrt(2 * stiffness * G) * crack**2 / (3 * stiffness)
    supports = [Support("floor", ("x", "y", "rz")), Support("beam", ("x", "y"), "x+"), Support("beam", ("y",), "x-", velocity=opening)]
    model = build_model([Body("beam", part), floor], supports=supports)
    pair = SurfacePair(contact_surface(model, [("beam", "bond")]), contact_surface(model, [("floor", "y+")]), 0.0, 1e-3)
    law = Cohesive(tension=strength, mode_1=G, mode_2=G)
    settings = SolverSettings(name="auto", tol=1e-7, floor=1e-9)
    found = list(Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1 / steps, 0.0, law), steps, settings, witness=None))
    sensor = support_force("F", model, "beam", "y", "x-")
    d, F = np.array([(opening * step.state.t, sensor.measure(step)) for step in found]).T
    growing = slice(6 * steps // 10, steps)
    assert_allclose(F[growing] ** 2 * d[growing], (2 * stiffness * G) ** 1.5 / (3 * stiffness), rtol=within)
    peak = int(np.argmax(F))
    assert 0.75 < F[peak] * crack / np.sqrt(2 * stiffness * G) < 1 and np.all(np.diff(F[peak + steps // 10 :: 3]) < 0)
    assert np.count_nonzero(found[-1].law_variables["fracture"] == 1) > 8
    energies(found, length - crack, (G, G), 1e-9)


@pytest.mark.parametrize(("cells", "steps", "within"), [((50, 2), 20, 0.03), pytest.param((100, 4), 30, 0.03, marks=pytest.mark.slow)])
def test_an_end_loaded_split_slides_by_its_fracture_energy(cells: tuple[int, int], steps: int, within: float) -> None:
    """Two glued beams of depth h clamped at one end and pushed across at the other, where they are split over the length a: the mode II
    of the end-notched flexure specimen, one half of it. With d = F (3 a^3 + L^3) / (2 b E h^3) and G_II = 9 F^2 a^2 / (4 b^2 E h^3)
    the crack length follows from F and d and gives G_II back while the crack grows, which is stable from a = 0.55 L on; the load falls
    from F_c = (2/3) sqrt(b^2 E h^3 G_II) / a, of which the zone of fracture takes some hundredths. The split's faces slide freely."""
    L, h, crack, strength, G = 0.1, 0.005, 0.07, 1e7, 100.0
    strength_zone = 0.008  # what the crack goes through before it has all of its zone of fracture, some (E G h / c^2)^(1/2) long
    lower, upper = beam("lower", (L, h), cells, -h), beam("upper", (L, h), cells)
    upper = cut(upper, "y-", crack, tip=upper.surfaces["x-"][-1:])
    critical = np.sqrt(4 * E * h**3 * G / 9) / crack
    push = 1.35 * critical * (3 * crack**3 + L**3) / (2 * E * h**3)
    supports = [Support(name, ("x", "y"), "x+") for name in ("lower", "upper")] + [Support("upper", ("y",), "tip", velocity=-push)]
    model = build_model([Body("lower", lower), Body("upper", upper)], supports=supports)
    ground = contact_surface(model, [("lower", "y+")])
    pairs = [SurfacePair(contact_surface(model, [("upper", name)]), ground, 0.0, 2e-3, name=name) for name in ("bond", "crack")]
    detector = Detector(pairs, model.n_nodes)
    law = laws_of_pairs(detector, {"bond": Cohesive(tension=4 * strength, shear=strength, mode_1=4 * G, mode_2=G)}, Gap())
    settings = SolverSettings(name="auto", tol=1e-8, floor=1e-10)
    found = list(Simulation(model, detector, QuasiStatic(1 / steps, 0.0, law), steps, settings, witness=None))
    sensor = support_force("F", model, "upper", "y", "tip")
    F, d = np.array([(-sensor.measure(step), push * step.state.t) for step in found]).T
    a = np.cbrt((2 * E * h**3 * d / F - L**3) / 3)
    growing = (a > crack + strength_zone) & (a < 0.95 * L)
    assert np.count_nonzero(growing) >= 3 and np.all(np.diff(a[growing]) > 0)
    assert_allclose((9 * F**2 * a**2 / (4 * E * h**3))[growing], G, rtol=within)
    assert 0.9 < F.max() / critical < 1.0 and F[-1] < 0.97 * F.max()
    energies(found, L - crack, (4 * G, G), 2e-3, 0.05)  # faces that slide bend: gaps are closed to second order; some slide under tension


@pytest.mark.slow
@pytest.mark.parametrize(("cells", "steps", "within"), [((100, 2), 40, 0.02), ((100, 2), 80, 0.02)])
def test_an_end_notched_flexure_specimen_slides_by_its_fracture_energy(cells: tuple[int, int], steps: int, within: float) -> None:
    """The whole specimen: two glued beams of depth h on two supports 2 L apart, pushed down in the middle, split over the length a from one
    end. Beam theory (Russell, Street, 1982): d = F (3 a^3 + 2 L^3) / (8 b E h^3), G_II = 9 F^2 a^2 / (16 b^2 E h^3), stable with driven d
    from a = L / 3^(1/3) = 0.69 L on. The crack length follows from F and d and gives G_II back while the crack grows; the load falls
    from F_c = 4/3 sqrt(b^2 E h^3 G_II) / a. The faces of the split press on each other and slide freely."""
    L, h, crack, strength, G = 0.1, 0.005, 0.08, 1e7, 100.0
    strength_zone = 0.006  # see the end-loaded split
    lower, upper = beam("lower", (2 * L, h), cells, -h), beam("upper", (2 * L, h), cells)
    lower = replace(lower, surfaces={**lower.surfaces, "left": at(lower, 0.0, -h), "right": at(lower, 2 * L, 0.0)})
    upper = cut(upper, "y-", crack, middle=at(upper, L, h), right=at(upper, 2 * L, 0.0))
    critical = 4 / 3 * np.sqrt(E * h**3 * G) / crack
    push = 1.2 * critical * (3 * crack**3 + 2 * L**3) / (8 * E * h**3)
    # the right support at the height of the joint, so that it holds both beams, which turn about it
    supports = [Support("lower", ("y",), "left"), *(Support(name, ("x", "y"), "right") for name in ("lower", "upper"))]
    supports.append(Support("upper", ("y",), "middle", velocity=-push))
    model = build_model([Body("lower", lower), Body("upper", upper)], supports=supports)
    ground = contact_surface(model, [("lower", "y+")])
    pairs = [SurfacePair(contact_surface(model, [("upper", name)]), ground, 0.0, 2e-3, name=name) for name in ("bond", "crack")]
    detector = Detector(pairs, model.n_nodes)
    law = laws_of_pairs(detector, {"bond": Cohesive(tension=4 * strength, shear=strength, mode_1=4 * G, mode_2=G)}, Gap())
    settings = SolverSettings(name="auto", tol=1e-8, floor=1e-10)
    found = list(Simulation(model, detector, QuasiStatic(1 / steps, 0.0, law), steps, settings, witness=None))
    sensor = support_force("F", model, "upper", "y", "middle")
    F, d = np.array([(-sensor.measure(step), push * step.state.t) for step in found]).T
    a = np.cbrt((8 * E * h**3 * d / F - 2 * L**3) / 3)
    assert_allclose((3 * crack**3 + 2 * L**3) / (8 * E * h**3), d[2] / F[2], rtol=within)  # before it grows
    growing = (a > crack + strength_zone) & (a < 0.98 * L)  # the load is at L
    assert np.count_nonzero(growing) >= 3 and np.all(np.diff(a[growing]) > 0)
    assert_allclose((9 * F**2 * a**2 / (16 * E * h**3))[growing], G, rtol=within)
    assert 0.9 < F.max() / critical < 1.0 and F[-1] < 0.97 * F.max()
    energies(found, 2 * L - crack, (4 * G, G), 2e-3, 0.1)  # beneath the load some slide under tension, which takes less than G_II
