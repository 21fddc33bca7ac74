"""Energies that users write (Gent, Fung, Yeoh, Ogden, exponential fibres) in finite elements against closed forms of incompressible bodies:
uniaxial and biaxial tension, simple shear, torsion; in Pa and kg, in mm, MPa and t, and with masses of 1e-9; laws in series with a
contrast of 1e4; a temperature; where the energy ends.

For W(I1) incompressible: P = 2 W' (l - l^-2) uniaxial, 2 W' (l - l^-5) biaxial, tau = 2 W' gamma (R. W. Ogden, Non-linear elastic
deformations, 1984, chapter 4); torsion by psi a length: M = pi (C10 + C01) a^4 psi, N = -pi/2 (C10 + 2 C01) a^4 psi^2 (R. S. Rivlin, 1948).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import ByRegion, Hyperelastic, OfStretches, Thermal, check_law, mooney_rivlin, neo_hooke
from tests.analytic.references.loading import alone, displacement, support_force
from tests.analytic.references.meshes import block, spaced

JM, B = 30.0, 0.3


def isochoric(F: Any) -> tuple[Any, Any]:
    import ufl

    J = ufl.det(F)
    return J ** (-2 / 3) * ufl.inner(F, F), J


def gent(F: Any, p: Any) -> Any:
    import ufl

    I1, J = isochoric(F)
    return -0.5 * p["mu"] * JM * ufl.ln(1 - (I1 - 3) / JM) + 0.5 * p["K"] * (J - 1) ** 2


def fung(F: Any, p: Any) -> Any:
    import ufl

    I1, J = isochoric(F)
    return 0.5 * p["mu"] / B * (ufl.exp(B * (I1 - 3)) - 1) + 0.5 * p["K"] * (J - 1) ** 2


def yeoh(F: Any, p: Any) -> Any:
    I1, J = isochoric(F)
    return p["mu"] * (0.5 * (I1 - 3) - 0.02 * (I1 - 3) ** 2 + 0.004 * (I1 - 3) ** 3) + 0.5 * p["K"] * (J - 1) ** 2


def ogden(l: Any, p: Any) -> Any:
    J = l[0] * l[1] * l[2]
    return 2 * p["mu"] / 2.5**2 * (J ** (-2.5 / 3) * (l[0] ** 2.5 + l[1] ** 2.5 + l[2] ** 2.5) - 3) + 0.5 * p["K"] * (J - 1) ** 2


RATE: dict[str, Callable[[float], float]] = {
    "gent": lambda I1: 0.5 * JM / (JM - (I1 - 3)),
    "fung": lambda I1: 0.5 * np.exp(B * (I1 - 3)),
    "yeoh": lambda I1: 0.5 - 0.04 * (I1 - 3) + 0.012 * (I1 - 3) ** 2,
}
"""W'(I1) / mu."""
UNITS = {"SI": (1e6, 1000.0, 0.1), "mm, MPa, t": (1.0, 1e-9, 100.0), "mm, kg": (1e3, 1e-6, 100.0), "1e-9 kg": (1e-3, 1e-6, 1e-3)}
"""Shear modulus, density, length."""


EACH = [
    ("gent", "SI"),
    pytest.param("fung", "mm, MPa, t", marks=pytest.mark.slow),
    pytest.param("yeoh", "mm, kg", marks=pytest.mark.slow),
    ("ogden", "1e-9 kg"),
]


def made(name: str, unit: str) -> tuple[Any, float, float]:
    mu, density, length = UNITS[unit]
    numbers = {"mu": mu, "K": 1e4 * mu}
    law = OfStretches(ogden, density, numbers) if name == "ogden" else Hyperelastic(globals()[name], density, numbers)
    return law, mu, length


def cube(law: Any, length: float, driven: dict[str, float], steps: int = 6) -> np.ndarray:
    """Forces of the driven sides over the area they had; the sides x-, y-, z- slide, the others are free unless driven [of the length]."""
    part = brick("cube", (length,) * 3, (1, 1, 1), law, elements="Q1-bbar")
    supports = [Support("body", (axis,), axis + "-") for axis in "xyz"]
    supports += [Support("body", (axis,), axis + "+", velocity=way * length) for axis, way in driven.items()]
    model, found = alone(part, supports, steps=steps)
    force = support_force(model, found[-1], "body")
    return np.array([force[np.unique(part.surfaces[axis + "+"]), "xyz".index(axis)].sum() for axis in driven]) / length**2


