"""Deformable bodies of unlike material, or lifted off each other, beside closed forms: a wave at the contact of two rods, a press fit, a
heavy beam that is peeled off its bed."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import BodyForce
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.mesh import Body, Part
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material, saint_venant_kirchhoff
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.theta import Theta
from fcsim.witness import Witness
from tests.analytic.references.meshes import block, sector, spaced


@pytest.mark.parametrize(
    ("first", "second", "unit"), [((4e9, 1000.0), (1e9, 1000.0), 1.0), ((1e3, 1e-9), (1e3, 4e-9), 1e3)], ids=["m", "mm, MPa, tonnes"]
)
def test_a_wave_between_unlike_rods(first: tuple[float, float], second: tuple[float, float], unit: float) -> None:
    """A rod of 1 m strikes one of 2 m at rest at v: p = v Z1 Z2 / (Z1 + Z2), Z = (E rho)^(1/2), until the first wave comes back after 2 L /
    c; its contact end has v Z1 / (Z1 + Z2) then, and no energy is lost but the impact of the first nodes."""
    n, v, (Z1, Z2) = 40, 1.0 * unit, (np.sqrt(E * rho) for E, rho in (first, second))
    parts = [
        rectangle(name, (k * unit, 0.05 * unit), (k * n, 1), Material(E, 0.0, rho))
        for name, k, (E, rho) in (("one", 1, first), ("two", 2, second))
    ]
    bodies = [Body("one", parts[0]), Body("two", parts[1], translation=(unit, 0.0))]
    model = build_model(bodies, supports=[Support(name, ("y",)) for name in ("one", "two")])
    speeds = [np.sqrt(E / rho) for E, rho in (first, second)]
    back, h = 2 * unit / speeds[0], 0.5 * unit / n / max(speeds)
    state = at_rest(model)
    velocity = np.where(np.arange(model.n_dofs) < model.dof_offset[1], np.arange(model.n_dofs) % 2 == 0, 0) * v
    simulation = Simulation(model, Everything(model, 0.0), Theta(h), int(0.9 * back / h), initial=replace(state, v=velocity))
    steps = list(simulation)
    force = np.array([step.contact_force_on("two")[0] for step in steps]) / (0.05 * unit)
    times = np.array([step.state.t for step in steps])
    assert_allclose(force[times > 0.3 * back].mean(), v * Z1 * Z2 / (Z1 + Z2), rtol=2e-3)
    end = steps[-1].state.v[model.dof_offset[1] : model.dof_offset[2] : 2]
    left = np.argsort(model.reference[len(parts[0].points) :, 0])[:8]
    assert_allclose(end[left].mean(), v * Z1 / (Z1 + Z2), rtol=2e-2)
    energies = [step.energy.kinetic + step.energy.elastic for step in steps]
    assert_allclose(energies, energies[0], rtol=1e-3)


@pytest.mark.parametrize(("E_shaft", "E_hub"), [(2e11, 2e9), (2e9, 2e11), (7e10, 2e11)])
def test_a_press_fit_of_unlike_materials(E_shaft: float, E_hub: float) -> None:
    """Lamé: what the hub widens by under p and what the shaft, of its own radius, gives way by together are the interference; plane strain,
    Poisson's ratios of 0.3 and 0.2, meshes that do not match."""
    a, b, c, over = 0.02, 0.04, 0.06, 40e-6

    def quarter(name: str, inside: float, outside: float, cells: int, material: Material) -> Body:
        grid = [spaced(0, 1, 6), spaced(0, 1, cells)]
        return Body(name, block(name, grid, material, "Q2", at=sector(inside, outside, 0.0, np.pi / 2)))

    bodies = [quarter("hub", b, c, 29, Material(E_hub, 0.2, 1e3)), quarter("shaft", a, b + over, 24, Material(E_shaft, 0.3, 1e3))]
    supports = [Support(name, (axis,), side) for name in ("hub", "shaft") for axis, side in (("y", "y-"), ("x", "y+"))]
    model = build_model(bodies, supports=supports)
    (step,) = Simulation(model, Everything(model, 0.0), QuasiStatic(1.0), 1, witness=Witness(initial="allow"))

    def widens(E: float, nu: float, ring: tuple[float, float], pressures: tuple[float, float], r: float) -> float:
        (i, o), (p, q) = ring, pressures
        return (1 + nu) / (E * (o * o - i * i)) * ((1 - 2 * nu) * (p * i * i - q * o * o) * r + (p - q) * (i * o) ** 2 / r)

    given = widens(E_hub, 0.2, (b, c), (1.0, 0.0), b) - widens(E_shaft, 0.3, (a, b + over), (0.0, 1.0), b + over)
    assert_allclose(-step.contact_force_on("shaft")[0] / b, over / given, rtol=2e-3)


@pytest.mark.parametrize(("law", "elements", "cells"), [(Material, "Q1-enhanced", 120), (saint_venant_kirchhoff, "Q2", 60)])
def test_a_heavy_beam_is_peeled_off_its_bed(law: type, elements: str, cells: int) -> None:
    """Its end, lifted by d, draws a length a = (24 E I d / q)^(1/4) off a rigid floor and bears F = q a / 2, since there is no moment where
    it lifts off; E that of plane strain. The rest of the weight lies on the floor."""
    E, q, height, length, d = 1e10, 1e4, 0.1, 6.0, 0.002
    beam: Part = rectangle("beam", (length, height), (cells, 2), law(E, 0.3, 1.0), elements=elements)
    floor = rigid_rectangle("floor", (2 * length, 1.0), (length / 2, -0.5), 1.0)
    end = Support("beam", ("y",), at=(length, 0.0), displacement=lambda t: d * t)
    supports = [Support("floor", ("x", "y", "rz")), Support("beam", ("x",), "x-"), end]
    loads = [BodyForce("beam", (0.0, -q / height))]
    model = build_model([Body("beam", beam), floor], supports=supports, loads=loads)
    limits = Limits(rotation=np.inf, strain=np.inf, left_out=np.inf)
    *_, step = Simulation(model, Everything(model, 0.0), QuasiStatic(0.25), 4, limits=limits)
    F = 0.5 * q * (24 * E / 0.91 * height**3 / 12 * d / q) ** 0.25
    assert_allclose(step.support_force(end)[1], F, rtol=5e-3)
    assert_allclose(step.contact_force_on("beam")[1], q * length - F, rtol=5e-3)
