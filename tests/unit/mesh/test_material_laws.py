"""Laws of points: finite differences of energy, stress and tangent for every one, dissipation, limits, refusals."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.mesh.material import (
    ByRegion,
    Circumstances,
    FinitePlastic,
    HardeningFunction,
    HardeningTable,
    Hyperelastic,
    LinearHardening,
    Material,
    OfStretches,
    Orthotropic,
    Plastic,
    PointFunction,
    PointLaw,
    Response,
    Thermal,
    Variable,
    Viscoelastic,
    check_law,
    mooney_rivlin,
    neo_hooke,
    neo_hooke_isochoric,
    ogden,
    saint_venant_kirchhoff,
)
from fcsim.mesh.material.law import LinearLaw, as_tensor, initial_variables

E, SY = 200e9, 250e6
ELASTIC = {
    "linear": LinearLaw(Material(E, 0.3, 1.0)),
    "orthotropic": LinearLaw(Orthotropic((10e9, 1e9, 0.5e9), (0.3, 0.4, 0.02), (0.7e9, 0.1e9, 0.6e9), 500.0)),
    "saint venant-kirchhoff": saint_venant_kirchhoff(1e6, 0.3, 1.0),
    "neo-hooke": neo_hooke(1e6, 0.3, 1.0),
    "neo-hooke isochoric": neo_hooke_isochoric(4e5, 1e7, 1.0),
    "mooney-rivlin": mooney_rivlin(8e5, 2e5, 1e8, 1.0),
    "ogden": ogden([6e5, 2e5], [1.3, -2.0], 1e7, 1.0),
    "thermal": Thermal(neo_hooke(1e6, 0.3, 1.0), 1e-3, 100.0),
}
DISSIPATIVE = {
    "plastic": Plastic(E, 0.3, 1.0, SY),
    "plastic hardening": Plastic(E, 0.3, 1.0, LinearHardening(SY, 2e9), kinematic=3e9),
    "plastic table": Plastic(E, 0.3, 1.0, HardeningTable((0, 1e-3, 1e-2), (SY, 3e8, 3.2e8)), kinematic=1e9),
    "plastic saturating": Plastic(E, 0.3, 1.0, HardeningFunction(lambda e: SY + 1e8 * (1 - np.exp(-200 * e)))),
    "plastic softening": Plastic(E, 0.3, 1.0, LinearHardening(SY, -2e9)),
    "finite plastic": FinitePlastic(E, 0.3, 1.0, LinearHardening(SY, 2e9)),
    "finite plastic, perfect": FinitePlastic(E, 0.3, 1.0, SY),
    "viscoelastic": Viscoelastic(1e9, 0.4, 1.0, ((0.3, 1e-3), (0.2, 1e-2))),
    "warm plastic": Thermal(Plastic(E, 0.3, 1.0, SY), 1e-5, 40.0),
}
NOISE = np.random.default_rng(0).uniform(-1, 1, (8, 3, 3))


def strains(law: PointLaw, size: float, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).uniform(-1, 1, (8, 3, 3))
    return np.eye(3) + 100 * size * noise if law.strain == "finite" else size * (noise + noise.transpose(0, 2, 1))


def respond(law: PointLaw, strain: np.ndarray, before: np.ndarray | None = None, t: float = 1e-3, dt: float = 1e-3) -> Response:
    before = np.tile(initial_variables(law), (len(strain), 1)) if before is None else before
    return law.respond(strain, before, Circumstances(np.zeros((len(strain), 3)), t, dt), True)


@pytest.mark.parametrize("name", sorted(ELASTIC))
def test_elastic_laws_are_derivatives_of_their_energy(name: str) -> None:
    found = check_law(ELASTIC[name])
    assert found.stress < 2e-9 and found.tangent < 2e-9 and found.symmetry < 1e-12


@pytest.mark.parametrize("size", [5e-4, 2e-3])
@pytest.mark.parametrize("name", sorted(DISSIPATIVE))
def test_tangents_of_laws_that_flow(name: str, size: float) -> None:
    """From the beginning, and from a state that has flowed; consistent with the step's stress, and symmetric."""
    law = DISSIPATIVE[name]
    first = respond(law, strains(law, size))
    for strain, before in ((strains(law, size), None), (strains(law, -0.5 * size, 1), first.variables)):
        found = check_law(law, strain, before)
        assert found.tangent < 3e-9 and found.symmetry < 1e-12
    assert np.all(first.dissipated >= 0) and first.dissipated.max() > 0