@pytest.mark.parametrize(("name", "unit"), EACH)
def test_uniaxial_and_biaxial_tension(name: str, unit: str) -> None:
    law, mu, length = made(name, unit)
    for l, driven, power in ((1.8, {"x": 0.8}, -2.0), (0.6, {"x": -0.4}, -2.0), (1.4, {"x": 0.4, "y": 0.4}, -5.0)):
        if name == "ogden":
            exact = 2 * mu / 2.5 * (l**1.5 - l ** (-2.25 if power == -2 else -6.0))
        else:
            I1 = l**2 + 2 / l if power == -2 else 2 * l**2 + l**-4
            exact = 2 * mu * RATE[name](I1) * (l - l**power)
        assert_allclose(cube(law, length, driven), exact, rtol=2e-3)


@pytest.mark.parametrize(("name", "unit"), EACH[:3])
def test_simple_shear(name: str, unit: str) -> None:
    """Every node where shear takes it: the energy is W(3 + gamma^2), and the support's force along x on the upper side is tau = 2 W' gamma
    but for what the inclined sides carry, so tau is taken as the rate of the work."""
    law, mu, length = made(name, unit)
    part = brick("cube", (length,) * 3, (1, 1, 1), law, elements="Q1-bbar")
    rigid = [Support("body", ("x", "y", "z"), "z-"), Support("body", ("y", "z"), "z+")]
    model, found = alone(part, [*rigid, Support("body", ("x",), "z+", velocity=0.9 * length)], steps=9)
    top = np.unique(part.surfaces["z+"])
    for step, gamma in ((found[4], 0.5), (found[-1], 0.9)):
        energy = {
            "gent": -0.5 * JM * np.log(1 - gamma**2 / JM),
            "fung": 0.5 / B * (np.exp(B * gamma**2) - 1),
            "yeoh": 0.5 * gamma**2 - 0.02 * gamma**4 + 0.004 * gamma**6,
        }[name]
        assert_allclose(step.energy.elastic, mu * energy * length**3, rtol=1e-6)
        tau = support_force(model, step, "body")[top, 0].sum() / length**2
        assert_allclose(tau, 2 * mu * RATE[name](3 + gamma**2) * gamma, rtol=1e-6)


@pytest.mark.slow
def test_torsion_and_poynting_effect() -> None:
    """A Mooney cylinder turned by 1 rad over its diameter at constant length: moment, and the push on its ends, of second order."""
    a, C10, C01, psi = 1.0, 0.3, 0.15, 0.5

    def disk(p: np.ndarray) -> np.ndarray:
        share, length = np.abs(p[:, :2]).max(axis=1), np.linalg.norm(p[:, :2], axis=1)
        circle = np.divide(share, length, out=np.ones_like(share), where=length > 0)
        return np.column_stack([a * p[:, :2] * (0.8 * (1 - share) + share * circle)[:, None], p[:, 2]])

    L = 1.0
    part = block("bar", [spaced(-1, 1, 8), spaced(-1, 1, 8), spaced(0, L, 4)], mooney_rivlin(C10, C01, 2e3, 1e-9), "Q1-bbar", disk)
    # the whole of both ends turned as planes: between them the cylinder keeps its shape, so that ends disturb nothing
    ends = [
        Support("body", ("x", "y", "z"), "z-"),
        DrivenRotation("body", lambda t: psi * L * t, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), surface="z+"),
    ]
    model, found = alone(part, ends, steps=3)
    top = np.unique(part.surfaces["z+"])
    f = support_force(model, found[-1], "body")[top]
    x = (part.points + displacement(model, found[-1], "body"))[top]
    moment = float((x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0]).sum())
    assert_allclose(moment, np.pi * (C10 + C01) * a**4 * psi, rtol=0.03)
    assert_allclose(f[:, 2].sum(), -0.5 * np.pi * (C10 + 2 * C01) * a**4 * psi**2, rtol=0.05)


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_two_rubbers_in_series_of_a_contrast_of_1e4(unit: float) -> None:
    """Layers of nu = 0 pulled: neo-Hooke's P = mu (l - 1/l), the same in both; the soft one takes the stretch, to 3."""
    soft, hard = 1e3 * unit, 1e7 * unit
    layers = {"soft": lambda p: p[:, 0] < 0.5, "hard": lambda p: p[:, 0] > 0.5}
    law = ByRegion({"soft": neo_hooke(2 * soft, 0.0, unit), "hard": neo_hooke(2 * hard, 0.0, unit)})
    part = block("bar", [spaced(0, 1, 4), spaced(0, 1, 2)], law, regions=layers)
    held = [Support("body", ("x",), "x-"), Support("body", ("y",), "y-"), Support("body", ("x",), "x+", velocity=1.0)]
    model, found = alone(part, held, steps=10)
    force = support_force(model, found[-1], "body")[np.unique(part.surfaces["x+"]), 0].sum()
    l = 3.0 - force / hard / 2  # the hard layer's share, to first order
    assert_allclose(force, soft * (l - 1 / l), rtol=1e-6)


