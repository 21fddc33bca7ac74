"""Every material in motion: momentum, angular momentum and energy are kept, nothing is created, and what goes on gives the same bits."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import (
    ByRegion,
    FinitePlastic,
    LinearHardening,
    Material,
    Orthotropic,
    Plastic,
    PointFunction,
    Thermal,
    Variable,
    Viscoelastic,
    mooney_rivlin,
    neo_hooke,
    neo_hooke_isochoric,
    ogden,
    saint_venant_kirchhoff,
)
from fcsim.mesh.material.law import Circumstances
from fcsim.mesh.part import Body
from fcsim.timestep.limits import Limits
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.theta import Theta

E, RHO = 1e6, 1000.0


def damage(strain: np.ndarray, before: np.ndarray, at: Circumstances) -> tuple[np.ndarray, ...]:
    """sigma = E (1 - D) eps, 1 - D = limit / k, k the largest |eps| so far."""
    limit = 2e-2
    size = np.sqrt(np.einsum("nij,nij->n", strain, strain))
    k = np.maximum(np.maximum(size, before[:, 0]), limit)
    unit = 0.5 * E * (np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3)) + np.einsum("il,jk->ijkl", np.eye(3), np.eye(3)))
    growing = np.where((size >= k) & (size > limit), limit / k**3, 0.0)
    share = limit / k
    tangent = share[:, None, None, None, None] * unit - E * np.einsum("n,nij,nkl->nijkl", growing, strain, strain)
    energy = 0.5 * E * size**2
    lost = (limit / np.maximum(before[:, 0], limit) - share) * energy
    return E * share[:, None, None] * strain, tangent, k[:, None], share * energy, lost


MATERIALS: dict[str, Any] = {
    "linear": Material(E, 0.3, RHO),
    "orthotropic": Orthotropic((2 * E, E, 0.5 * E), (0.3, 0.2, 0.1), (0.4 * E, 0.3 * E, 0.3 * E), RHO),
    "saint venant-kirchhoff": saint_venant_kirchhoff(E, 0.3, RHO),
    "neo-hooke": neo_hooke(E, 0.3, RHO),
    "neo-hooke isochoric": neo_hooke_isochoric(0.4 * E, 5 * E, RHO),
    "mooney-rivlin": mooney_rivlin(0.15 * E, 0.05 * E, 5 * E, RHO),
    "ogden": ogden([0.3 * E, 0.1 * E], [1.3, -2.0], 5 * E, RHO),
    "plastic": Plastic(E, 0.3, RHO, LinearHardening(1.5e-2 * E, 0.1 * E), kinematic=0.1 * E),
    "finite plastic": FinitePlastic(E, 0.3, RHO, LinearHardening(1.5e-2 * E, 0.1 * E)),
    "viscoelastic": Viscoelastic(E, 0.3, RHO, ((0.3, 1e-2), (0.2, 1e-1))),
    "warm": Thermal(neo_hooke(E, 0.3, RHO), 1e-4, 50.0),
    "damage": PointFunction(damage, RHO, "small", (Variable("largest"),)),
    "bonded": ByRegion({"a": neo_hooke(E, 0.3, RHO), "b": Plastic(2 * E, 0.2, 2 * RHO, 2e-2 * E)}),
}
LOSES = {"plastic", "finite plastic", "viscoelastic", "damage", "bonded"}


def thrown(material: Any, steps: int, theta: float = 0.5) -> Simulation:
    """A bar that spins, flies and is stretched, out of reach of anything."""
    part = rectangle("bar", (1.0, 0.3), (4, 1), Material(E, 0.3, RHO))
    left = part.points[part.cells].mean(axis=1)[:, 0] < 0.5
    if isinstance(material, ByRegion):
        part = replace(part, material=material, regions={"a": np.flatnonzero(left), "b": np.flatnonzero(~left)})
    else:
        part = replace(part, material=material)
    model = build_model([Body("bar", part), rigid_rectangle("far", (1, 1), (0, 1e3), 1.0)], supports=[Support("far", ("x", "y", "rz"))])
    pair = SurfacePair(contact_surface(model, [("bar", "y+")]), contact_surface(model, [("far", "y-")]), 0.3, 1e-2)
    start = State(0.0, np.zeros(model.n_dofs), np.zeros(model.n_dofs))
    arm = part.points - [0.5, 0.15]
    v = np.array([3.0, -1.0]) + 4.0 * np.column_stack([-arm[:, 1], arm[:, 0]]) + np.column_stack([4.0 * arm[:, 0], -1.0 * arm[:, 1]])
    start.v[: model.n_elastic] = v.ravel()
    limits = Limits(rotation=np.inf, strain=np.inf)
    return Simulation(model, Detector([pair], model.n_nodes), Theta(2e-3, theta), steps, initial=start, limits=limits, keep=5)


def momenta(simulation: Simulation, state: State) -> np.ndarray:
    model = simulation.model
    p = model.apply_mass(state.v)[: model.n_elastic].reshape(-1, 2)
    x = model.positions(state.x)[: len(p)]
    return np.array([*p.sum(axis=0), (x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]).sum()])


@pytest.mark.parametrize("theta", [0.5, pytest.param(0.7, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", MATERIALS)
def test_balances(name: str, theta: float) -> None:
    simulation = thrown(MATERIALS[name], 10, theta)
    assert simulation.initial is not None
    first = momenta(simulation, simulation.initial)
    steps = list(simulation)
    size = np.array([np.hypot(*first[:2])] * 2 + [abs(first[2])])
    kinetic = steps[0].energy.kinetic
    for step in steps:
        assert np.all(np.abs(momenta(simulation, step.state) - first)[:2] < 1e-9 * size[:2])
        if theta == 0.5:
            assert abs(momenta(simulation, step.state)[2] - first[2]) < 1e-6 * size[2]
        assert abs(step.energy.residual) < 1e-9 * kinetic
        assert step.energy.material_dissipation > -1e-9 * kinetic
    lost = sum(step.energy.material_dissipation for step in steps)
    assert (lost > 1e-4 * kinetic) == (name in LOSES)


@pytest.mark.parametrize("name", MATERIALS)
def test_going_on_gives_the_same_bits(name: str) -> None:
    """From the moment after step 7, with the anchor of step 5; what a file of the run would hold."""
    whole = list(thrown(MATERIALS[name], 8))
    rest = list(thrown(MATERIALS[name], 8).run(after=whole[6].moment, anchor=whole[4].moment))
    assert len(rest) == 1
    for one, other in zip(whole[7:], rest, strict=True):
        assert_array_equal(other.state.x, one.state.x)
        assert_array_equal(other.state.v, one.state.v)
        if one.state.internal is not None:
            assert_array_equal(other.state.internal, one.state.internal)


ELASTIC = ["saint venant-kirchhoff", "neo-hooke", "neo-hooke isochoric", "mooney-rivlin", "ogden"]


@pytest.mark.parametrize(
    ("name", "turns"), [("neo-hooke", 1), *(pytest.param(name, 10, marks=pytest.mark.slow, id=f"{name}-10") for name in ELASTIC)]
)
def test_free_spin_keeps_energy_and_angular_momentum(name: str, turns: int) -> None:
    """To 1e-8 (ten turns), started without centrifugal strain, so that the block breathes by 1 % as it turns, by 0.15 rad a step."""
    part = replace(rectangle("b", (0.4, 0.2), (4, 2), Material(E, 0.3, RHO)), material=MATERIALS[name])
    model = build_model([Body("block", part), rigid_rectangle("far", (1, 1), (0, 1e3), 1.0)], supports=[Support("far", ("x", "y", "rz"))])
    pair = SurfacePair(contact_surface(model, [("block", "y+")]), contact_surface(model, [("far", "y-")]), 0.3, 1e-2)
    omega, h = 12.0, 0.0125
    start = State(0.0, np.zeros(model.n_dofs), np.zeros(model.n_dofs))
    arm = part.points - part.points.mean(axis=0)
    start.v[: model.n_elastic] = (omega * np.column_stack([-arm[:, 1], arm[:, 0]])).ravel()
    n = round(turns * 2 * np.pi / omega / h)
    simulation = Simulation(
        model, Detector([pair], model.n_nodes), Theta(h), n, initial=start, limits=Limits(rotation=np.inf, strain=np.inf)
    )
    energy, moment = 0.5 * float(start.v @ model.apply_mass(start.v)), momenta(simulation, start)[2]
    strained = 0.0
    for step in simulation:
        assert abs(step.energy.kinetic + step.energy.elastic - energy) < 1e-8 * energy
        assert abs(momenta(simulation, step.state)[2] - moment) < 1e-8 * moment
        strained = max(strained, step.energy.elastic / energy)
    assert strained > 1e-3  # energy goes to and fro
