"""Steps with nonlinear bodies: orders of convergence, balances, contact found anew, refusals."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.loads import Traction
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError, NotConverged
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Hyperelastic, Material, Plastic, PointFunction, Variable, mooney_rivlin, neo_hooke, saint_venant_kirchhoff
from fcsim.mesh.material.law import LinearLaw
from fcsim.mesh.part import Body
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.theta import Theta
from tests.unit.timestep.free_spin import FAR, angular_momentum, spinning

Pairs = list[tuple[str, str, str, str]]


def simulation(model: Model, pairs: Pairs, scheme: Scheme, steps: int, mu: float = 0.3, **options: Any) -> Simulation:
    found = [SurfacePair(contact_surface(model, [(a, b)]), contact_surface(model, [(c, d)]), mu, 1e-2) for a, b, c, d in pairs]
    return Simulation(model, Detector(found, model.n_nodes), scheme, steps, **options)


def pulled(material: Any, traction: float, **options: Any) -> Model:
    """A unit square in plane strain, pulled or pressed on its top, and a rigid body far away."""
    part = rectangle("sq", (1, 1), (3, 3), material, elements=options.pop("elements", "Q1"), **options)
    held = [Support("sq", ("y",), "y-"), Support("sq", ("x",), "x-"), Support("far", ("x", "y", "rz"))]
    load = Traction("sq", "y+", (0, traction), factor=lambda t: t)
    return build_model([Body("sq", part), rigid_rectangle("far", (1, 1), (0, FAR), 1.0)], supports=held, loads=[load])


AWAY = [("sq", "y+", "far", "y-")]


def order(residuals: list[float]) -> float:
    """Of convergence, from the last three residuals above round-off."""
    e = [r for r in residuals if r > 1e-12][-3:]
    return float(np.log(e[2] / e[1]) / np.log(e[1] / e[0]))


def test_quadratic_convergence_in_statics() -> None:
    for step in simulation(pulled(neo_hooke(1.0, 0.3, 1.0), -0.3), AWAY, QuasiStatic(0.5), 2):
        residuals = [problem.residual for problem in step.linearised]
        assert order(residuals) > 1.8, residuals
        assert step.substeps == 1 and residuals[-1] < 1e-9
        assert abs(step.energy.residual) < 1e-9 * step.energy.load_work


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_linear_law_is_linear_elasticity(scale: float) -> None:
    """The same bar by the law of points and by the linear path, in three units of force."""
    ends = []
    for material in (Material(1e6 * scale, 0.3, scale), LinearLaw(Material(1e6 * scale, 0.3, scale))):
        *_, step = simulation(pulled(material, 1e3 * scale), AWAY, QuasiStatic(0.5), 2)
        ends.append(step.state.x)
    assert_allclose(ends[1], ends[0], atol=1e-9 * abs(ends[0]).max())


def test_stiff_body_that_turns_is_not_strained_by_its_turning() -> None:
    """Steel that would yield at a strain of 1e-3, turned by a tenth of a radian a step: the chord is 0.13 % shorter than the arc, and
    yet nothing
    yields; what strains is the spin, rho w^2 L^2 / 3 = 4 kPa."""
    model, start = spinning(Plastic(200e9, 0.3, 1000.0, 200e6), 10.0)
    for step in simulation(model, FREE, Theta(0.01), 3, initial=start):
        assert step.energy.material_dissipation == 0 and step.energy.elastic < 1e-6 * step.energy.kinetic


FREE = [("block", "x-", "far", "x-")]


@pytest.mark.parametrize("d", [2, 3])
def test_spin_of_rubber_keeps_momentum_and_energy(d: int) -> None:
    """A soft block that its spin stretches by some percent, and that swings: angular momentum to the tolerance, energy to 1e-4 though it
    turns by a tenth of a radian a step, the balance closed."""
    model, start = spinning(neo_hooke(1e6, 0.3, 1000.0), 20.0, d)
    energy, momentum = 0.5 * start.v @ model.apply_mass(start.v), angular_momentum(model, start)
    for step in simulation(model, FREE, Theta(8e-3), 20, initial=start):
        assert abs(step.energy.residual) < 1e-9 * energy
        assert abs(step.energy.kinetic + step.energy.elastic - energy) < 1e-4 * energy
    assert_allclose(angular_momentum(model, step.state), momentum, rtol=1e-8, atol=1e-8 * np.linalg.norm(momentum))
    assert step.state.t > 0.159 and step.substeps == 1


@pytest.mark.parametrize("scheme", [Theta(2e-3, 0.7), GeneralisedAlpha(2e-3, 0.6)], ids=["theta", "generalised alpha"])
def test_balance_closes_with_damping(scheme: Scheme) -> None:
    model, start = spinning(saint_venant_kirchhoff(1e6, 0.3, 1000.0), 20.0, beta=1e-3)
    energy = 0.5 * start.v @ model.apply_mass(start.v)
    for step in simulation(model, FREE, scheme, 20, initial=start):
        assert abs(step.energy.residual) < 1e-9 * energy
        assert step.energy.damping_dissipation > -1e-12 * energy
        assert not step.remarks or "covers" not in "".join(step.remarks)


def test_turning_law_of_small_strain_follows_the_floating_frame() -> None:
    """Small strain at any rotation, by Green and Lagrange's strain in each point and by a frame of the body: one motion, to O(strain)."""
    ends = []
    for material in (Material(1e8, 0.3, 1000.0), LinearLaw(Material(1e8, 0.3, 1000.0))):
        model, start = spinning(material, 10.0)
        *_, step = simulation(model, FREE, Theta(2e-3), 30, initial=start)
        ends.append(step.state.x[: model.n_elastic])
    assert_allclose(ends[1], ends[0], atol=2e-3 * abs(ends[0]).max())