@pytest.mark.parametrize("name", sorted(DISSIPATIVE))
def test_a_state_that_stays_keeps_stress_and_energy(name: str) -> None:
    law = DISSIPATIVE[name]
    first = respond(law, strains(law, 2e-3))
    again = respond(law, strains(law, 2e-3), first.variables, dt=0.0)
    assert_allclose(again.stress, first.stress, atol=1e-12 * abs(first.stress).max())
    assert_allclose(again.energy, first.energy, rtol=1e-12)
    assert_allclose(again.dissipated, 0, atol=1e-12 * first.dissipated.max())


@pytest.mark.parametrize("name", ["neo-hooke", "ogden", "finite plastic", "thermal"])
def test_finite_laws_do_not_see_rotations(name: str) -> None:
    law = (ELASTIC | DISSIPATIVE)[name]
    R = np.linalg.qr(NOISE[0])[0]
    R[:, 0] *= np.sign(np.linalg.det(R))
    F = strains(law, 2e-3)
    assert_allclose(respond(law, R @ F).stress, R @ respond(law, F).stress, atol=1e-9 * abs(respond(law, F).stress).max())


def test_ogden_of_two_and_minus_two_is_mooney_and_rivlin() -> None:
    F = strains(neo_hooke(1.0, 0.3, 1.0), 2e-3)
    F[:3] = np.eye(3), np.diag([1.2, 1.2, 0.7]), np.diag([1.2, 1.2 + 1e-7, 1.1])
    one, other = ogden([1.6e6, 4e5], [2.0, -2.0], 1e8, 1.0), mooney_rivlin(8e5, 2e5, 1e8, 1.0)
    a, b = respond(one, F), respond(other, F)
    assert a.tangent is not None and b.tangent is not None
    assert_allclose(a.stress, b.stress, atol=1e-12 * abs(b.stress).max())
    assert_allclose(a.tangent, b.tangent, atol=1e-9 * abs(b.tangent).max())


def test_uniaxial_cycle_with_kinematic_hardening() -> None:
    """A bar that yields at sy, hardens with slope E H / (E + H) and, reversed, yields again 2 sy below (Bauschinger): nu = 0 and the strain
    across as the flow asks, found by Newton's method on the law itself."""
    H, law = 20e9, Plastic(E, 0.0, 1.0, SY, kinematic=20e9)
    before, across, stresses = initial_variables(law)[None], 0.0, []
    path = np.concatenate([np.linspace(0, 4e-3, 41), np.linspace(4e-3, 0, 41)])
    for axial in path:
        for _ in range(30):
            answer = respond(law, np.diag([axial, across, across])[None], before)
            assert answer.tangent is not None
            across -= answer.stress[0, 1, 1] / (answer.tangent[0, 1, 1, 1, 1] + answer.tangent[0, 1, 1, 2, 2])
        before = answer.variables
        stresses.append(answer.stress[0, 0, 0])
    slope, top = E * H / (E + H), SY + E * H / (E + H) * (4e-3 - SY / E)
    assert_allclose(stresses[40], top, rtol=1e-9)
    back = np.where(4e-3 - path[41:] <= 2 * SY / E, top - E * (4e-3 - path[41:]), top - 2 * SY - slope * (4e-3 - path[41:] - 2 * SY / E))
    assert_allclose(stresses[41:], back, rtol=1e-6, atol=1e-6 * SY)


def test_relaxation_and_creep_rate_of_prony_series() -> None:
    """A shear held: s(t) = 2 G e (1 - sum g_i (1 - exp(-t / tau_i))), exact for steps of any length; a shear that grows: s of the ramp."""
    terms = ((0.3, 0.1), (0.4, 2.0))
    law, G, e = Viscoelastic(2.6, 0.3, 1.0, terms), 1.0, np.array([[[0, 0.01, 0], [0.01, 0, 0], [0, 0, 0]]])
    state = respond(law, e, t=0.0, dt=1e-12)
    t, taken, energy = 0.0, 0.0, state.energy[0]
    for dt in (0.05, 0.3, 1.0, 5.0):
        state = respond(law, e, state.variables, dt=dt)
        t += dt
        taken += state.dissipated[0]
        assert_allclose(state.stress[0, 0, 1], 2 * G * 0.01 * (1 - sum(g * (1 - np.exp(-t / tau)) for g, tau in terms)), rtol=1e-9)
        assert_allclose(energy - state.energy[0], taken, rtol=1e-9)  # held still, what is lost is dissipated
    ramp = respond(law, e, dt=0.5)
    exact = 0.3 + sum(g * tau / 0.5 * (1 - np.exp(-0.5 / tau)) for g, tau in terms)
    assert_allclose(ramp.stress[0, 0, 1], 2 * G * 0.01 * exact, rtol=1e-12)