def test_heat_expands_a_users_energy_freely() -> None:
    """No force where nothing holds it; each length grows by alpha T, whatever the energy. What a step warms it by makes a pressure of
    3 K alpha dT before it has grown, which must stay below the shear modulus (docs/bodies.md): here 0.45 of it."""
    law, length = Hyperelastic(gent, 1e-9, {"mu": 1.0, "K": 1e2}), 100.0
    part = brick("cube", (length,) * 3, (2, 1, 1), Thermal(law, 1e-4, lambda X, t: np.full(len(X), 150.0 * t)), elements="Q1-bbar")
    model, found = alone(part, [Support("body", (axis,), axis + "-") for axis in "xyz"], steps=10)
    assert_allclose(displacement(model, found[-1], "body").max(axis=0), 1.5e-2 * length, rtol=1e-8)
    assert np.abs(support_force(model, found[-1], "body")).max() < 1e-6 * length**2


@pytest.mark.slow
def test_beyond_the_limit_of_chains_only_volume_grows() -> None:
    """Gent's I1bar - 3 stays below Jm: stretched to 6.5, where it would be 39.6 without a change of volume, rubber of K = 1e4 mu grows by
    half instead: by the transverse stretch that no stress acts on."""
    law, mu, length = made("gent", "SI")
    l, K = 6.5, 1e4

    def invariant(s: float) -> float:
        return float((l * l + 2 * s * s) * (l * s * s) ** (-2 / 3))

    def slopes(s: float) -> tuple[float, float]:
        """dW/ds, dW/dl over mu."""
        J, I1 = l * s * s, invariant(s)
        chains = 0.5 * JM / (JM - (I1 - 3))
        across = chains * (4 * s * J ** (-2 / 3) - I1 * 4 / (3 * s)) + K * (J - 1) * 2 * l * s
        return across, chains * (2 * l * J ** (-2 / 3) - I1 * 2 / (3 * l)) + K * (J - 1) * s * s

    end = brentq(lambda s: invariant(s) - JM - 3, 0.3, 1.0)
    s = brentq(lambda s: slopes(s)[0], end * (1 + 1e-9), 1.0, xtol=1e-15)
    assert 1.45 < l * s * s < 1.5
    assert_allclose(cube(law, length, {"x": l - 1}, steps=11), mu * slopes(s)[1], rtol=1e-6)


@pytest.mark.parametrize(("name", "unit"), EACH)
def test_finite_differences(name: str, unit: str) -> None:
    found = check_law(made(name, unit)[0])
    assert found.stress < 1e-7 and found.tangent < 1e-7


def test_a_fibre_turns_with_the_body() -> None:
    """An exponential fibre along x beside neo-Hooke: stiffer along it, alike across; plane strain has it too."""

    def fibre(F: Any, p: Any) -> Any:
        import ufl

        I1, J = isochoric(F)
        C = F.T * F
        I4 = C[0, 0]
        return 0.5 * p["mu"] * (I1 - 3) + 0.5 * p["k1"] / p["k2"] * (ufl.exp(p["k2"] * (I4 - 1) ** 2) - 1) + 0.5 * p["K"] * (J - 1) ** 2

    law = Hyperelastic(fibre, 1000.0, {"mu": 1e5, "k1": 3e5, "k2": 0.8, "K": 1e9})
    l = 1.2
    along = cube(law, 0.1, {"x": l - 1})[0]
    stiff = 2 * 3e5 * (l**2 - 1) * np.exp(0.8 * (l**2 - 1) ** 2) * l
    assert_allclose(along, 1e5 * (l - l**-2) + stiff, rtol=2e-3)
    plane = rectangle("plane", (1.0, 1.0), (2, 2), law, elements="Q1-bbar")
    held = [Support("body", ("x",), "x-"), Support("body", ("y",), "y-"), Support("body", ("x",), "x+", velocity=l - 1)]
    model, found = alone(plane, held, steps=4)
    force = support_force(model, found[-1], "body")[np.unique(plane.surfaces["x+"]), 0].sum()
    assert_allclose(force, 1e5 * (l - l**-3) + stiff, rtol=2e-3)