def pressed(mu: float, slide: float = 0.0, material: Any = None, **options: Any) -> Model:
    """A rubber block 0.2 x 0.1 pressed on a rigid plane by 20 % and then pulled along."""
    part = rectangle("rubber", (0.2, 0.1), (6, 3), material or neo_hooke(1e6, 0.4, 1000.0))
    plane = rigid_rectangle("plane", (2.0, 0.2), (0.1, -0.1), 1.0)
    supports = [
        Support("plane", ("x", "y", "rz")),
        Support("rubber", ("y",), "y+", velocity=lambda t: -0.02 if t < 1 else 0.0),
        Support("rubber", ("x",), "y+", velocity=lambda t: slide if t > 1 else 0.0),
    ]
    return build_model([Body("rubber", part), plane], supports=supports, **options)


ON_PLANE = [("rubber", "y-", "plane", "y+")]


def test_pressing_and_sliding_converge_quadratically_and_obey_coulomb() -> None:
    *_, step = steps = list(simulation(pressed(0.3, slide=0.1), ON_PLANE, QuasiStatic(0.25), 8, mu=0.3))
    for each in steps:
        residuals = [p.residual for p in each.linearised]
        assert residuals[-1] < 1e-9 and each.penetration < 1e-9
        assert each.substeps == 1
        if sum(r > 1e-12 for r in residuals) >= 3:
            assert order(residuals) > 1.6, residuals
    normal, tangent = step.contact_force[:, 0], step.contact_force[:, 1]
    assert normal.min() >= 0 and normal.sum() > 1e4
    assert_allclose(abs(tangent), 0.3 * normal, rtol=1e-6, atol=1e-6 * normal.max())  # all slides
    assert step.energy.contact_gain < 0
    moved = step.support_impulse[: step.model.n_elastic].reshape(-1, 2).sum(axis=0)
    assert_allclose(moved + step.contact_force_on(0), 0, atol=1e-7 * normal.sum())