def test_free_expansion_has_no_stress_and_held_one_has() -> None:
    stretch = 1 + 1e-3 * 100
    free = respond(ELASTIC["thermal"], stretch * np.eye(3)[None])
    assert abs(free.stress).max() < 1e-9 * 1e6 and abs(free.energy).max() < 1e-9 * 1e6
    held = respond(Thermal(Material(E, 0.3, 1.0), 1e-5, lambda X, t: 100 * t + 0 * X[:, 0]), np.zeros((1, 3, 3)), t=2.0, dt=1.0)
    assert_allclose(held.stress[0], -E / (1 - 2 * 0.3) * 1e-5 * 200 * np.eye(3), rtol=1e-12, atol=1e-3)


def test_hardening() -> None:
    table = HardeningTable((0, 0.1, 0.3), (1.0, 2.0, 2.5))
    at = np.array([0.0, 0.05, 0.1, 0.2, 0.3, 9.0])
    assert_allclose(table.stress(at), [1, 1.5, 2, 2.25, 2.5, 2.5])
    assert_allclose(table.slope(at), [10, 10, 2.5, 2.5, 0, 0])
    given = HardeningFunction(lambda e: 1 + e**2, lambda e: 2 * e)
    assert_allclose(HardeningFunction(given.function).slope(at), given.slope(at), atol=1e-5)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Plastic(-1.0, 0.3, 1.0, 1.0), "Plastic: expected Young's modulus E > 0 in Pa, got -1.0"),
        (lambda: Plastic(1.0, 0.3, 1.0, 0.0), "hardening: expected a yield stress > 0"),
        (lambda: Plastic(1.0, 0.3, 1.0, "steel"), "expected a yield stress in Pa or a Hardening, got str"),  # type: ignore[arg-type]
        (lambda: Plastic(1.0, 0.3, 1.0, 1.0, kinematic=-1), "kinematic: expected a modulus >= 0"),
        (lambda: HardeningTable((0.1, 0.2), (1.0, 2.0)), "ascending from 0"),
        (lambda: HardeningFunction(lambda e: e), "expected yield stresses > 0 in Pa at plastic strains 0 and 0.01"),
        (lambda: Viscoelastic(1.0, 0.3, 1.0, ((0.6, 1.0), (0.5, 2.0))), "with the sum of g below 1"),
        (lambda: Thermal(Material(1.0, 0.3, 1.0), 1e-5, lambda X, t: np.zeros(7)), "expected 13 finite numbers in K"),
        (lambda: Thermal("steel", 1e-5, 1.0), "Thermal, material: expected a material, got str"),  # type: ignore[arg-type]
        (lambda: ogden([1.0], [2.0, 3.0], 1.0, 1.0), "as many mu as alpha"),
        (lambda: ogden([1.0], [0.0], 1.0, 1.0), "exponents alpha that are not 0"),
        (lambda: neo_hooke(1.0, 0.5, 1.0), "neo_hooke: expected Poisson's ratio -1 < nu < 0.5, got 0.5"),
        (lambda: OfStretches(lambda l, p: l[0] ** 2 + l[1] + l[2], 1.0), "the same for all orders"),
        (lambda: OfStretches(lambda l, p: 1e-9 * ((l[0] - 1) ** 2 + 2 * (l[1] - 1) ** 2), 1.0), "the same for all orders"),
        (lambda: Hyperelastic(lambda F, p: F, 1.0), "expected a scalar in UFL"),
        (lambda: PointFunction(lambda F, b, a: F, 1.0).respond(np.eye(3)[None], np.empty((1, 0)), None, True), "expected \\(stress"),  # type: ignore[arg-type]
        (lambda: Variable("largest strain"), "expected a name of letters"),
        (lambda: ByRegion({}), "at least one material"),
        (lambda: ByRegion({"a": 3}), "region 'a': expected a material, got int"),  # type: ignore[dict-item]
    ],
)
def test_refusals(make, text: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=text):
        make()


def test_elasticity_tensor() -> None:
    C = as_tensor(Material(E, 0.3, 1.0).elasticity)
    assert_allclose(C[0, 1, 0, 1], E / 2.6)
    assert_allclose(C, C.transpose(2, 3, 0, 1))
