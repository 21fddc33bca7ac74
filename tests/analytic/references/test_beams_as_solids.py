"""Beams as solids against beam theory: the elastica, a bimetal strip, a bar that heats up between supports, each in several units."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_bvp

from fcsim.assembly.loads import Traction
from fcsim.assembly.supports import Support
from fcsim.mesh.material import ByRegion, Material, neo_hooke, saint_venant_kirchhoff
from fcsim.mesh.material.thermal import Thermal
from tests.analytic.references.loading import alone, displacement, support_force
from tests.analytic.references.meshes import block, spaced


def elastica(load: float) -> tuple[float, float]:
    """(x, y) of the tip over L under a dead force across, P L^2 / (E I) = load: theta'' = -load cos(theta)."""
    s = np.linspace(0, 1, 201)
    found = solve_bvp(lambda s, y: [y[1], -load * np.cos(y[0])], lambda a, b: [a[0], b[1]], s, [np.sin(s), 1 - s], tol=1e-8)
    angle = found.sol(s)[0]
    return float(np.trapezoid(np.cos(angle), s)), float(np.trapezoid(np.sin(angle), s))


@pytest.mark.parametrize(("unit", "force"), [(1.0, 1.0), (1e-3, 1e-9)])
def test_elastica(unit: float, force: float) -> None:
    """P L^2 / (E I) = 5 takes the tip of a slender beam to 0.714 L across and 0.612 L along (K. E. Bisshopp and D. C. Drucker, 1945): in
    plane stress, of second order, L / h = 50."""
    L, h, load = unit, 0.02 * unit, 5.0
    x, y = elastica(load)
    assert_allclose([x, y], [1 - 0.38763, 0.71379], atol=1e-4)
    E = 1e6 * force / unit**2
    P = load * E * h**3 / 12 / L**2
    part = block("beam", [spaced(0, L, 16), spaced(0, h, 1)], saint_venant_kirchhoff(E, 0.0, 1.0), "Q2", plane="stress")
    model, steps = alone(part, [Support("body", ("x", "y"), "x-")], [Traction("body", "x+", (0.0, P / h), factor=lambda t: t)], 10)
    end = np.unique(part.surfaces["x+"])
    tip = (part.points + displacement(model, steps[-1], "body"))[end].mean(axis=0)
    assert_allclose([tip[0] / L, (tip[1] - 0.5 * h) / L], [x, y], rtol=5e-3)


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_bimetal_strip(unit: float) -> None:
    """Two layers of equal thickness and modulus, alpha 2e-5 and 1e-5, warmed by 100 K: curvature 3/2 (alpha_1 - alpha_2) T / h (S.
    Timoshenko, 1925), h the whole thickness; bonded by shared nodes."""
    L, h, T = unit, 0.05 * unit, 100.0
    layers = {
        "low": lambda p: p[:, 1] < 0.5 * h,
        "high": lambda p: p[:, 1] > 0.5 * h,
    }
    steel = Material(2e11 / unit**2, 0.3, 1.0)
    materials = ByRegion({"low": Thermal(steel, 2e-5, T), "high": Thermal(steel, 1e-5, T)})
    part = block("strip", [spaced(0, L, 20), spaced(0, h, 2)], materials, "Q2", plane="stress", regions=layers)
    model, steps = alone(part, [Support("body", ("x",), "x-"), Support("body", ("y",), "x-")])
    u = displacement(model, steps[-1], "body")
    middle = np.isclose(part.points[:, 1], 0.5 * h)
    x, w = part.points[middle, 0], u[middle, 1]
    away = (x > 0.2 * L) & (x < 0.8 * L)  # of ends that are held or free
    assert_allclose(2 * np.polyfit(x[away], w[away], 2)[0], 1.5 * 1e-5 * T / h, rtol=5e-3)


@pytest.mark.parametrize("finite", [False, True])
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_bar_that_warms_between_supports(finite: bool, unit: float) -> None:
    """Held at both ends and in plane strain: sigma_xx = -E alpha T / (1 - nu), free across: eps_yy = alpha T (1 + 2 nu / (1 - nu))."""
    E, nu, alpha, T = 2e11 * unit, 0.25, 1e-5, 10.0
    material = neo_hooke(E, nu, 1.0) if finite else Material(E, nu, 1.0)
    part = block("bar", [spaced(0, 1, 6), spaced(0, 0.2, 2)], Thermal(material, alpha, T))
    supports = [Support("body", ("x",), "x-"), Support("body", ("x",), "x+"), Support("body", ("y",), "y-")]
    model, steps = alone(part, supports)
    force = support_force(model, steps[-1], "body")[np.unique(part.surfaces["x+"]), 0].sum()
    assert_allclose(force / 0.2, -E * alpha * T / (1 - nu), rtol=2e-3)
    top = displacement(model, steps[-1], "body")[np.unique(part.surfaces["y+"]), 1]
    assert_allclose(top, 0.2 * alpha * T * (1 + nu) / (1 - nu), rtol=2e-3)