def test_impact_of_rubber_keeps_the_balance() -> None:
    """A rubber block thrown on a plane: contact once a step, the balance closed, nothing created."""
    part = rectangle("rubber", (0.2, 0.1), (4, 2), neo_hooke(1e6, 0.4, 1000.0))
    plane = rigid_rectangle("plane", (2.0, 0.2), (0.1, -0.1), 1.0)
    model = build_model([Body("rubber", part), plane], supports=[Support("plane", ("x", "y", "rz"))], gravity=lambda t: (0, -9.81))
    v = np.zeros(model.n_dofs)
    v[: model.n_elastic].reshape(-1, 2)[:] = (1.0, -4.0)
    x = np.zeros(model.n_dofs)
    x[1 : model.n_elastic : 2] = 0.005
    start, strained = State(0.0, x, v), 0.0
    kinetic = 0.5 * v @ model.apply_mass(v)
    for step in simulation(model, ON_PLANE, Theta(5e-4), 40, initial=start):
        assert abs(step.energy.residual) < 1e-8 * kinetic
        assert step.energy.friction_dissipation >= -1e-9 * kinetic
        strained = max(strained, step.energy.elastic)
    assert strained > 0.2 * kinetic


@pytest.mark.slow
def test_a_step_too_long_is_cut_and_what_cannot_be_says_why() -> None:
    """Pulled to seven times its length in one step; a law that has no state beyond a stretch; and a load under which the block buckles."""
    model = pulled(neo_hooke(1.0, 0.3, 1.0), 2.5)
    *_, step = simulation(model, AWAY, QuasiStatic(1.0), 1)
    assert step.state.x[1 : model.n_elastic : 2].max() > 4
    with pytest.raises(NotConverged, match=r"body .sq. has lost its stiffness: it buckles|did not settle"):
        list(simulation(pulled(neo_hooke(1.0, 0.3, 1.0), -4.0), AWAY, QuasiStatic(1.0), 1))

    def locking(F: np.ndarray, before: np.ndarray, at: Any) -> Any:
        answer = neo_hooke(1.0, 0.3, 1.0).respond(F, before, at, True)
        stress = np.where(F[:, 1:2, 1:2] > 1.2, np.nan, answer.stress)
        return stress, answer.tangent, before, answer.energy, answer.dissipated

    with pytest.raises(NotConverged, match=r"Newton from the last state: (a body has no admissible state|did not settle)"):
        list(simulation(pulled(PointFunction(locking, 1.0), 2.0), AWAY, QuasiStatic(0.5), 2))


def test_a_load_beyond_what_a_plastic_body_bears_is_said() -> None:
    """A square in plane stress without hardening: sigma_y is its limit load (statics). Below it holds, elastic; beyond the last
    load that it bore, found in parts of h/32, is named."""
    perfect, tenths = Plastic(1000.0, 0.3, 1.0, 1.0), QuasiStatic(0.1)
    *_, step = simulation(pulled(perfect, 0.99, plane="stress"), AWAY, tenths, 10)
    assert_allclose(step.state.x[1 : step.model.n_elastic : 2].max(), 0.99e-3, rtol=1e-6)
    with pytest.raises(
        NotConverged, match=r"more than plastic body 'sq' can bear \(its limit load\).*t = 0.95\d* s, 0.95\d* of those"
    ) as said:
        list(simulation(pulled(perfect, 1.05, plane="stress"), AWAY, tenths, 10))
    assert "displacement in place of the load" in str(said.value)


def test_a_plastic_body_that_is_far_from_yielding_is_not_blamed() -> None:
    """Beside the square that collapses, as above, stands one that bears a tenth of its limit load, and comes first."""
    weak, strong = Plastic(1000.0, 0.3, 1.0, 1.0), Plastic(1000.0, 0.3, 1.0, 10.0)
    parts = [rectangle(name, (1, 1), (1, 1), law, plane="stress") for name, law in (("strong", strong), ("weak", weak))]
    bodies = [Body(part.name, part, translation=(2.0 * k, 0.0)) for k, part in enumerate(parts)]
    held = [Support(part.name, (axis,), f"{axis}-") for part in parts for axis in "xy"] + [Support("far", ("x", "y", "rz"))]
    loads = [Traction(part.name, "y+", (0, 1.05), factor=lambda t: t) for part in parts]
    model = build_model([*bodies, rigid_rectangle("far", (1, 1), (0, FAR), 1.0)], supports=held, loads=loads)
    with pytest.raises(NotConverged, match="more than plastic body 'weak' can bear"):
        list(simulation(model, [("strong", "y+", "far", "y-")], QuasiStatic(0.5), 2, cuttings=1))


def test_a_law_with_memory_from_elsewhere() -> None:
    """A damage law at points: s = (1 - D) C eps, D = 1 - e0 / e of the largest e = sqrt(eps : eps) so far, above e0: what is taken from the
    stored energy is dissipated, and the unloaded bar goes back to zero on the secant."""
    C = LinearLaw(Material(1e6, 0.0, 1.0))
    e0 = 1e-3

    def damage(eps: np.ndarray, before: np.ndarray, at: Any) -> Any:
        e = np.sqrt(np.einsum("nij,nij->n", eps, eps))
        k = np.maximum(np.maximum(e, before[:, 0]), e0)
        intact = e0 / k
        elastic = C.respond(eps, before[:, :0], at, True)
        growing = (e >= k) & (e > e0)
        soften = np.where(growing, -e0 / np.where(e > 0, e, 1.0) ** 3, 0.0)
        tangent = intact[:, None, None, None, None] * elastic.tangent
        tangent = tangent + np.einsum("n,nij,nkl->nijkl", soften, elastic.stress, eps)
        lost = 0.5 * (e0 / np.maximum(before[:, 0], e0) - intact) * np.einsum("nij,nij->n", elastic.stress, eps)
        return intact[:, None, None] * elastic.stress, tangent, k[:, None], intact * elastic.energy, lost

    law = PointFunction(damage, 1.0, strain="small", variables=(Variable("largest_strain"),))
    part = rectangle("sq", (1, 1), (2, 2), law)
    held = [Support("sq", ("y",), "y-"), Support("sq", ("x",), "x-"), Support("far", ("x", "y", "rz"))]
    drive = Support("sq", ("y",), "y+", velocity=lambda t: 1e-3 if t < 3 else -1e-3)
    model = build_model([Body("sq", part), rigid_rectangle("far", (1, 1), (0, FAR), 1.0)], supports=[*held, drive])
    force, dissipated = [], 0.0
    for step in simulation(model, AWAY, QuasiStatic(0.5), 12):
        top = model.dof_of_node[np.unique(model.facets("sq", "y+")), 1]
        force.append(step.support_impulse[top].sum())
        assert step.energy.material_dissipation >= -1e-12
        assert abs(step.energy.residual) < 1e-9
        dissipated += step.energy.material_dissipation
    strain = 0.5e-3 * np.array([1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1, 0])
    largest = np.maximum.accumulate(strain)
    assert_allclose(force, 1e6 * strain * np.minimum(1, e0 / largest), atol=1e-6)
    assert dissipated > 0 and step.energy.elastic < 1e-12


def test_refusals() -> None:
    part = rectangle("sq", (1, 1), (1, 1), neo_hooke(1.0, 0.3, 1.0))
    with pytest.raises(InputError, match="kinematics: expected 'turning' or None for a material of finite strain, got 'linear'"):
        _ = build_model([Body("sq", part, kinematics="linear")]).groups
    with pytest.raises(InputError, match="Hyperelastic, energy: expected no stress at F = 1"):
        Hyperelastic(lambda F, p: 0.5 * p["mu"] * (F[0, 0] ** 2 + F[1, 1] ** 2 + F[2, 2] ** 2), 1.0, {"mu": 1.0})
    with pytest.raises(InputError, match=r"mooney_rivlin: expected C10 \+ C01 > 0 in Pa"):
        mooney_rivlin(-1.0, 0.0, 1.0, 1.0)
    with pytest.raises(InputError, match="parameters\\['mu'\\]: expected a finite number"):
        Hyperelastic(lambda F, p: p["mu"], 1.0, {"mu": float("nan")})
